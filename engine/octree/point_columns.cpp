// The loops over points, compiled once for each instruction set.
//
// Sums run point by point in scalar code, because their result depends on the order of addition.
// Bounds are maxima and minima, which do not, so they run in vectors of up to kMaxLanes points;
// lanes behind the last point are masked:
//
//   column   | x0 x1 x2 x3 | x4 x5 x6 x7 | x8 -- -- -- |     9 points, 4 lanes, 3 lanes masked
#include "engine/octree/point_columns.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "engine/octree/summary.h"
#include "format/morton.h"
#include "format/scalar.h"

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/octree/point_columns.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, PointColumns::kMaxLanes>;
using V = hn::VFromD<D>;

/// Converts a whole number v below 2^52, by way of the double whose fraction bits are v: 2^52 + v.
inline double to_double(std::uint64_t v) {
  return std::bit_cast<double>(v | 0x4330000000000000) - 0x1p52;
}

/// The fields of a block of points, in small arrays, so that values that are decoded together lie
/// together.
struct Fields {
  PositionBlock positions;
  std::array<float, kPositionBlock> radius;
  std::array<std::int16_t, kPositionBlock> u, v;
  std::array<std::array<std::uint16_t, kPositionBlock>, 6> light;  // radiance, emission
};

/// Gathers the fields of n records.
void gather(const PointRecord* points, std::size_t first, std::size_t n, bool emits, Fields& out) {
  for (std::size_t i = 0; i < n; ++i) {
    const PointRecord& point = points[first + i];
    out.radius[i] = point.radius;
    out.u[i] = point.normal[0];
    out.v[i] = point.normal[1];
    for (std::size_t c = 0; c < 3; ++c) out.light[c][i] = point.radiance[c];
    for (std::size_t c = 0; c < 3 && emits; ++c) out.light[3 + c][i] = point.emission[c];
  }
  decode_positions({points + first, n}, out.positions);
}

/// Gathers the fields of n points of a page.
void gather(const PointPage& page, std::size_t first, std::size_t n, bool emits, Fields& out) {
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<std::uint32_t>(first + i);
    const LatticePoint position = page.position(at);
    for (std::size_t axis = 0; axis < 3; ++axis) out.positions[axis][i] = position[axis];
    out.radius[i] = page.radius(at);
    const std::array<std::int16_t, 2> normal = page.normal(at);
    out.u[i] = normal[0];
    out.v[i] = normal[1];
    const Half3 radiance = page.radiance(at);
    for (std::size_t c = 0; c < 3; ++c) out.light[c][i] = radiance[c];
    if (!emits) continue;
    const Half3 emission = page.emission(at);
    for (std::size_t c = 0; c < 3; ++c) out.light[3 + c][i] = emission[c];
  }
}

/// Decodes points into columns, in blocks.
/// @param points  records, or a page
/// @param stride  values from one column to the next
/// @param emits   whether there are columns of emission
template <class Points>
void decode_points(const Points& points, std::size_t count, double unit, double* columns,
                   std::size_t stride, bool emits) {
  constexpr std::size_t kBlock = kPositionBlock;
  constexpr double kMax = 1e150;  // spec/nodes.md#node-number: what is stored ends at 3e38 anyway
  Fields fields;
  for (std::size_t first = 0; first < count; first += kBlock) {
    const std::size_t n = std::min(kBlock, count - first);
    gather(points, first, n, emits, fields);
    // Decode positions, radii and areas.
    const auto out = [&](PointColumns::Column k) { return columns + k * stride + first; };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < n; ++i)
        columns[axis * stride + first + i] = to_double(fields.positions[axis][i]);
    }
    double* const lattice_radius = out(PointColumns::kDiscRadius);
    double* const area = out(PointColumns::kDiscArea);
    for (std::size_t i = 0; i < n; ++i) {
      const double r = fields.radius[i];
      const double scaled = r / unit;
      lattice_radius[i] = scaled < kMax ? scaled : kMax;
      area[i] = 2.0 * r * r;
    }
    // Decode normals and light.
    double* const x = out(PointColumns::kNormalX);
    double* const y = out(PointColumns::kNormalY);
    double* const z = out(PointColumns::kNormalZ);
    for (std::size_t i = 0; i < n; ++i) {
      const std::array<double, 3> normal = decode_octahedral_f64(fields.u[i], fields.v[i]);
      x[i] = normal[0];
      y[i] = normal[1];
      z[i] = normal[2];
    }
    for (std::size_t c = 0; c < (emits ? 6 : 3); ++c) {
      double* const to = columns + (PointColumns::kRed + c) * stride + first;
      for (std::size_t i = 0; i < n; ++i) to[i] = decode_half(fields.light[c][i]);
    }
  }
}

/// Implements PointColumns::assign() for records.
void decode_records(const PointRecord* points, std::size_t count, double unit, double* columns,
                    std::size_t stride, bool emits) {
  decode_points(points, count, unit, columns, stride, emits);
}

/// Implements PointColumns::assign() for a page.
void decode_page(const PointPage& page, double unit, double* columns, std::size_t stride) {
  decode_points(page, page.size(), unit, columns, stride, page.emits());
}

/// The values of a few consecutive points, one point in each lane; lanes from `end` on hold
/// anything.
class Lanes {
 public:
  Lanes(const PointColumns& points, std::size_t first, std::size_t end)
      : points_(points), first_(first), mask_(hn::FirstN(D(), end - first)) {}
  [[nodiscard]] HWY_INLINE V operator[](PointColumns::Column k) const {
    return hn::LoadU(D(), points_.column(k) + first_);
  }
  /// Returns `value` in the lanes that hold a point, and `otherwise` in the rest.
  [[nodiscard]] HWY_INLINE V only(V value, V otherwise) const {
    return hn::IfThenElse(mask_, value, otherwise);
  }

 private:
  const PointColumns& points_;
  std::size_t first_;
  hn::Mask<D> mask_;
};

HWY_INLINE V dot(const V (&a)[3], const V (&b)[3]) {
  return hn::Add(hn::Add(hn::Mul(a[0], b[0]), hn::Mul(a[1], b[1])), hn::Mul(a[2], b[2]));
}

/// Implements reach_of() for one instruction set.
Reach reach(const PointColumns& points, std::size_t begin, std::size_t end, const ReachFrom& from) {
  // Broadcast centre and directions.
  const D d;
  const auto splat = [&](const auto& values, V(&to)[3]) {
    for (std::size_t k = 0; k < 3; ++k) to[k] = hn::Set(d, static_cast<double>(values[k]));
  };
  V centre[3], slab[3], axis[3];
  splat(from.centre, centre);
  splat(from.normal, slab);
  splat(from.direction, axis);
  const V axis_squared = dot(axis, axis), zero = hn::Zero(d), one = hn::Set(d, 1.0);
  // Find the greatest reach of a disc from the centre and from the plane, and the smallest cosine
  // of a normal to the axis.
  V radius = zero, thickness = zero, cosine = one, greatest = zero;
  for (std::size_t i = begin; i < end; i += hn::Lanes(d)) {
    const Lanes point(points, i, end);
    const V away[3] = {hn::Sub(point[PointColumns::kX], centre[0]),
                       hn::Sub(point[PointColumns::kY], centre[1]),
                       hn::Sub(point[PointColumns::kZ], centre[2])};
    const V wide = point[PointColumns::kDiscRadius];
    greatest = hn::Max(greatest, point.only(wide, zero));
    radius = hn::Max(radius, point.only(hn::Add(hn::Sqrt(dot(away, away)), wide), zero));
    const V n[3] = {point[PointColumns::kNormalX], point[PointColumns::kNormalY],
                    point[PointColumns::kNormalZ]};
    const V squared = dot(n, n);
    const V to_axis = hn::Div(dot(axis, n), hn::Sqrt(hn::Mul(axis_squared, squared)));
    cosine = hn::Min(cosine, point.only(to_axis, one));
    const V cross[3] = {hn::Sub(hn::Mul(slab[1], n[2]), hn::Mul(slab[2], n[1])),
                        hn::Sub(hn::Mul(slab[2], n[0]), hn::Mul(slab[0], n[2])),
                        hn::Sub(hn::Mul(slab[0], n[1]), hn::Mul(slab[1], n[0]))};
    const V tilted = hn::Div(hn::Mul(wide, hn::Sqrt(dot(cross, cross))), hn::Sqrt(squared));
    thickness = hn::Max(thickness, point.only(hn::Add(hn::Abs(dot(slab, away)), tilted), zero));
  }
  // Reduce the lanes.
  return {.radius = hn::GetLane(hn::MaxOfLanes(d, radius)),
          .thickness = hn::GetLane(hn::MaxOfLanes(d, thickness)),
          .cosine = hn::GetLane(hn::MinOfLanes(d, cosine)),
          .greatest = hn::GetLane(hn::MaxOfLanes(d, greatest))};
}

/// Sets sphere, cone and slab of a node from its points. Mean and sums must be set: they give the
/// centre and the axis.
void bound(const PointColumns& points, std::size_t begin, std::size_t end, NodeSummary& node) {
  const std::array<double, 3> slab = slab_normal(node);
  const bool has_axis = set_cone_axis(node, slab);
  const Reach found = reach(points, begin, end, {node.mean, slab, node.cone_axis});
  node.radius = found.radius;
  node.greatest = found.greatest;
  set_bounds(node, has_axis, found.cosine, found.thickness);
}

/// Sums the emission of points towards the six axes.
void add_emission(const PointColumns& points, std::size_t begin, std::size_t end,
                  NodeSummary& node) {
  for (std::size_t i = begin; i < end; ++i) {
    std::array<double, 3> emission;
    for (std::size_t c = 0; c < 3; ++c)
      emission[c] =
          points.column(static_cast<PointColumns::Column>(PointColumns::kEmittedRed + c))[i];
    if (emission == std::array<double, 3>{}) continue;
    node.emits = true;
    for (std::size_t k = 0; k < 6; ++k) {
      const auto axis = static_cast<PointColumns::Column>(PointColumns::kNormalX + k / 2);
      const double normal = points.column(axis)[i];
      const double towards = std::max(k % 2 == 0 ? normal : -normal, 0.0);
      const double facing = points.column(PointColumns::kDiscArea)[i] * towards;
      for (std::size_t c = 0; c < 3; ++c) node.power[k][c] += facing * emission[c];
    }
  }
}

/// Implements summarise_points() for one instruction set.
NodeSummary summarise(const PointColumns& points, std::size_t begin, std::size_t end) {
  NodeSummary node;
  const auto value = [&](PointColumns::Column k, std::size_t i) { return points.column(k)[i]; };
  // Sum offsets from the first point: sums of coordinates up to 2^42 would lose the lattice unit.
  const std::array<double, 3> origin{value(PointColumns::kX, begin), value(PointColumns::kY, begin),
                                     value(PointColumns::kZ, begin)};
  double weight = 0;
  bool has_area = false;
  for (std::size_t i = begin; i < end; ++i) has_area |= value(PointColumns::kDiscArea, i) > 0;
  // Sum positions, area, and facing area and flux along the six axis directions.
  std::array<std::array<double, 4>, 6> towards{};  // by direction: facing area, flux
  for (std::size_t i = begin; i < end; ++i) {
    const double area = value(PointColumns::kDiscArea, i);
    const double w = has_area ? area : 1.0;  // points without area still have a mean position
    node.mean[0] += w * (value(PointColumns::kX, i) - origin[0]);
    node.mean[1] += w * (value(PointColumns::kY, i) - origin[1]);
    node.mean[2] += w * (value(PointColumns::kZ, i) - origin[2]);
    weight += w;
    node.area += area;
    const std::array<double, 3> normal{value(PointColumns::kNormalX, i),
                                       value(PointColumns::kNormalY, i),
                                       value(PointColumns::kNormalZ, i)};
    const std::array<double, 4> light{1, value(PointColumns::kRed, i),
                                      value(PointColumns::kGreen, i),
                                      value(PointColumns::kBlue, i)};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      // A normal faces one of the two directions of each axis.
      std::array<double, 4>& sums = towards[2 * axis + (normal[axis] > 0 ? 0 : 1)];
      const double facing = area * std::abs(normal[axis]);
      for (std::size_t c = 0; c < 4; ++c) sums[c] += facing * light[c];
    }
  }
  // Fill in the node, and bound its points.
  for (std::size_t k = 0; k < 6; ++k) {
    node.facing[k] = towards[k][0];
    node.flux[k] = {towards[k][1], towards[k][2], towards[k][3]};
  }
  for (std::size_t k = 0; k < 3; ++k) node.mean[k] = origin[k] + node.mean[k] / weight;
  if (points.emits()) add_emission(points, begin, end, node);
  bound(points, begin, end, node);
  return node;
}

}  // namespace
}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(decode_records);
HWY_EXPORT(decode_page);
HWY_EXPORT(summarise);
HWY_EXPORT(reach);

void PointColumns::assign(std::span<const PointRecord> points, double unit) {
  make_room(points.size(), std::ranges::any_of(
                               points, [](const PointRecord& p) { return p.emission != Half3{}; }));
  HWY_DYNAMIC_DISPATCH(decode_records)
  (points.data(), points.size(), unit, values_.data(), stride_, emits_);
}

void PointColumns::assign(const PointPage& page, double unit) {
  make_room(page.size(), page.emits());
  HWY_DYNAMIC_DISPATCH(decode_page)(page, unit, values_.data(), stride_);
}

void PointColumns::make_room(std::size_t points, bool emits) {
  stride_ = points + kMaxLanes;
  emits_ = emits;
  values_.resize((emits ? kColumns : kEmittedRed) * stride_);
}

NodeSummary summarise_points(const PointColumns& points, std::size_t begin, std::size_t end) {
  return HWY_DYNAMIC_DISPATCH(summarise)(points, begin, end);
}

Reach reach_of(const PointColumns& points, std::size_t begin, std::size_t end,
               const ReachFrom& from) {
  return HWY_DYNAMIC_DISPATCH(reach)(points, begin, end, from);
}

}  // namespace ptc
#endif
