// Chooses where the points of a scene are cut into parts (spec/parts.md#writing).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "format/morton.h"

namespace ptc {

/// Chooses cuts that no leaf of the whole tree can go across.
///
/// A cut is the low corner of a child of a cell that holds, by the sample, points on both sides of
/// the cut and more than `leaf_points` of them; so it does by all points, of which the sample is a
/// part. The cuts are those nearest to the places that divide the sample evenly.
/// @param sample  keys of points, ascending; coincident ones count as one
/// @param parts   how many parts are wanted
/// @return  ascending keys at which parts begin, but for the first; fewer than parts - 1 when the
///          sample has no more cells with enough points
[[nodiscard]] std::vector<MortonKey> choose_cuts(std::span<const MortonKey> sample,
                                                 std::size_t parts, std::uint32_t leaf_points);

/// Divides parts into ranges, so that a part is sorted range by range.
/// @param sample    keys of points, ascending
/// @param cuts      where parts begin, but for the first; ascending
/// @param per_part  ranges of a part, 1 or more
/// @return  ascending keys at which ranges begin, but for the first; all cuts are among them. Where
///          the sample has few keys, a part has fewer ranges
[[nodiscard]] std::vector<MortonKey> choose_borders(std::span<const MortonKey> sample,
                                                    std::span<const MortonKey> cuts,
                                                    std::size_t per_part);

}  // namespace ptc
