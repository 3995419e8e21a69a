// The bounds of quantisation, one function a quantity.
#include "engine/verify/verify_node.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "engine/base/numbers.h"
#include "format/scalar.h"

namespace ptc {
namespace {

using Vec3 = std::array<double, 3>;

constexpr char kMean[] = "spec/nodes.md#node-mean";
constexpr char kSphere[] = "spec/nodes.md#node-sphere";
constexpr char kSlab[] = "spec/nodes.md#node-slab";
constexpr char kSums[] = "spec/nodes.md#node-sums";
constexpr char kCone[] = "spec/nodes.md#node-cone";

constexpr double kRelative = 1e-6;        // sums in another order
constexpr double kLatticeSlack = 0x1p-8;  // the same for positions up to 2^42 in double
constexpr double kAngleSlack = 1e-6;      // normals and axes are unit to float precision

constexpr double kMaxUfloat16 = 0x1.ffp127;
constexpr double kMinUfloat16 = 0x1p-134;
constexpr double kMinRgbe = 0x1p-136;

const char* axis_name(std::size_t k) {
  constexpr std::array kNames{"+x", "-x", "+y", "-y", "+z", "-z"};
  return kNames[k];
}

double distance(const Vec3& a, const Vec3& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

Vec3 widen(const std::array<float, 3>& v) {
  return {static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])};
}

double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Angle between two vectors; exact to double where they are nearly parallel.
double angle_between(const Vec3& a, const Vec3& b) {
  const Vec3 cross{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  return std::atan2(std::sqrt(dot(cross, cross)), dot(a, b));
}

std::optional<Fault> compare_mean(const NodeSummary& stored, const NodeSummary& exact, int level) {
  const double edge = std::ldexp(1.0, kLatticeBits - std::min(level, kLatticeBits));
  const double step = edge / 65536;
  for (std::size_t k = 0; k < 3; ++k) {
    const double off = exact.mean[k] - stored.mean[k];
    const bool at_end = off > 0 && std::fmod(stored.mean[k], edge) == edge - step;
    if (std::abs(off) > (at_end ? 1.0 : 0.5) * step + kLatticeSlack) {
      return Fault{kMean,
                   fmt::format("mean position {} along {} is that of no such points, theirs is {}",
                               stored.mean[k], "xyz"[k], exact.mean[k])};
    }
  }
  return {};
}

std::optional<Fault> compare_sphere(const NodeSummary& stored, const NodeSummary& exact) {
  const double needed = exact.radius + distance(stored.mean, exact.mean);
  const double least = std::min(needed, kMaxUfloat16) * (1 - kRelative) - kLatticeSlack;
  const double most = (needed + kLatticeSlack) * (1 + 0x1p-8) * (1 + kRelative) + kMinUfloat16;
  if (stored.radius >= least && stored.radius <= most) return {};
  return Fault{kSphere, fmt::format("sphere of radius {} lattice units about the mean position, "
                                    "its points take {}",
                                    stored.radius, needed)};
}

/// Unit normal of the slab that a summary's shares give, zero where there is none.
Vec3 slab_normal(const NodeSummary& node) {
  Vec3 sum{node.facing[0] - node.facing[1], node.facing[2] - node.facing[3],
           node.facing[4] - node.facing[5]};
  const double length = std::sqrt(dot(sum, sum));
  if (!(length > 0)) return {};
  for (double& s : sum) s /= length;
  return sum;
}

std::optional<Fault> compare_slab(const NodeSummary& stored, const NodeSummary& exact) {
  const double moved = distance(stored.mean, exact.mean);
  const double turned = distance(slab_normal(stored), slab_normal(exact));
  const double widest = exact.radius + moved;
  const double needed = std::min(exact.thickness + exact.radius * turned + moved, widest);
  const double slack = kLatticeSlack + kRelative * widest;
  const double least = std::min(needed, kMaxUfloat16) - slack;
  const double most = (needed + slack) * (1 + 0x1p-8) * (1 + kRelative) + kMinUfloat16;
  if (stored.thickness >= least && stored.thickness <= most) return {};
  return Fault{kSlab, fmt::format("slab of thickness {} lattice units about the mean position, "
                                  "its points take {}",
                                  stored.thickness, needed)};
}

std::optional<Fault> compare_area(const NodeSummary& stored, const NodeSummary& exact) {
  const double area = std::min(exact.area, kMaxUfloat16);
  if (std::abs(stored.area - area) <= area * (0x1p-9 + kRelative) + kMinUfloat16) return {};
  return Fault{kSums,
               fmt::format("area {} is not the sum {} of its points", stored.area, exact.area)};
}

std::optional<Fault> compare_radiance(const NodeSummary& stored, const NodeSummary& exact,
                                      std::size_t k) {
  Vec3 radiance{};
  for (std::size_t c = 0; c < 3; ++c) radiance[c] = exact.flux[k][c] / exact.facing[k];
  const double greatest = std::ranges::max(radiance);
  for (std::size_t c = 0; c < 3; ++c) {
    const double found = stored.flux[k][c] / stored.facing[k];
    if (std::abs(found - radiance[c]) > greatest * (1.0 / 256 + kRelative) + kMinRgbe) {
      return Fault{kSums, fmt::format("radiance {} ({}) along {} is not the mean {} of its points",
                                      found, "rgb"[c], axis_name(k), radiance[c])};
    }
  }
  return {};
}

std::optional<Fault> compare_light(const NodeSummary& stored, const NodeSummary& exact) {
  if (!(stored.area > 0) || !(exact.area > 0)) return {};
  for (std::size_t k = 0; k < 6; ++k) {
    const double found = stored.facing[k] / stored.area;
    const double share = std::min(exact.facing[k] / exact.area, 1.0);
    if (std::abs(found - share) > 0.5 / 65535 + kRelative) {
      return Fault{kSums,
                   fmt::format("share {} of the area that faces {} is not the {} of its points",
                               found, axis_name(k), share)};
    }
    if (!(stored.facing[k] > 0) || !(exact.facing[k] > 0)) continue;
    if (auto fault = compare_radiance(stored, exact, k)) return fault;
  }
  return {};
}

std::optional<Fault> compare_cone(const NodeSummary& stored, const NodeSummary& exact) {
  constexpr double kAxisAngle = 0.018;
  constexpr double kCosSlack = 1e-5;
  const double turned = angle_between(widen(stored.cone_axis), widen(exact.cone_axis));
  if (turned > kAxisAngle) {
    return Fault{kCone,
                 fmt::format("cone's axis is {} rad off the mean normal of its points", turned)};
  }
  const double half = std::acos(std::clamp(static_cast<double>(exact.cone_cos), -1.0, 1.0));
  const double needed = half + turned >= kPiDouble ? -1.0 : std::cos(half + turned);
  const auto found = static_cast<double>(stored.cone_cos);
  if (found <= needed + kCosSlack && found >= needed - 1.0 / 32767 - kCosSlack) return {};
  return Fault{kCone, fmt::format("cone's cosine {} is not that of its points, {}", found, needed)};
}

}  // namespace

std::optional<Fault> compare_summary(const NodeSummary& stored, const NodeSummary& exact,
                                     int cell_level) {
  if (auto fault = compare_mean(stored, exact, cell_level)) return fault;
  if (auto fault = compare_sphere(stored, exact)) return fault;
  if (auto fault = compare_area(stored, exact)) return fault;
  if (auto fault = compare_light(stored, exact)) return fault;
  if (auto fault = compare_slab(stored, exact)) return fault;
  return compare_cone(stored, exact);
}

std::optional<Fault> check_bounds(const NodeSummary& stored, std::span<const PointRecord> points,
                                  double unit) {
  const Vec3 axis = widen(stored.cone_axis);
  const double radius = stored.radius * (1 + kRelative) + kLatticeSlack;
  const Vec3 slab = slab_normal(stored);
  const double thickness = stored.thickness + kRelative * stored.radius + kLatticeSlack;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const LatticePoint at = decode_morton(points[i].key);
    const Vec3 position{static_cast<double>(at[0]), static_cast<double>(at[1]),
                        static_cast<double>(at[2])};
    const double reach =
        distance(position, stored.mean) + static_cast<double>(points[i].radius) / unit;
    if (reach > radius && stored.radius < kMaxUfloat16) {
      return Fault{kSphere,
                   fmt::format("disc {} of the leaf reaches {} lattice units from the mean "
                               "position, beyond the sphere's {}",
                               i, reach, stored.radius)};
    }
    const Vec3 normal = widen(decode_octahedral(points[i].normal[0], points[i].normal[1]));
    const double tilt = std::sin(angle_between(slab, normal));
    const double height = std::abs(dot(slab, position) - dot(slab, stored.mean)) +
                          static_cast<double>(points[i].radius) / unit * tilt;
    if (height > thickness && stored.thickness < kMaxUfloat16) {
      return Fault{kSlab,
                   fmt::format("disc {} of the leaf reaches {} lattice units from the middle "
                               "plane, beyond the slab's {}",
                               i, height, stored.thickness)};
    }
    if (dot(normal, axis) < static_cast<double>(stored.cone_cos) - kAngleSlack) {
      return Fault{kCone, fmt::format("normal {} of the leaf is outside the cone", i)};
    }
  }
  return {};
}

}  // namespace ptc
