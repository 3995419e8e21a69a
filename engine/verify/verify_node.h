// The whole-file check of one node: the summary that it stores against the points below it.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "engine/octree/point_columns.h"
#include "format/node_page.h"

namespace ptc {

/// A broken rule.
struct Fault {
  const char* clause = "";  ///< anchor of the rule
  std::string text;         ///< how it is broken, in words
};

/// Compares a stored summary with the exact summary of the same points. A stored value may differ
/// by as much as quantisation moves it (spec/nodes.md#quantisation):
///
///   mean      half a step of cell edge / 65536; a whole one at the upper end of the cell
///   radius    at least exact radius + |stored mean - exact mean|, at most 1 + 2^-8 times that
///   slab      at least the lesser of
///               exact thickness + exact radius * |stored normal - exact normal|
///                               + |stored mean - exact mean|
///               exact radius    + |stored mean - exact mean|,
///             at most 1 + 2^-8 times that
///   area      2^-9 of itself
///   facing    half a step of 1 / 65535 of the area, along each axis
///   greatest  at least the exact one, at most 1 + 2^-8 times that
///   radiance, emission  1 / 256 of the greatest component, along each axis that faces at all
///   cone      axis within 0.018 rad; angle at least that of the exact cone about the stored axis,
///             at most 10^-3 rad and a step of 1 / 32767 of the cosine wider
///
/// plus what a different order of summation moves: 2^-8 lattice units for positions, a relative
/// 1e-6 for everything else.
/// @param cell_level  level of the group that stores the summary
/// @return  the first difference that is too large; empty when there is none
[[nodiscard]] std::optional<Fault> compare_summary(const NodeSummary& stored,
                                                   const NodeSummary& exact, int cell_level);

/// Checks that the stored sphere and slab contain every disc and the stored cone every normal.
/// @param begin, end  the points of a leaf, which are all from `begin` up to `end`
/// @return  the first disc or normal that lies outside; empty when there is none
[[nodiscard]] std::optional<Fault> check_bounds(const NodeSummary& stored,
                                                const PointColumns& points, std::size_t begin,
                                                std::size_t end);

}  // namespace ptc
