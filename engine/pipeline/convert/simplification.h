// How a container is stored in fewer bytes than its points take (spec/shading.md#simplification).
#pragma once

#include "engine/octree/flat_cells.h"
#include "engine/octree/rounding.h"

namespace ptc {

/// The text of a simplified container: what was asked, and what became of its points, as JSON.
inline constexpr const char* kSimplifiedKey = "simplified";

/// How points are stored.
struct Simplification {
  Flatness merging;           ///< where one surfel stands for several; growth 1: nowhere
  PointRounding rounding;     ///< of the surfels that are left
  unsigned leaf_points = 16;  ///< maximum number of points in a leaf of the octree
};

/// Returns where surfels are merged. All limits grow with the argument: on most scenes each brings
/// a like part of the error.
/// @param coarseness  0 or more; 0: nowhere
[[nodiscard]] Flatness merging_of(double coarseness) noexcept;

/// Returns a rounding whose errors are small beside a tolerance; never finer than that of the
/// profiles.
/// @param tolerance  relative error, above 0
[[nodiscard]] PointRounding rounding_of(double tolerance) noexcept;

/// Returns the root mean square error that a rounding makes of radiance, relative.
[[nodiscard]] double light_error(const PointRounding& rounding) noexcept;

}  // namespace ptc
