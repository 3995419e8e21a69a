// What a node knows of its surfels (spec/nodes.md#summary).
#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/build/subtree.h"
#include "format/scalar.h"

namespace ptc {
namespace {

using Vec3 = std::array<double, 3>;

double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double distance(const Vec3& a, const Vec3& b) {  // lattice coordinates: no square overflows
  const Vec3 d{a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return std::sqrt(dot(d, d));
}

/// Unit normal of the slab that holds a cluster, the mean of its normals; zero where they cancel out.
Vec3 slab_normal(const NodeSummary& node) {
  const Vec3 sum{node.facing[0] - node.facing[1], node.facing[2] - node.facing[3], node.facing[4] - node.facing[5]};
  const double length = std::sqrt(dot(sum, sum));
  if (!(length > 1e-6 * node.area)) return {};
  return {sum[0] / length, sum[1] / length, sum[2] / length};
}

/// Axis of the normal cone: the slab's normal; +z, with a full cone, where that is zero.
/// @return false where it is zero
bool set_cone_axis(NodeSummary& node, const Vec3& slab) {
  node.cone_axis = {0, 0, 1};
  if (slab == Vec3{}) return false;
  for (std::size_t k = 0; k < 3; ++k) node.cone_axis[k] = static_cast<float>(slab[k]);
  return true;
}

/// Radius of a disc in lattice units. Any float over any unit: beyond this its square would be infinite, and what is
/// stored ends at 3e38 anyway.
double lattice_radius(const PointRecord& point, double unit) {
  constexpr double kGreatest = 1e150;
  return std::min(static_cast<double>(point.radius) / unit, kGreatest);
}

/// Half the extent along a unit direction of a thing `thick` along its normal and `wide` across it;
/// all of `wide` when the normal is zero.
double extent_along(const Vec3& direction, const Vec3& normal, double thick, double wide) {
  const double length = std::sqrt(dot(normal, normal));
  if (!(length > 0)) return wide;
  const Vec3 cross{direction[1] * normal[2] - direction[2] * normal[1],
                   direction[2] * normal[0] - direction[0] * normal[2],
                   direction[0] * normal[1] - direction[1] * normal[0]};
  return (thick * std::abs(dot(direction, normal)) + wide * std::sqrt(dot(cross, cross))) / length;
}

double offset_along(const Vec3& direction, const Vec3& a, const Vec3& b) {
  return std::abs(dot(direction, {a[0] - b[0], a[1] - b[1], a[2] - b[2]}));
}

/// Cosine of the angle between a direction and the cone's axis, neither quite of unit length.
double cosine_to_axis(const NodeSummary& node, const std::array<float, 3>& n) {
  const Vec3 a{node.cone_axis[0], node.cone_axis[1], node.cone_axis[2]}, b{n[0], n[1], n[2]};
  return std::clamp(dot(a, b) / std::sqrt(dot(a, a) * dot(b, b)), -1.0, 1.0);
}

/// The greatest float not above x, so that a cone never loses a normal to rounding.
float round_down(double x) {
  const auto nearest = static_cast<float>(x);
  return static_cast<double>(nearest) <= x ? nearest : std::nextafter(nearest, -2.0F);
}

}  // namespace

PointNumbers numbers_of(const PointRecord& point, double unit) noexcept {
  const LatticePoint q = decode_morton(point.key);
  const double radius = point.radius;
  return {.position = {static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2])},
          .radius = lattice_radius(point, unit),
          .area = 2.0 * radius * radius,
          .radiance = {decode_half(point.radiance[0]), decode_half(point.radiance[1]), decode_half(point.radiance[2])},
          .normal = decode_octahedral(point.normal[0], point.normal[1])};
}

NodeSummary summarise_points(std::span<const PointNumbers> points) {
  NodeSummary node;
  // Sums of offsets keep the lattice unit, sums of coordinates up to 2^42 lose it.
  const Vec3 origin = points.front().position;
  double weight = 0;
  const bool has_area = std::ranges::any_of(points, [](const PointNumbers& p) { return p.area > 0; });
  std::array<std::array<double, 4>, 6> towards{};  // an axis: facing, flux
  for (const PointNumbers& p : points) {
    const double w = has_area ? p.area : 1.0;  // points without extent still have a middle
    for (std::size_t k = 0; k < 3; ++k) node.mean[k] += w * (p.position[k] - origin[k]);
    weight += w;
    node.area += p.area;
    const std::array<double, 4> light{1, p.radiance[0], p.radiance[1], p.radiance[2]};
    for (std::size_t k = 0; k < 6; ++k) {
      const double facing = p.area * std::max(0.0, static_cast<double>(k % 2 == 0 ? p.normal[k / 2] : -p.normal[k / 2]));
      for (std::size_t c = 0; c < 4; ++c) towards[k][c] += facing * light[c];
    }
  }
  for (std::size_t k = 0; k < 6; ++k) {
    node.facing[k] = towards[k][0];
    node.flux[k] = {towards[k][1], towards[k][2], towards[k][3]};
  }
  for (std::size_t k = 0; k < 3; ++k) node.mean[k] = origin[k] + node.mean[k] / weight;
  const Vec3 slab = slab_normal(node);
  const bool has_axis = set_cone_axis(node, slab);
  double cosine = 1;
  for (const PointNumbers& p : points) {
    node.radius = std::max(node.radius, distance(p.position, node.mean) + p.radius);
    if (!has_axis) continue;
    cosine = std::min(cosine, cosine_to_axis(node, p.normal));
    const double reach = extent_along(slab, {p.normal[0], p.normal[1], p.normal[2]}, 0, p.radius);
    node.thickness = std::max(node.thickness, offset_along(slab, p.position, node.mean) + reach);
  }
  node.cone_cos = has_axis ? round_down(cosine) : -1.0F;
  node.thickness = has_axis ? std::min(node.thickness, node.radius) : node.radius;
  return node;
}

NodeSummary summarise_points(std::span<const PointRecord> points, double unit) {
  std::vector<PointNumbers> numbers;
  numbers.reserve(points.size());
  for (const PointRecord& point : points) numbers.push_back(numbers_of(point, unit));
  return summarise_points(numbers);
}

NodeSummary summarise_nodes(std::span<const NodeSummary* const> nodes) {
  NodeSummary sum;
  const Vec3& origin = nodes.front()->mean;
  double weight = 0;
  const bool has_area = std::ranges::any_of(nodes, [](const NodeSummary* n) { return n->area > 0; });
  for (const NodeSummary* node : nodes) {
    const double w = has_area ? node->area : 1.0;
    for (std::size_t k = 0; k < 3; ++k) sum.mean[k] += w * (node->mean[k] - origin[k]);
    weight += w;
    sum.area += node->area;
    for (std::size_t k = 0; k < 6; ++k) {
      sum.facing[k] += node->facing[k];
      for (std::size_t c = 0; c < 3; ++c) sum.flux[k][c] += node->flux[k][c];
    }
  }
  for (std::size_t k = 0; k < 3; ++k) sum.mean[k] = origin[k] + sum.mean[k] / weight;
  const Vec3 slab = slab_normal(sum);
  const bool has_axis = set_cone_axis(sum, slab);
  double angle = has_axis ? 0 : M_PI;
  for (const NodeSummary* node : nodes) {
    sum.radius = std::max(sum.radius, distance(node->mean, sum.mean) + node->radius);
    const double half = std::acos(std::clamp(static_cast<double>(node->cone_cos), -1.0, 1.0));
    angle = std::max(angle, std::acos(cosine_to_axis(sum, node->cone_axis)) + half);
    const double reach = extent_along(slab, slab_normal(*node), node->thickness, node->radius);
    sum.thickness = std::max(sum.thickness, offset_along(slab, node->mean, sum.mean) + std::min(reach, node->radius));
  }
  sum.thickness = has_axis ? std::min(sum.thickness, sum.radius) : sum.radius;
  sum.cone_cos = angle >= M_PI ? -1.0F : round_down(std::cos(angle));
  return sum;
}

NodeSummary summarise_children(std::span<const NodeChild> children) {
  std::array<const NodeSummary*, kMaxChildren> nodes{};
  std::ranges::transform(children, nodes.begin(), [](const NodeChild& child) { return &child.node; });
  return summarise_nodes(std::span(nodes).first(children.size()));
}

}  // namespace ptc
