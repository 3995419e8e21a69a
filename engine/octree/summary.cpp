// Combines the summaries of clusters (spec/nodes.md#summary). Sums add up. Bounds do not: a bound
// of the whole must enclose each part's bound, moved by the distance between their centres and
// turned by the angle between their axes.
#include "engine/octree/summary.h"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.h"
#include "engine/octree/point_columns.h"

namespace ptc {
namespace {

using Vec3 = std::array<double, 3>;

double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

double distance(const Vec3& a, const Vec3& b) {  // lattice coordinates: no square overflows
  const Vec3 d{a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return std::sqrt(dot(d, d));
}

/// Returns half the extent, along a unit direction, of a body that reaches `thick` along its normal
/// and `wide` across it; `wide` when the normal is zero.
double extent_along(const Vec3& direction, const Vec3& normal, double thick, double wide) {
  const double length = std::sqrt(dot(normal, normal));
  if (!(length > 0)) return wide;
  const Vec3 cross{direction[1] * normal[2] - direction[2] * normal[1],
                   direction[2] * normal[0] - direction[0] * normal[2],
                   direction[0] * normal[1] - direction[1] * normal[0]};
  return (thick * std::abs(dot(direction, normal)) + wide * std::sqrt(dot(cross, cross))) / length;
}

/// Returns the distance between two points along a unit direction.
double offset_along(const Vec3& direction, const Vec3& a, const Vec3& b) {
  return std::abs(dot(direction, {a[0] - b[0], a[1] - b[1], a[2] - b[2]}));
}

/// Returns the cosine of the angle between a direction and the cone's axis, whose lengths are 1
/// only to float precision.
double cosine_to_axis(const NodeSummary& node, const std::array<float, 3>& n) {
  const Vec3 a{node.cone_axis[0], node.cone_axis[1], node.cone_axis[2]}, b{n[0], n[1], n[2]};
  return std::clamp(dot(a, b) / std::sqrt(dot(a, a) * dot(b, b)), -1.0, 1.0);
}

/// Returns the greatest float that is not above x, so that a cone never loses a normal to rounding.
float round_down(double x) {
  const auto nearest = static_cast<float>(x);
  return static_cast<double>(nearest) <= x ? nearest : std::nextafter(nearest, -2.0F);
}

}  // namespace

Vec3 slab_normal(const NodeSummary& node) {
  const Vec3 sum{node.facing[0] - node.facing[1], node.facing[2] - node.facing[3],
                 node.facing[4] - node.facing[5]};
  const double length = std::sqrt(dot(sum, sum));
  if (!(length > 1e-6 * node.area)) return {};
  return {sum[0] / length, sum[1] / length, sum[2] / length};
}

bool set_cone_axis(NodeSummary& node, const Vec3& slab) {
  node.cone_axis = {0, 0, 1};
  if (slab == Vec3{}) return false;
  for (std::size_t k = 0; k < 3; ++k) node.cone_axis[k] = static_cast<float>(slab[k]);
  return true;
}

void set_bounds(NodeSummary& node, bool has_axis, double cosine, double thickness) {
  node.cone_cos = has_axis ? round_down(std::max(cosine, -1.0)) : -1.0F;
  node.thickness = has_axis ? std::min(thickness, node.radius) : node.radius;
}

NodeSummary summarise_points(std::span<const PointRecord> points, double unit) {
  PointColumns columns;
  columns.assign(points, unit);
  return summarise_points(columns, 0, points.size());
}

NodeSummary summarise_nodes(std::span<const NodeSummary* const> nodes) {
  // Add up areas and flux, and offsets from the first mean position.
  NodeSummary sum;
  const Vec3& origin = nodes.front()->mean;
  double weight = 0;
  const bool has_area =
      std::ranges::any_of(nodes, [](const NodeSummary* n) { return n->area > 0; });
  for (const NodeSummary* node : nodes) {
    const double w = has_area ? node->area : 1.0;
    for (std::size_t k = 0; k < 3; ++k) sum.mean[k] += w * (node->mean[k] - origin[k]);
    weight += w;
    sum.area += node->area;
    for (std::size_t k = 0; k < 6; ++k) {
      sum.facing[k] += node->facing[k];
      for (std::size_t c = 0; c < 3; ++c) {
        sum.flux[k][c] += node->flux[k][c];
        sum.power[k][c] += node->power[k][c];
      }
    }
    sum.emits |= node->emits;
    sum.greatest = std::max(sum.greatest, node->greatest);
  }
  for (std::size_t k = 0; k < 3; ++k) sum.mean[k] = origin[k] + sum.mean[k] / weight;
  // Enclose the spheres, cones and slabs of the parts.
  const Vec3 slab = slab_normal(sum);
  const bool has_axis = set_cone_axis(sum, slab);
  double angle = has_axis ? 0 : kPiDouble;
  for (const NodeSummary* node : nodes) {
    sum.radius = std::max(sum.radius, distance(node->mean, sum.mean) + node->radius);
    const double half = std::acos(std::clamp(static_cast<double>(node->cone_cos), -1.0, 1.0));
    angle = std::max(angle, std::acos(cosine_to_axis(sum, node->cone_axis)) + half);
    const double reach = extent_along(slab, slab_normal(*node), node->thickness, node->radius);
    sum.thickness = std::max(
        sum.thickness, offset_along(slab, node->mean, sum.mean) + std::min(reach, node->radius));
  }
  set_bounds(sum, has_axis, angle >= kPiDouble ? -1.0 : std::cos(angle), sum.thickness);
  return sum;
}

NodeSummary summarise_children(std::span<const NodeChild> children) {
  std::array<const NodeSummary*, kMaxChildren> nodes{};
  std::ranges::transform(children, nodes.begin(),
                         [](const NodeChild& child) { return &child.node; });
  return summarise_nodes(std::span(nodes).first(children.size()));
}

}  // namespace ptc
