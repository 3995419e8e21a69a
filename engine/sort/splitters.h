// Ranges of keys that hold about equally many records, taken from a sample.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/io/file/state_file.h"
#include "format/morton.h"

namespace ptc {

/// Cuts the keys into ascending ranges. A key that is so frequent that it would fill a range and
/// more gets one of its own, whose records need no sorting however many they are.
///
///   range 0  |    range 1    |       range 2        | range 3 ...
///     k < s0     s0 <= k < s1    s1 <= k < s2 = s1 + 1: only s1
class Splitters {
 public:
  /// About `ranges` of them, each with as many of the sample's keys. If the sample has different
  /// keys, at least two ranges hold some of it; if all are the same, that key has a range of its
  /// own.
  /// @param sample  not empty; sorted here
  /// @param ranges  3 to 65535
  /// @throws std::invalid_argument
  Splitters(std::vector<MortonKey> sample, std::size_t ranges);

  /// As save() wrote them. @throws DataError
  explicit Splitters(StateReader& state);
  void save(StateWriter& state) const;

  [[nodiscard]] std::size_t size() const noexcept { return keys_.size() + 1; }

  /// The range that a key lies in.
  [[nodiscard]] std::size_t operator()(const MortonKey& key) const noexcept {
    const Whole k = whole(key);
    if (k < keys_.front()) return 0;
    if (k >= keys_.back()) return keys_.size();
    const auto cell = static_cast<std::size_t>((k - keys_.front()) >> shift_);
    const std::size_t first = below_cell_[cell], last = below_cell_[cell + 1];
    // Seldom more than one splitter: then without a branch, which keys in no order would mislead.
    if (last - first < 2)
      return first +
             (static_cast<std::size_t>(first < last) & static_cast<std::size_t>(keys_[first] <= k));
    const Whole* const keys = keys_.data();
    return static_cast<std::size_t>(std::upper_bound(keys + first, keys + last, k) - keys);
  }

  /// True when a range can hold one key only.
  [[nodiscard]] bool single_key(std::size_t range) const noexcept;

 private:
  __extension__ typedef unsigned __int128 Whole;
  static constexpr Whole kMax = ~Whole{0};

  [[nodiscard]] static Whole whole(const MortonKey& key) noexcept {
    return Whole{key.high} << 64 | key.low;
  }
  void index();

  std::vector<Whole> keys_;  // strictly ascending, at least one: where ranges 1, 2, ... begin
  // From the first key to the last one lie equal cells of 2^shift_ keys, several for each range, so
  // that most hold no splitter: how many splitters lie below a cell.
  int shift_ = 0;
  std::vector<std::uint16_t> below_cell_;
};

}  // namespace ptc
