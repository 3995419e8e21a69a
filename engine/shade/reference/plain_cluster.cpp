#include "engine/shade/reference/plain_cluster.h"

#include <cmath>
#include <cstddef>

#include <glm/geometric.hpp>

#include "engine/shade/outgoing.h"
#include "format/node_layout.h"
#include "format/scalar.h"

namespace ptc {
namespace {

float share_at(const GroupView& group, int axis, int child) {
  return static_cast<float>(GroupView::u16_at(group.facing(axis), child)) /
         static_cast<float>(kFacingSteps);
}

}  // namespace

Cluster read_cluster(const GroupView& group, int i, const Frame& frame, const glm::dvec3& from) {
  // Decode the position relative to the group's cell.
  const LatticePoint corner = decode_morton(group.cell());
  const double step = cell_edge(group.level()) / kMeanSteps;
  const std::array<const std::byte*, 3> columns{group.mean_x(), group.mean_y(), group.mean_z()};
  Cluster c;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const double at =
        static_cast<double>(corner[axis]) + step * GroupView::u16_at(columns[axis], i);
    c.to[k] = static_cast<float>(frame.origin[axis] + at * frame.unit() - from[k]);
  }
  // Decode the shape; the mean normal is the difference of opposite shares.
  const auto unit = static_cast<float>(frame.unit());
  c.radius = unit * decode_ufloat16(GroupView::u16_at(group.radius(), i));
  c.thickness = unit * decode_ufloat16(GroupView::u16_at(group.thickness(), i));
  c.area = decode_ufloat16(GroupView::u16_at(group.area(), i));
  for (int k = 0; k < 6; ++k) c.facing[static_cast<std::size_t>(k)] = share_at(group, k, i);
  c.mean = {c.facing[0] - c.facing[1], c.facing[2] - c.facing[3], c.facing[4] - c.facing[5]};
  c.flatness = glm::length(c.mean);
  return c;
}

Front front_of(const GroupView& group, int i, const Cluster& c, const glm::vec3& toward) {
  Front front;
  for (int axis = 0; axis < 3; ++axis) {
    const int face = 2 * axis + (toward[axis] < 0 ? 1 : 0);
    const std::array<float, 3> colour = decode_rgbe(outgoing_rgbe(group, face, i));
    const float weight = std::abs(toward[axis]) * c.facing[static_cast<std::size_t>(face)];
    front.radiance += weight * glm::vec3(colour[0], colour[1], colour[2]);
    front.area += weight;
  }
  return front;
}

}  // namespace ptc
