// Finds places for labels next to their points where they cover nothing.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "tools/bench/chart/canvas.h"

namespace ptc {

/// Finds room for labels in an area where markers, lines and earlier labels are in the way.
class LabelPlacer {
 public:
  explicit LabelPlacer(const Box& area) : area_(area) {}

  /// Reserves a box that labels may not cover.
  void block(const Box& box);
  /// Adds a line that labels cover as little as possible.
  void avoid(Spot from, Spot to);

  /// Chooses, among the candidates inside the area that cover nothing blocked, the one that covers
  /// the least of the avoided lines, the first of several. It is blocked from then on.
  /// @return nothing where there is no such candidate
  [[nodiscard]] std::optional<Box> place(std::span<const Box> candidates);

 private:
  [[nodiscard]] bool is_free(const Box& box) const;
  [[nodiscard]] std::ptrdiff_t dots_under(const Box& box) const;

  Box area_;
  std::vector<Box> blocked_;
  std::vector<Spot> avoided_;  ///< dots along the lines
};

/// Boxes at the eight sides of a spot in order of preference:
///
///   2  5  1
///   8  o  7
///   4  6  3
///
/// @param distance  from the spot to a box above, below, left or right of it, units
[[nodiscard]] std::array<Box, 8> boxes_around(Spot spot, double distance, double width,
                                              double height);

}  // namespace ptc
