// Where labels go beside their points without covering anything.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "tools/bench/chart/canvas.h"

namespace ptc {

/// Finds room in an area in which markers, lines and earlier labels are in the way.
class LabelPlacer {
 public:
  explicit LabelPlacer(const Box& area) : area_(area) {}

  /// Something that labels may not cover.
  void block(const Box& box);
  /// A line that labels avoid where they can.
  void avoid(Spot from, Spot to);

  /// The first of the boxes that is inside the area, over nothing that is blocked, and over as
  /// little of the lines as any. It is blocked from then on.
  [[nodiscard]] std::optional<Box> place(std::span<const Box> candidates);

 private:
  [[nodiscard]] bool is_free(const Box& box) const;
  [[nodiscard]] std::ptrdiff_t dots_under(const Box& box) const;

  Box area_;
  std::vector<Box> blocked_;
  std::vector<Spot> avoided_;  // lines as dots
};

/// Boxes at the eight sides of a spot, above right first, where one looks first.
/// @param distance  from the spot to a box over, under or beside it, units
[[nodiscard]] std::array<Box, 8> boxes_around(Spot spot, double distance, double width,
                                              double height);

}  // namespace ptc
