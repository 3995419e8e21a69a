// Estimates radii for point clouds that have none, from the distance to neighbouring points.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/base/stream.h"
#include "format/point_record.h"

namespace ptc {

/// Counts of what estimate_radii() did so far.
struct RadiusCounts {
  std::uint64_t searches = 0;  ///< neighbour searches, one or two for each position of a chunk
  std::uint64_t without_radius = 0;  ///< points whose radius stays 0: no other position is near
};

/// Gives every sorted surfel whose radius is 0 a radius that lets its disc reach its neighbours:
/// r = d sqrt(pi / 12), where d is the distance to the 6th nearest point; such a disc circumscribes
/// the square cell of an even sampling.
///
///   - The radius is at most 3 times the median of the chunk, so that stray points stay small.
///   - A point that shares its position with 6 others has the median.
///   - Where the median is 0, because most points of the chunk share their positions, each position
///     counts as one point.
///   - Points without any other position in the window keep a radius of 0, and so no area.
///
/// Neighbours are searched in a window of the Z-curve: a chunk of 2^16 points, counted from the
/// first point, and 2^13 points on either side. So the result does not depend on memory or threads.
/// @param sorted  must outlive the result
/// @param unit    lattice unit in scene units
/// @param counts  must outlive the result
/// @param first   number of the point to begin with; `sorted` must then begin with point
///                first_for_radii(first)
[[nodiscard]] std::unique_ptr<PointStream> estimate_radii(PointStream& sorted, double unit,
                                                          RadiusCounts& counts,
                                                          std::uint64_t first = 0);

/// Returns the number of the first point that influences the radii of the points from `first` on.
[[nodiscard]] std::uint64_t first_for_radii(std::uint64_t first) noexcept;

}  // namespace ptc
