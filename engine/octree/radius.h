// Radii for clouds that come without.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/sort/external_sort.h"

namespace ptc {

/// What estimate_radii() did so far.
struct RadiusCounts {
  std::uint64_t searches = 0;        ///< for neighbours: one or two for each place of a chunk
  std::uint64_t without_radius = 0;  ///< points whose radius stays 0: no other place is near
};

/// Gives every sorted surfel whose radius is 0 one that lets its disc reach its neighbours:
/// r = d sqrt(pi / 12), d the distance to the 6th nearest point, which circumscribes the square
/// cell of an even sampling; held to 3 times the median of its chunk, so that stray points stay
/// small. A point with 6 others in its place has the median. Where that is 0, for most points of
/// the chunk are of this kind, places count in place of points. Points without any other place
/// among those that are searched keep a radius of 0, and so no area.
///
/// Neighbours are searched among 2^16 points of the Z-curve and 2^13 on either side: chunks are
/// counted from the first point, so the result does not depend on memory or threads.
/// @param sorted  must outlive the result
/// @param unit    lattice unit in scene units
/// @param counts  must outlive the result
/// @param first   number of the point to begin with; then `sorted` begins with that of
/// first_for_radii()
[[nodiscard]] std::unique_ptr<PointStream> estimate_radii(PointStream& sorted, double unit,
                                                          RadiusCounts& counts,
                                                          std::uint64_t first = 0);

/// The first of the points that bear on the radii of those from `first` on.
[[nodiscard]] std::uint64_t first_for_radii(std::uint64_t first) noexcept;

}  // namespace ptc
