// How evenly surfels cover a mesh.
#pragma once

#include <vector>

#include "engine/base/surfel.h"
#include "engine/io/mesh/mesh.h"

namespace ptc {

/// Measures of how evenly surfels cover a mesh. Distances are in units of the spacing.
struct Coverage {
  double nearest_least = 0;  ///< smallest distance between neighbours
  double nearest_mean = 0;
  double nearest_deviation = 0;
  double largest_hole = 0;  ///< from a surface point to the nearest surfel
  double uncovered = 0;     ///< share of surface points in no surfel's disc
};

/// Measures the coverage at `probes` points spread over the mesh. Surfels that face away by more
/// than 75 degrees do not count.
[[nodiscard]] Coverage measure_coverage(const Mesh& mesh, const std::vector<Surfel>& surfels,
                                        double spacing, int probes);

/// Returns the sum of 2 r^2, the area that the surfels stand for.
[[nodiscard]] double covered_area(const std::vector<Surfel>& surfels);

}  // namespace ptc
