// The plane through a point on which most of its neighbours lie. This file is guarded once for each
// instruction set.
//
// A point on a strip, such as the edge of a slab, has most of its neighbours on other faces, so no
// fit to all of them finds its face, nor does one to half of them. But planes through the point and
// two neighbours pass through further ones by chance alone, unless all three lie on one face:
//
//          .   .   .   .
//       .    .   .   .                        a b   the face of x: other points lie in this plane
//     +---------------------                  a c   across the edge: none does
//     | .  a    x    b   .
//     +---------------------
//        . c   .    .   .
#if defined(PTC_SCAN_COMMON_PLANE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef PTC_SCAN_COMMON_PLANE_INL_H
#undef PTC_SCAN_COMMON_PLANE_INL_H
#else
#define PTC_SCAN_COMMON_PLANE_INL_H
#endif

#include <cstddef>

#include <hwy/highway.h>

#include "engine/scan/polynomial-inl.h"
#include "engine/scan/principal_plane-inl.h"
#include "engine/scan/surface_fit.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

constexpr float kOnPlane = 0.03F;     // distance at which a neighbour counts a quarter
constexpr float kMoreOnPlane = 1;     // neighbours that a plane must have more than the polynomial
constexpr float kLeastCross = 1e-3F;  // square of the least cross product that gives a plane
constexpr std::size_t kPartners = 4;  // neighbours with which each one is paired

/// Returns how much a neighbour counts at a distance from a surface, 0 to 1.
HWY_INLINE V closeness(V distance) {
  const V ratio =
      hn::Div(set(1), mul_add(mul(distance, distance), set(1 / (kOnPlane * kOnPlane)), set(1)));
  return mul(ratio, ratio);
}

/// Returns how many neighbours lie on a polynomial.
HWY_INLINE V count_on(const FitBatch& batch, std::size_t lane, const FrameRows& rows,
                      const V* unknown) {
  const F f;
  const V count = hn::Load(f, batch.count + lane);
  V sum = hn::Zero(f);
  for (std::size_t row = 0; row < batch.rows; ++row) {
    const auto in = hn::Lt(set(static_cast<float>(row)), count);
    const V height =
        height_at(unknown, hn::Load(f, rows.u[row] + lane), hn::Load(f, rows.v[row] + lane));
    const V off = hn::Sub(hn::Load(f, rows.w[row] + lane), height);
    sum = hn::Add(sum, hn::IfThenElseZero(in, closeness(off)));
  }
  return sum;
}

/// Finds the plane through the point and two neighbours on which most neighbours lie.
/// @param normal  receives its normal, unit
/// @return how many lie on it
HWY_INLINE V find_common_plane(const FitBatch& batch, std::size_t lane, V* normal) {
  const F f;
  const V count = hn::Load(f, batch.count + lane);
  const auto load = [&](std::size_t row, V* p) {
    p[0] = hn::Load(f, batch.x[row] + lane);
    p[1] = hn::Load(f, batch.y[row] + lane);
    p[2] = hn::Load(f, batch.z[row] + lane);
  };
  V most = hn::Zero(f);
  for (int k = 0; k < 3; ++k) normal[k] = set(k == 2 ? 1.0F : 0.0F);
  for (std::size_t i = 0; i < batch.rows; ++i) {
    for (std::size_t partner = 1; partner <= kPartners; ++partner) {
      const std::size_t j = (i + partner) % batch.rows;
      V a[3], b[3];
      load(i, a);
      load(j, b);
      V n[3] = {hn::Sub(mul(a[1], b[2]), mul(a[2], b[1])),
                hn::Sub(mul(a[2], b[0]), mul(a[0], b[2])),
                hn::Sub(mul(a[0], b[1]), mul(a[1], b[0]))};
      const V square = dot(n, n);
      const V scale = hn::Div(set(1), hn::Sqrt(hn::Max(square, set(kLeastCross))));
      for (V& component : n) component = mul(component, scale);
      V sum = hn::Zero(f);
      for (std::size_t row = 0; row < batch.rows; ++row) {
        V p[3];
        load(row, p);
        const auto in = hn::Lt(set(static_cast<float>(row)), count);
        sum = hn::Add(sum, hn::IfThenElseZero(in, closeness(dot(p, n))));
      }
      const auto usable = hn::And(hn::Lt(set(static_cast<float>(i > j ? i : j)), count),
                                  hn::Gt(square, set(kLeastCross)));
      const auto take = hn::And(usable, hn::Gt(sum, most));
      most = hn::IfThenElse(take, sum, most);
      for (int k = 0; k < 3; ++k) normal[k] = hn::IfThenElse(take, n[k], normal[k]);
    }
  }
  return most;
}

/// Turns the frame of a plane to another normal, where that is wanted.
HWY_INLINE void turn(Plane& plane, const V* normal, hn::Mask<F> wanted) {
  // The axes across are those of Duff et al. 2017, Building an orthonormal basis, revisited.
  const V x = normal[0], y = normal[1], z = normal[2];
  const V sign = hn::CopySign(set(1), z);
  const V a = hn::Div(set(-1), hn::Add(sign, z)), b = mul(mul(x, y), a);
  const V axis[3][3] = {
      {x, y, z},
      {b, mul_add(mul(y, y), a, sign), hn::Neg(y)},
      {mul_add(mul(mul(sign, x), x), a, set(1)), mul(sign, b), hn::Neg(mul(sign, x))}};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k)
      plane.axis[i][k] = hn::IfThenElse(wanted, axis[i][k], plane.axis[i][k]);
  }
}

/// Replaces the polynomial by one near the plane on which most neighbours lie, where it has fewer
/// of them on it.
/// @param plane, rows  are turned with it
/// @param square       mean square of the distances from the polynomial; is replaced, too
HWY_INLINE void prefer_common_plane(const FitBatch& batch, std::size_t lane, Plane& plane,
                                    FrameRows& rows, V* unknown, V& square) {
  const F f;
  const auto inexact = hn::Gt(square, set(kExact));
  if (hn::AllFalse(f, inexact)) return;
  V normal[3];
  const V most = find_common_plane(batch, lane, normal);
  const V own = hn::Add(count_on(batch, lane, rows, unknown), set(kMoreOnPlane));
  const auto take = hn::And(inexact, hn::Gt(most, own));
  if (hn::AllFalse(f, take)) return;
  // In the other lanes the frame stays, so that their rows do, too
  turn(plane, normal, take);
  turn_rows(batch, lane, plane, rows);
  V found[kUnknowns];
  for (V& number : found) number = hn::Zero(f);
  const V near = set(kOnPlane * kOnPlane / kTolerance);
  const V found_square = fit_weighted(batch, lane, rows, near, found);
  square = hn::IfThenElse(take, found_square, square);
  for (int i = 0; i < kUnknowns; ++i) unknown[i] = hn::IfThenElse(take, found[i], unknown[i]);
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
