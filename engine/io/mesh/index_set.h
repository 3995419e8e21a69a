// A set of numbers in which the next one is found fast.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace ptc {

/// Numbers below a fixed size; in the beginning all of them are in the set.
///
/// A tree of 64-bit words: bit i of a level says that word i of the level below is not zero.
///
///   level 1                 1 1 0 ...
///   level 0   0..63 have some, 64..127 too, 128..191 none
///
/// Every call takes as many steps as there are levels: 5 for 2^28 numbers.
class IndexSet {
 public:
  explicit IndexSet(std::size_t size) {
    for (std::size_t bits = size;; bits = levels_.back().size()) {
      std::vector<std::uint64_t> words((bits + 63) / 64, ~std::uint64_t{0});
      if (bits % 64 != 0) words.back() = (std::uint64_t{1} << bits % 64) - 1;
      levels_.push_back(std::move(words));
      if (levels_.back().size() <= 1) break;
    }
  }

  void insert(std::size_t number) noexcept {
    for (auto& level : levels_) {
      level[number / 64] |= std::uint64_t{1} << number % 64;
      number /= 64;
    }
  }

  void erase(std::size_t number) noexcept {
    for (auto& level : levels_) {
      level[number / 64] &= ~(std::uint64_t{1} << number % 64);
      number /= 64;
      if (level[number] != 0) return;
    }
  }

  /// The smallest number of the set that is not below `from`, or nothing.
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
  /// The smallest number below a bit of a level that is set.
  [[nodiscard]] std::size_t lowest(std::size_t height, std::size_t bit) const noexcept {
    for (; height > 0; --height) {
      bit = bit * 64 + static_cast<std::size_t>(std::countr_zero(levels_[height - 1][bit]));
    }
    return bit;
  }

  std::vector<std::vector<std::uint64_t>> levels_;  // the numbers themselves first
};

}  // namespace ptc
