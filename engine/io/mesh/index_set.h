// A set of small numbers that quickly finds the next member from a given number on.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace ptc {

/// A set of numbers below a fixed size. At first it holds all of them.
///
/// A tree of 64-bit words: bit i of a level says that word i of the level below is not zero.
///
///   level 1   |  1  |  1  |  0  | ...            one bit for each word of level 0
///                |     |     |
///   level 0   |0..63|..127|..191| ...            one bit for each number; the third word is empty
///
/// Every call takes at most one step up and one down per level: 5 levels for 2^28 numbers.
///
/// Memory: a little more than one bit for each number.
class IndexSet {
 public:
  /// Makes the set of all numbers below `size`.
  explicit IndexSet(std::size_t size) {
    for (std::size_t bits = size;; bits = levels_.back().size()) {
      std::vector<std::uint64_t> words((bits + 63) / 64, ~std::uint64_t{0});
      if (bits % 64 != 0) words.back() = (std::uint64_t{1} << bits % 64) - 1;
      levels_.push_back(std::move(words));
      if (levels_.back().size() <= 1) break;
    }
  }

  /// Adds a number below the size; it may be a member already.
  void insert(std::size_t number) noexcept {
    for (auto& level : levels_) {
      level[number / 64] |= std::uint64_t{1} << number % 64;
      number /= 64;
    }
  }

  /// Removes a number below the size; it need not be a member.
  void erase(std::size_t number) noexcept {
    for (auto& level : levels_) {
      level[number / 64] &= ~(std::uint64_t{1} << number % 64);
      number /= 64;
      if (level[number] != 0) return;
    }
  }

  /// Returns the smallest member that is not below `from`, or nothing.
  [[nodiscard]] std::optional<std::size_t> next(std::size_t from) const noexcept {
    for (std::size_t height = 0; height < levels_.size(); ++height) {
      const std::size_t word = from / 64;
      if (word >= levels_[height].size()) return std::nullopt;
      const std::uint64_t rest = levels_[height][word] >> from % 64;
      if (rest != 0) return lowest(height, from + static_cast<std::size_t>(std::countr_zero(rest)));
      from = word + 1;
    }
    return std::nullopt;
  }

 private:
  /// Returns the smallest member that is summarised by a bit of a level. @pre the bit is set
  [[nodiscard]] std::size_t lowest(std::size_t height, std::size_t bit) const noexcept {
    for (; height > 0; --height) {
      bit = bit * 64 + static_cast<std::size_t>(std::countr_zero(levels_[height - 1][bit]));
    }
    return bit;
  }

  std::vector<std::vector<std::uint64_t>> levels_;  // levels_[0] has one bit for each number
};

}  // namespace ptc
