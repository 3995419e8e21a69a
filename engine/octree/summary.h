// Computes the summary that a node stores of the surfels below it (spec/nodes.md#summary): mean
// position, area, facing area and flux along six directions, bounding sphere, slab and normal cone.
#pragma once

#include <array>
#include <span>

#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// Returns the summary of surfels, with an exact bounding sphere about their mean position and an
/// exact cone about their mean normal.
/// @param points  at least one
/// @param unit    lattice unit in scene units
[[nodiscard]] NodeSummary summarise_points(std::span<const PointRecord> points, double unit);
/// Returns the summary of several clusters. Its sphere encloses their spheres, its slab their
/// slabs, and its cone their cones.
/// @param nodes  at least one
[[nodiscard]] NodeSummary summarise_nodes(std::span<const NodeSummary* const> nodes);
/// Returns the summary of the clusters that the children of a group stand for, as
/// summarise_nodes() does.
[[nodiscard]] NodeSummary summarise_children(std::span<const NodeChild> children);

/// Returns the unit normal of the slab, which is the area-weighted mean normal; zero where the
/// normals cancel out.
/// @param node  its sums must be set
[[nodiscard]] std::array<double, 3> slab_normal(const NodeSummary& node);
/// Sets the axis of the normal cone to the normal of the slab, or to +z where that is zero.
/// @return  false where it is zero
bool set_cone_axis(NodeSummary& node, const std::array<double, 3>& slab);
/// Sets cone and thickness of a node whose sphere is set.
/// @param has_axis   what set_cone_axis() returned; without an axis the cone holds all directions,
///                   and the slab is as thick as the sphere
/// @param cosine     smallest cosine of a normal to the cone's axis, as computed: -1 - 2^-50 to 1
/// @param thickness  greatest reach from the slab's middle plane, lattice units
void set_bounds(NodeSummary& node, bool has_axis, double cosine, double thickness);

}  // namespace ptc
