// The predictor of coordinate differences.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace ptc::laz {

/// Five recent values in ascending order. A new one takes the place of the highest until one is not
/// below the median, then that of the lowest until one is not above it.
class RecentValues {
 public:
  /// Returns the median, 0 at first.
  [[nodiscard]] std::int32_t median() const noexcept { return sorted_[2]; }

  /// Adds a value.
  void add(std::int32_t value) noexcept {
    const std::int32_t middle = sorted_[2];
    const std::size_t from = replaces_highest_ ? 0 : 1;
    const std::array<std::int32_t, 4> kept = {sorted_[from], sorted_[from + 1], sorted_[from + 2],
                                              sorted_[from + 3]};
    sorted_[0] = std::min(kept[0], value);
    for (std::size_t i = 1; i < 4; ++i)
      sorted_[i] = std::max(kept[i - 1], std::min(kept[i], value));
    sorted_[4] = std::max(kept[3], value);
    replaces_highest_ = replaces_highest_ ? value < middle : value <= middle;
  }

 private:
  std::array<std::int32_t, 5> sorted_{};
  bool replaces_highest_ = true;
};

}  // namespace ptc::laz
