// The polynomial fit of surface_fit.cpp. This file is guarded once for each instruction set.
#if defined(PTC_SCAN_POLYNOMIAL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef PTC_SCAN_POLYNOMIAL_INL_H
#undef PTC_SCAN_POLYNOMIAL_INL_H
#else
#define PTC_SCAN_POLYNOMIAL_INL_H
#endif

#include <cstddef>

#include <hwy/highway.h>

#include "engine/scan/principal_plane-inl.h"
#include "engine/scan/surface_fit.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

constexpr float kTolerance = 6;     // (c s)^2 over s^2 of the weights
constexpr float kCurvature = 0.3F;  // usual even terms, for the ridge
constexpr float kBetter = 0.1F;     // mean square of a half, in that of all, which is far better
constexpr float kLeastHalf = 6;     // points of a half
constexpr float kExact = 1e-4F;     // mean square of all below which no half is looked for

/// The unknowns in the order d, e, f, a, b, c.
constexpr int kUnknowns = 6;
enum Unknown { kUU, kUV, kVV, kOne, kU, kV };

/// Sums of a weighted least-squares fit.
struct Moments {
  V m40, m31, m22, m13, m04, m30, m21, m12, m03, m20, m11, m02, m10, m01, m00;
  V right[kUnknowns];  ///< with w
  V ww;

  HWY_INLINE void clear() {
    const V zero = hn::Zero(F());
    m40 = m31 = m22 = m13 = m04 = m30 = m21 = m12 = m03 = m20 = m11 = m02 = m10 = m01 = m00 = zero;
    for (V& sum : right) sum = zero;
    ww = zero;
  }
  HWY_INLINE void add(V weight, V u, V v, V w) {
    const V uu = mul(u, u), uv = mul(u, v), vv = mul(v, v);
    const V ku = mul(weight, u), kv = mul(weight, v), kw = mul(weight, w);
    const V kuu = mul(weight, uu), kuv = mul(weight, uv), kvv = mul(weight, vv);
    m00 = hn::Add(m00, weight);
    m10 = hn::Add(m10, ku);
    m01 = hn::Add(m01, kv);
    m20 = hn::Add(m20, kuu);
    m11 = hn::Add(m11, kuv);
    m02 = hn::Add(m02, kvv);
    m30 = mul_add(kuu, u, m30);
    m21 = mul_add(kuu, v, m21);
    m12 = mul_add(kvv, u, m12);
    m03 = mul_add(kvv, v, m03);
    m40 = mul_add(kuu, uu, m40);
    m31 = mul_add(kuu, uv, m31);
    m22 = mul_add(kuu, vv, m22);
    m13 = mul_add(kvv, uv, m13);
    m04 = mul_add(kvv, vv, m04);
    right[kOne] = hn::Add(right[kOne], kw);
    right[kU] = mul_add(kw, u, right[kU]);
    right[kV] = mul_add(kw, v, right[kV]);
    right[kUU] = mul_add(kw, uu, right[kUU]);
    right[kUV] = mul_add(kw, uv, right[kUV]);
    right[kVV] = mul_add(kw, vv, right[kVV]);
    ww = mul_add(kw, w, ww);
  }
};

/// Solves for the polynomial by a factorisation L D L^T.
/// @param ridge  is added to the diagonal of the even terms
HWY_INLINE void solve(const Moments& s, V ridge, V* unknown) {
  const V even = hn::Add(ridge, mul(s.m00, set(1e-4F))),
          least = mul_add(s.m00, set(1e-6F), set(1e-30F));
  V lower[kUnknowns][kUnknowns] = {{hn::Add(s.m40, even)},
                                   {s.m31, hn::Add(s.m22, even)},
                                   {s.m22, s.m13, hn::Add(s.m04, even)},
                                   {s.m20, s.m11, s.m02, hn::Add(s.m00, least)},
                                   {s.m30, s.m21, s.m12, s.m10, hn::Add(s.m20, least)},
                                   {s.m21, s.m12, s.m03, s.m01, s.m11, hn::Add(s.m02, least)}};
  V diagonal[kUnknowns], inverse[kUnknowns];
  for (int j = 0; j < kUnknowns; ++j) {
    V scaled[kUnknowns];
    diagonal[j] = lower[j][j];
    for (int k = 0; k < j; ++k) {
      scaled[k] = mul(lower[j][k], diagonal[k]);
      diagonal[j] = hn::Sub(diagonal[j], mul(lower[j][k], scaled[k]));
    }
    diagonal[j] = hn::Max(diagonal[j], least);
    inverse[j] = hn::Div(set(1), diagonal[j]);
    for (int i = j + 1; i < kUnknowns; ++i) {
      for (int k = 0; k < j; ++k) lower[i][j] = hn::Sub(lower[i][j], mul(lower[i][k], scaled[k]));
      lower[i][j] = mul(lower[i][j], inverse[j]);
    }
  }
  for (int i = 0; i < kUnknowns; ++i) {
    unknown[i] = s.right[i];
    for (int k = 0; k < i; ++k) unknown[i] = hn::Sub(unknown[i], mul(lower[i][k], unknown[k]));
  }
  for (int i = kUnknowns - 1; i >= 0; --i) {
    unknown[i] = mul(unknown[i], inverse[i]);
    for (int k = i + 1; k < kUnknowns; ++k)
      unknown[i] = hn::Sub(unknown[i], mul(lower[k][i], unknown[k]));
  }
}

/// Returns the mean square of the distances from the fitted surface, corrected for the unknowns.
HWY_INLINE V mean_square(const Moments& s, const V* unknown, V count) {
  V sum = s.ww;
  for (int i = 0; i < kUnknowns; ++i) sum = hn::Sub(sum, mul(unknown[i], s.right[i]));
  const V freedom = hn::Max(hn::Sub(count, set(kUnknowns)), mul(count, set(0.25F)));
  const V share = hn::Div(freedom, hn::Max(count, set(1)));
  return hn::Div(hn::Max(sum, hn::Zero(F())), mul_add(s.m00, share, set(1e-30F)));
}

/// The plane through a half of the neighbours, w = a + b u + c v.
struct HalfPlane {
  V a, b, c;
  V square;            ///< mean square of the distances from it
  hn::Mask<F> usable;  ///< the half has enough points, and they are not on a line
};

/// Fits a plane to one half of the neighbours; the point itself belongs to every half.
/// @param side  rows by whose sign the half is chosen
/// @param sign  1 or -1
HWY_INLINE HalfPlane fit_half(const FitBatch& batch, std::size_t lane, const FrameRows& rows,
                              const float (*side)[kFitLanes], float sign) {
  const F f;
  const V zero = hn::Zero(f), one = set(1), count = hn::Load(f, batch.count + lane);
  // Add up the moments.
  V n = one, su = zero, sv = zero, sw = zero, suu = zero, suv = zero, svv = zero, suw = zero,
    svw = zero, sww = zero;
  for (std::size_t row = 0; row < batch.rows; ++row) {
    const V towards = mul(hn::Load(f, side[row] + lane), set(sign));
    const auto in = hn::And(hn::Lt(set(static_cast<float>(row)), count), hn::Ge(towards, zero));
    const V u = hn::IfThenElseZero(in, hn::Load(f, rows.u[row] + lane));
    const V v = hn::IfThenElseZero(in, hn::Load(f, rows.v[row] + lane));
    const V w = hn::IfThenElseZero(in, hn::Load(f, rows.w[row] + lane));
    n = hn::Add(n, hn::IfThenElseZero(in, one));
    su = hn::Add(su, u);
    sv = hn::Add(sv, v);
    sw = hn::Add(sw, w);
    suu = mul_add(u, u, suu);
    suv = mul_add(u, v, suv);
    svv = mul_add(v, v, svv);
    suw = mul_add(u, w, suw);
    svw = mul_add(v, w, svw);
    sww = mul_add(w, w, sww);
  }
  // Solve for the plane.
  const V each = hn::Div(one, n), mu = mul(su, each), mv = mul(sv, each), mw = mul(sw, each);
  const V uu = hn::Sub(suu, mul(su, mu)), vv = hn::Sub(svv, mul(sv, mv));
  const V uv = hn::Sub(suv, mul(su, mv)), uw = hn::Sub(suw, mul(su, mw));
  const V vw = hn::Sub(svw, mul(sv, mw)), ww = hn::Sub(sww, mul(sw, mw));
  const V determinant = hn::Sub(mul(uu, vv), mul(uv, uv));
  const V inverse = hn::Div(one, hn::Max(determinant, set(1e-12F)));
  HalfPlane plane;
  plane.b = mul(hn::Sub(mul(uw, vv), mul(vw, uv)), inverse);
  plane.c = mul(hn::Sub(mul(vw, uu), mul(uw, uv)), inverse);
  plane.a = hn::Sub(mw, mul_add(plane.b, mu, mul(plane.c, mv)));
  const V off = hn::Max(hn::Sub(hn::Sub(ww, mul(plane.b, uw)), mul(plane.c, vw)), zero);
  plane.square = hn::Div(off, hn::Max(hn::Sub(n, set(3)), one));
  plane.usable =
      hn::And(hn::Ge(n, set(kLeastHalf)), hn::Gt(determinant, mul(mul(uu, vv), set(0.02F))));
  return plane;
}

/// Replaces the polynomial by the plane through one half of the neighbours where that fits far
/// better.
/// @param square  mean square of the distances from the polynomial; is replaced, too
HWY_INLINE void prefer_half(const FitBatch& batch, std::size_t lane, const FrameRows& rows,
                            V* unknown, V& square) {
  const F f;
  const auto inexact = hn::Gt(square, set(kExact));
  if (hn::AllFalse(f, inexact)) return;
  V best = mul(square, set(kBetter));
  for (int half = 0; half < 4; ++half) {
    const HalfPlane plane =
        fit_half(batch, lane, rows, half < 2 ? rows.u : rows.v, half % 2 == 0 ? 1.0F : -1.0F);
    const auto take = hn::And(inexact, hn::And(plane.usable, hn::Lt(plane.square, best)));
    best = hn::IfThenElse(take, plane.square, best);
    square = hn::IfThenElse(take, plane.square, square);
    unknown[kOne] = hn::IfThenElse(take, plane.a, unknown[kOne]);
    unknown[kU] = hn::IfThenElse(take, plane.b, unknown[kU]);
    unknown[kV] = hn::IfThenElse(take, plane.c, unknown[kV]);
    for (const int even : {kUU, kUV, kVV})
      unknown[even] = hn::IfThenElse(take, hn::Zero(f), unknown[even]);
  }
}

/// Returns the height of the polynomial.
HWY_INLINE V height_at(const V* unknown, V u, V v) {
  const V along_u = mul_add(unknown[kUU], u, mul_add(unknown[kUV], v, unknown[kU]));
  const V along_v = mul_add(unknown[kVV], v, unknown[kV]);
  return mul_add(along_u, u, mul_add(along_v, v, unknown[kOne]));
}

/// Puts the offsets into the frame of the plane.
HWY_INLINE void turn_rows(const FitBatch& batch, std::size_t lane, const Plane& plane,
                          FrameRows& rows) {
  const F f;
  for (std::size_t row = 0; row < batch.rows; ++row) {
    const V p[3] = {hn::Load(f, batch.x[row] + lane), hn::Load(f, batch.y[row] + lane),
                    hn::Load(f, batch.z[row] + lane)};
    hn::Store(dot(p, plane.axis[2]), f, rows.u[row] + lane);
    hn::Store(dot(p, plane.axis[1]), f, rows.v[row] + lane);
    hn::Store(dot(p, plane.axis[0]), f, rows.w[row] + lane);
  }
}

/// Fits the polynomial to neighbours, which count less the farther they are from the polynomial
/// before it.
/// @param square   mean square of the distances from the one before
/// @param unknown  of the one before; is replaced
/// @param alike    there was none before, and all count alike
/// @return the mean square of the distances from the surface
HWY_INLINE V fit_weighted(const FitBatch& batch, std::size_t lane, const FrameRows& rows, V square,
                          V* unknown, bool alike = false) {
  const F f;
  const V count = hn::Load(f, batch.count + lane);
  const V limit = hn::Div(set(1), mul_add(square, set(kTolerance), set(1e-14F)));
  Moments sums;
  sums.clear();
  for (std::size_t row = 0; row < batch.rows; ++row) {
    V weight = hn::IfThenElseZero(hn::Lt(set(static_cast<float>(row)), count), set(1));
    const V u = hn::Load(f, rows.u[row] + lane), v = hn::Load(f, rows.v[row] + lane);
    const V w = hn::Load(f, rows.w[row] + lane);
    if (!alike) {
      const V off = hn::Sub(w, height_at(unknown, u, v));
      const V ratio = mul_add(mul(off, off), limit, set(1));
      weight = hn::Div(weight, mul(ratio, ratio));
    }
    sums.add(weight, u, v, w);
  }
  solve(sums, mul(square, set(1 / (kCurvature * kCurvature))), unknown);
  return mean_square(sums, unknown, count);
}

/// Fits the polynomial. @param rows  receives the offsets in the frame of the plane
/// @return the mean square of the distances from the surface
HWY_INLINE V fit_polynomial(const FitBatch& batch, std::size_t lane, const Plane& plane,
                            FrameRows& rows, V* unknown) {
  turn_rows(batch, lane, plane, rows);
  V square = fit_weighted(batch, lane, rows, hn::Zero(F()), unknown, true);
  prefer_half(batch, lane, rows, unknown, square);
  return fit_weighted(batch, lane, rows, square, unknown);
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
