// Holds each stored quantity of a node to the bounds that quantisation allows, one function for
// each quantity (engine/verify/verify_node.h lists the bounds).
//
// Mean, area, shares and radiance are rounded to the nearest step and may differ either way.
// Sphere, slab and cone must enclose the points, so that they are rounded outwards, by at most one
// step.
//
//   area      ----[--exact--]----        radius    ----needed[-------]----
//                  accepted                                  accepted
#include "engine/verify/verify_node.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "engine/base/numbers.h"

namespace ptc {
namespace {

using Vec3 = std::array<double, 3>;

constexpr char kMean[] = "spec/nodes.md#node-mean";
constexpr char kSphere[] = "spec/nodes.md#node-sphere";
constexpr char kSlab[] = "spec/nodes.md#node-slab";
constexpr char kSums[] = "spec/nodes.md#node-sums";
constexpr char kCone[] = "spec/nodes.md#node-cone";
constexpr char kGreatestRule[] = "spec/nodes.md#node-greatest";

constexpr double kRelative = 1e-6;        // what another order of summation changes in a sum
constexpr double kLatticeSlack = 0x1p-8;  // what it changes in positions up to 2^42, lattice units
constexpr double kAngleSlack = 1e-6;      // normals and axes have unit length to float precision

// The ranges of the stored numbers: 16-bit unsigned floats and shared-exponent colours.
constexpr double kMaxUfloat16 = 0x1.ffp127;
constexpr double kMinUfloat16 = 0x1p-134;
constexpr double kMinRgbe = 0x1p-136;

const char* axis_name(std::size_t k) {
  constexpr std::array kNames{"+x", "-x", "+y", "-y", "+z", "-z"};
  return kNames[k];
}

Vec3 widen(const std::array<float, 3>& v) {
  return {static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])};
}

double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

double length(const Vec3& a) {
  return std::sqrt(dot(a, a));
}

double distance(const Vec3& a, const Vec3& b) {  // lattice coordinates: no square overflows
  return length({a[0] - b[0], a[1] - b[1], a[2] - b[2]});
}

Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

std::optional<Fault> compare_mean(const NodeSummary& stored, const NodeSummary& exact, int level) {
  const double edge = std::ldexp(1.0, kLatticeBits - std::min(level, kLatticeBits));
  const double step = edge / 65536;
  for (std::size_t k = 0; k < 3; ++k) {
    const double off = exact.mean[k] - stored.mean[k];
    if (std::abs(off) <= 0.5 * step + kLatticeSlack) continue;
    const bool at_end = off > 0 && std::fmod(stored.mean[k], edge) == edge - step;
    if (std::abs(off) > (at_end ? 1.0 : 0.5) * step + kLatticeSlack) {
      return Fault{kMean, fmt::format("the mean position {} along {} is not that of the points, {}",
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
  return Fault{kSphere, fmt::format("the sphere about the mean position has a radius of {} lattice "
                                    "units, but the points need {}",
                                    stored.radius, needed)};
}

/// Returns the sum of area times normal.
Vec3 sum_of_normals(const NodeSummary& node) {
  return {node.facing[0] - node.facing[1], node.facing[2] - node.facing[3],
          node.facing[4] - node.facing[5]};
}

/// Returns the unit normal of the slab, which is the direction of the summed facing areas; zero
/// where they cancel out.
Vec3 normal_of_slab(const NodeSummary& node) {
  Vec3 sum = sum_of_normals(node);
  const double norm = length(sum);
  if (!(norm > 0)) return {};
  for (double& s : sum) s /= norm;
  return sum;
}

std::optional<Fault> compare_slab(const NodeSummary& stored, const NodeSummary& exact) {
  const double moved = distance(stored.mean, exact.mean);
  const double turned = distance(normal_of_slab(stored), normal_of_slab(exact));
  const double widest = exact.radius + moved;
  const double needed = std::min(exact.thickness + exact.radius * turned + moved, widest);
  const double slack = kLatticeSlack + kRelative * widest;
  const double least = std::min(needed, kMaxUfloat16) - slack;
  const double most = (needed + slack) * (1 + 0x1p-8) * (1 + kRelative) + kMinUfloat16;
  if (stored.thickness >= least && stored.thickness <= most) return {};
  return Fault{kSlab, fmt::format("the slab about the mean position has a thickness of {} lattice "
                                  "units, but the points need {}",
                                  stored.thickness, needed)};
}

std::optional<Fault> compare_area(const NodeSummary& stored, const NodeSummary& exact) {
  const double area = std::min(exact.area, kMaxUfloat16);
  if (std::abs(stored.area - area) <= area * (0x1p-9 + kRelative) + kMinUfloat16) return {};
  return Fault{kSums, fmt::format("the area {} is not the sum over the points, {}", stored.area,
                                  exact.area)};
}

/// Compares the mean light towards an axis.
/// @param name            of the light, for messages
/// @param stored, exact   sums of facing area times light
/// @param before, facing  the stored and the exact facing area
std::optional<Fault> compare_colour(const char* name, const Vec3& stored, double before,
                                    const Vec3& exact, double facing, std::size_t k) {
  Vec3 light{};
  for (std::size_t c = 0; c < 3; ++c) light[c] = exact[c] / facing;
  const double greatest = std::ranges::max(light);
  for (std::size_t c = 0; c < 3; ++c) {
    const double found = stored[c] / before;
    if (std::abs(found - light[c]) > greatest * (1.0 / 256 + kRelative) + kMinRgbe) {
      return Fault{kSums, fmt::format("the {} {} ({}) along {} is not the mean over the points, {}",
                                      name, found, "rgb"[c], axis_name(k), light[c])};
    }
  }
  return {};
}

std::optional<Fault> compare_greatest(const NodeSummary& stored, const NodeSummary& exact) {
  const double least = std::min(exact.greatest, kMaxUfloat16) * (1 - kRelative);
  const double most = exact.greatest * (1 + 0x1p-8) * (1 + kRelative) + kMinUfloat16;
  if (stored.greatest >= least && stored.greatest <= most) return {};
  return Fault{kGreatestRule,
               fmt::format("the greatest radius is {} lattice units, but that of the points is {}",
                           stored.greatest, exact.greatest)};
}

std::optional<Fault> compare_light(const NodeSummary& stored, const NodeSummary& exact) {
  if (!(stored.area > 0) || !(exact.area > 0)) return {};
  for (std::size_t k = 0; k < 6; ++k) {
    if (stored.facing[k] == 0 && exact.facing[k] == 0) continue;
    const double found = stored.facing[k] / stored.area;
    const double share = std::min(exact.facing[k] / exact.area, 1.0);
    if (std::abs(found - share) > 0.5 / 65535 + kRelative) {
      return Fault{kSums,
                   fmt::format("the share {} of the area that faces {} is not that of the points, "
                               "{}",
                               found, axis_name(k), share)};
    }
    if (!(stored.facing[k] > 0) || !(exact.facing[k] > 0)) continue;
    if (auto fault = compare_colour("radiance", stored.flux[k], stored.facing[k], exact.flux[k],
                                    exact.facing[k], k))
      return fault;
    if (!stored.emits) continue;
    if (auto fault = compare_colour("emission", stored.power[k], stored.facing[k], exact.power[k],
                                    exact.facing[k], k))
      return fault;
  }
  return {};
}

std::optional<Fault> compare_cone(const NodeSummary& stored, const NodeSummary& exact) {
  constexpr double kAxisAngle = 0.018;
  constexpr double kAxisTangent = 0.018;  // less than tan(kAxisAngle)
  constexpr double kCosStep = 1.0 / 32767;
  constexpr double kCosSlack = 1e-5;
  constexpr double kHalfAngleSlack = 1e-3;
  // Where the normals nearly cancel out, an axis is a matter of rounding.
  const double sum = length(sum_of_normals(exact));
  const bool unclear = sum > 0.1 * kRelative * exact.area && sum < 10 * kRelative * exact.area;
  const auto found = static_cast<double>(stored.cone_cos);
  if (unclear && found <= -1) return {};
  // Accept what is near the needed cosine without finding angles: with the half angle h
  // and the turn t it is cos(h + t) = cos h cos t - sin h sin t, and h + t < pi where cos h > -cos
  // t.
  const Vec3 axis = widen(stored.cone_axis), mean = widen(exact.cone_axis);
  const double across = length(cross(axis, mean)), along = dot(axis, mean);
  const double cos_half = std::clamp(static_cast<double>(exact.cone_cos), -1.0, 1.0);
  const double norm = std::sqrt(across * across + along * along);
  if (across < kAxisTangent * along && cos_half * norm > -along) {
    const double sin_half = std::sqrt(1 - cos_half * cos_half);
    const double cosine = (cos_half * along - sin_half * across) / norm;
    if (found <= cosine + kCosSlack && found >= cosine - kCosStep) return {};
  }
  // Compare angles.
  const double turned = std::atan2(across, along);
  if (turned > kAxisAngle && !unclear) {
    return Fault{
        kCone,
        fmt::format("the cone's axis is {} rad away from the mean normal of the points", turned)};
  }
  const double half = std::acos(cos_half);
  const double needed = half + turned >= kPiDouble ? -1.0 : std::cos(half + turned);
  const double widest = std::cos(std::min(half + turned + kHalfAngleSlack, kPiDouble));
  const double narrowest = std::cos(std::clamp(half + turned - kHalfAngleSlack, 0.0, kPiDouble));
  if (found <= narrowest + kCosSlack && found >= widest - kCosStep) return {};
  return Fault{kCone, fmt::format("the cosine {} of the cone's angle is not the one that the "
                                  "points need, {}",
                                  found, needed)};
}

}  // namespace

std::optional<Fault> compare_summary(const NodeSummary& stored, const NodeSummary& exact,
                                     int cell_level) {
  if (auto fault = compare_mean(stored, exact, cell_level)) return fault;
  if (auto fault = compare_sphere(stored, exact)) return fault;
  if (auto fault = compare_greatest(stored, exact)) return fault;
  if (auto fault = compare_area(stored, exact)) return fault;
  if (auto fault = compare_light(stored, exact)) return fault;
  if (auto fault = compare_slab(stored, exact)) return fault;
  return compare_cone(stored, exact);
}

std::optional<Fault> check_bounds(const NodeSummary& stored, const PointColumns& points,
                                  std::size_t begin, std::size_t end) {
  const Vec3 axis = widen(stored.cone_axis);
  const double axis_length = length(axis);
  const double radius = stored.radius * (1 + kRelative) + kLatticeSlack;
  const double thickness = stored.thickness + kRelative * stored.radius + kLatticeSlack;
  const ReachFrom from{stored.mean, normal_of_slab(stored), stored.cone_axis};
  // Returns the bound that some of the discs reach beyond.
  enum class Bound { none, sphere, slab, cone };
  const auto broken_by = [&](const Reach& reach) {
    if (reach.radius > radius && stored.radius < kMaxUfloat16) return Bound::sphere;
    if (reach.thickness > thickness && stored.thickness < kMaxUfloat16) return Bound::slab;
    const double least = static_cast<double>(stored.cone_cos) - kAngleSlack;
    return reach.cosine * axis_length < least ? Bound::cone : Bound::none;
  };
  if (broken_by(reach_of(points, begin, end, from)) == Bound::none) return {};
  // Name the first disc that does.
  for (std::size_t i = begin; i < end; ++i) {
    const Reach reach = reach_of(points, i, i + 1, from);
    switch (broken_by(reach)) {
      case Bound::none:
        continue;
      case Bound::sphere:
        return Fault{kSphere,
                     fmt::format("disc {} of the leaf reaches {} lattice units from the mean "
                                 "position, beyond the sphere's radius of {}",
                                 i - begin, reach.radius, stored.radius)};
      case Bound::slab:
        return Fault{kSlab,
                     fmt::format("disc {} of the leaf reaches {} lattice units from the middle "
                                 "plane, beyond the slab's thickness of {}",
                                 i - begin, reach.thickness, stored.thickness)};
      case Bound::cone:
        return Fault{kCone, fmt::format("the normal of disc {} of the leaf lies outside the cone",
                                        i - begin)};
    }
  }
  return {};
}

}  // namespace ptc
