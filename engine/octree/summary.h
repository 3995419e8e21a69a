// What a node knows of what is below it (spec/nodes.md#summary).
#pragma once

#include <array>
#include <span>

#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// Summary of a run of surfels: exact bounding sphere and cone. @param unit  lattice unit in scene
/// units
[[nodiscard]] NodeSummary summarise_points(std::span<const PointRecord> points, double unit);
/// Summary of several clusters; the sphere holds their spheres, the cone their cones.
[[nodiscard]] NodeSummary summarise_nodes(std::span<const NodeSummary* const> nodes);
[[nodiscard]] NodeSummary summarise_children(std::span<const NodeChild> children);

/// Unit normal of the slab that holds a cluster whose sums are known, the mean of its normals; zero
/// where they cancel out.
[[nodiscard]] std::array<double, 3> slab_normal(const NodeSummary& node);
/// Sets the axis of the normal cone: the slab's normal; +z where that is zero.
/// @return false where it is zero
bool set_cone_axis(NodeSummary& node, const std::array<double, 3>& slab);
/// Sets cone and thickness of a node whose sphere is known.
/// @param cosine  least of all normals to the cone's axis, as it was found, from -1 - 2^-50 to 1
void set_bounds(NodeSummary& node, bool has_axis, double cosine, double thickness);

}  // namespace ptc
