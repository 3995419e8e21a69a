// Inside the whole-file check: what a node stores against what lies below it.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// A rule that is broken: its clause and how.
struct Fault {
  const char* clause = "";
  std::string text;
};

/// Compares a stored summary with the exact one of the same points, within what quantisation may
/// move (spec/nodes.md#quantisation):
///
///   mean      half a step of cell edge / 65536; a whole one at the upper end of the cell
///   radius    at least exact radius + |stored mean - exact mean|, at most 1 + 2^-8 times that
///   slab      at least exact thickness + radius |stored normal - exact normal| + |stored mean -
///   exact
///             mean| or else the sphere's radius, at most 1 + 2^-8 times that
///   area      2^-9 of itself
///   facing    half a step of 1 / 65535 of the area, along each axis
///   radiance  1 / 256 of its greatest component, along each axis that faces at all
///   cone      axis within 0.018 rad; angle at least that of the exact cone about the stored axis,
///             its cosine at most a step of 1 / 32767 below that
///
/// and sums in another order may move: 2^-8 lattice units, 1e-6 of everything else.
/// @param cell_level  of the group that stores it
[[nodiscard]] std::optional<Fault> compare_summary(const NodeSummary& stored,
                                                   const NodeSummary& exact, int cell_level);

/// Checks that the stored sphere and slab hold every disc and the stored cone every normal.
/// @param unit  lattice unit in scene units
[[nodiscard]] std::optional<Fault> check_bounds(const NodeSummary& stored,
                                                std::span<const PointRecord> points, double unit);

}  // namespace ptc
