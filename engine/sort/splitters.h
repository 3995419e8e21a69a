// Splitters: they divide the keys into ranges that hold about equally many records, by a sample.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/io/file/state_file.h"
#include "format/morton.h"

namespace ptc {

/// Divides the keys into ascending ranges. A key so frequent that it would fill more than a range
/// has a range of its own, whose records need no sorting however many they are.
///
///   range 0  |    range 1    |       range 2        | range 3 ...
///     k < s0     s0 <= k < s1    s1 <= k < s2 = s1 + 1: only s1
class Splitters {
 public:
  /// Chooses about `ranges` ranges that hold equally many keys of the sample. If the sample has
  /// different keys, at least two ranges hold some of them; if all its keys are equal, that key has
  /// a range of its own.
  /// @param sample  not empty, in any order
  /// @param ranges  3 to 65535
  /// @throws std::invalid_argument when sample or ranges break these conditions
  Splitters(std::vector<MortonKey> sample, std::size_t ranges);

  /// Loads splitters that save() wrote. @throws DataError when they do not ascend
  explicit Splitters(StateReader& state);
  void save(StateWriter& state) const;

  /// Returns the number of ranges.
  [[nodiscard]] std::size_t size() const noexcept { return keys_.size() + 1; }

  /// Returns the number of the range that a key lies in.
  [[nodiscard]] std::size_t operator()(const MortonKey& key) const noexcept {
    const Whole k = whole(key);
    if (k < keys_.front()) return 0;
    if (k >= keys_.back()) return keys_.size();
    const auto cell = static_cast<std::size_t>((k - keys_.front()) >> shift_);
    const std::size_t first = below_cell_[cell], last = below_cell_[cell + 1];
    // Most cells hold at most one splitter. Compare with it without a branch, which keys in random
    // order would mispredict.
    if (last - first < 2)
      return first +
             (static_cast<std::size_t>(first < last) & static_cast<std::size_t>(keys_[first] <= k));
    const Whole* const keys = keys_.data();
    return static_cast<std::size_t>(std::upper_bound(keys + first, keys + last, k) - keys);
  }

  /// Returns whether a range contains a single key.
  [[nodiscard]] bool single_key(std::size_t range) const noexcept;

 private:
  __extension__ typedef unsigned __int128 Whole;
  static constexpr Whole kMax = ~Whole{0};

  [[nodiscard]] static Whole whole(const MortonKey& key) noexcept {
    return Whole{key.high} << 64 | key.low;
  }
  void index();

  std::vector<Whole> keys_;  ///< where ranges 1, 2, ... begin: strictly ascending, at least one
  // An index over the splitters. The keys from the first splitter to the last are divided into
  // equal cells, several for each range, so that most cells hold no splitter:
  //
  //   cells    |   s0  |       |  s1  s2 |       |   s3  |
  //   below      0        1        1         3       3        4
  int shift_ = 0;                          ///< a cell has 2^shift_ keys
  std::vector<std::uint16_t> below_cell_;  ///< by cell: the number of splitters below it
};

}  // namespace ptc
