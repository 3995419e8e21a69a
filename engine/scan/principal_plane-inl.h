// The plane through a neighbourhood, and vectors of floats for the fit. This file is guarded once
// for each instruction set.
#if defined(PTC_SCAN_PRINCIPAL_PLANE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef PTC_SCAN_PRINCIPAL_PLANE_INL_H
#undef PTC_SCAN_PRINCIPAL_PLANE_INL_H
#else
#define PTC_SCAN_PRINCIPAL_PLANE_INL_H
#endif

#include <cstddef>

#include <hwy/highway.h>

#include "engine/scan/surface_fit.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using F = hn::CappedTag<float, kFitLanes>;
using V = hn::VFromD<F>;

constexpr int kSweeps = 3;  // of Jacobi rotations; the polynomial mends what is left

HWY_INLINE V set(float x) {
  return hn::Set(F(), x);
}
HWY_INLINE V mul(V a, V b) {
  return hn::Mul(a, b);
}
/// Returns a b + c, rounded twice on every instruction set.
HWY_INLINE V mul_add(V a, V b, V c) {
  return hn::Add(hn::Mul(a, b), c);
}
HWY_INLINE V dot(const V* a, const V* b) {
  return hn::Add(hn::Add(mul(a[0], b[0]), mul(a[1], b[1])), mul(a[2], b[2]));
}

/// Offsets of the neighbours in the frame of the plane.
struct FrameRows {
  alignas(64) float u[kMostNeighbours][kFitLanes];
  alignas(64) float v[kMostNeighbours][kFitLanes];
  alignas(64) float w[kMostNeighbours][kFitLanes];
};

/// Mean and principal axes of the neighbours.
struct Plane {
  V mean[3];
  V axis[3][3];  ///< by ascending extent: the normal first; [axis][coordinate]
  V extent[3];   ///< mean square along each axis
  V nearest;     ///< squared
};

/// One rotation of Jacobi's method: makes the entry (p, q) of a symmetric matrix vanish.
/// @param m     xx, yy, zz on the diagonal; yz, zx, xy off it, each opposite to its axis
/// @param axes  columns turn along: axes[column][coordinate]
template <int p, int q>
HWY_INLINE void rotate(V* diagonal, V* off, V (*axes)[3]) {
  constexpr int r = 3 - p - q;
  const V zero = hn::Zero(F());
  const V entry = off[r];
  // tan of the angle that makes the entry vanish, by the smaller root
  const V cotangent = hn::Div(hn::Sub(diagonal[q], diagonal[p]), hn::Add(entry, entry));
  const V root = hn::Sqrt(mul_add(cotangent, cotangent, set(1)));
  const V tangent =
      hn::IfThenElse(hn::Eq(entry, zero), zero,
                     hn::Div(hn::CopySign(set(1), cotangent), hn::Add(hn::Abs(cotangent), root)));
  const V cosine = hn::Div(set(1), hn::Sqrt(mul_add(tangent, tangent, set(1))));
  const V sine = mul(tangent, cosine);
  diagonal[p] = hn::Sub(diagonal[p], mul(tangent, entry));
  diagonal[q] = hn::Add(diagonal[q], mul(tangent, entry));
  off[r] = zero;
  const V at_p = off[q], at_q = off[p];  // the entries (p, r) and (q, r)
  off[q] = hn::Sub(mul(cosine, at_p), mul(sine, at_q));
  off[p] = hn::Add(mul(sine, at_p), mul(cosine, at_q));
  for (int k = 0; k < 3; ++k) {
    const V along_p = axes[p][k], along_q = axes[q][k];
    axes[p][k] = hn::Sub(mul(cosine, along_p), mul(sine, along_q));
    axes[q][k] = hn::Add(mul(sine, along_p), mul(cosine, along_q));
  }
}

/// Exchanges two axes where the first has the greater extent.
HWY_INLINE void order(Plane& plane, int i, int j) {
  const auto wrong = hn::Gt(plane.extent[i], plane.extent[j]);
  const V low = hn::Min(plane.extent[i], plane.extent[j]);
  plane.extent[j] = hn::Max(plane.extent[i], plane.extent[j]);
  plane.extent[i] = low;
  for (int k = 0; k < 3; ++k) {
    const V a = plane.axis[i][k], b = plane.axis[j][k];
    plane.axis[i][k] = hn::IfThenElse(wrong, b, a);
    plane.axis[j][k] = hn::IfThenElse(wrong, a, b);
  }
}

HWY_INLINE Plane find_plane(const FitBatch& batch, std::size_t lane) {
  const F f;
  const V zero = hn::Zero(f), one = set(1);
  // Add up first and second moments.
  const V count = hn::Load(f, batch.count + lane);
  V sum[3] = {zero, zero, zero}, diagonal[3] = {zero, zero, zero}, off[3] = {zero, zero, zero};
  Plane plane;
  plane.nearest = one;
  for (std::size_t row = 0; row < batch.rows; ++row) {
    const auto in = hn::Lt(set(static_cast<float>(row)), count);
    const V p[3] = {hn::IfThenElseZero(in, hn::Load(f, batch.x[row] + lane)),
                    hn::IfThenElseZero(in, hn::Load(f, batch.y[row] + lane)),
                    hn::IfThenElseZero(in, hn::Load(f, batch.z[row] + lane))};
    for (int k = 0; k < 3; ++k) {
      sum[k] = hn::Add(sum[k], p[k]);
      diagonal[k] = mul_add(p[k], p[k], diagonal[k]);
      off[k] = mul_add(p[(k + 1) % 3], p[(k + 2) % 3], off[k]);
    }
    plane.nearest = hn::IfThenElse(in, hn::Min(plane.nearest, dot(p, p)), plane.nearest);
  }
  const V each = hn::Div(one, hn::Max(count, one));
  for (int k = 0; k < 3; ++k) plane.mean[k] = mul(sum[k], each);
  for (int k = 0; k < 3; ++k) {
    diagonal[k] = hn::Sub(mul(diagonal[k], each), mul(plane.mean[k], plane.mean[k]));
    off[k] = hn::Sub(mul(off[k], each), mul(plane.mean[(k + 1) % 3], plane.mean[(k + 2) % 3]));
  }
  // Turn to the principal axes.
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) plane.axis[i][k] = i == k ? one : zero;
  }
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    rotate<0, 1>(diagonal, off, plane.axis);
    rotate<0, 2>(diagonal, off, plane.axis);
    rotate<1, 2>(diagonal, off, plane.axis);
  }
  for (int k = 0; k < 3; ++k) plane.extent[k] = hn::Max(diagonal[k], zero);
  order(plane, 0, 1);
  order(plane, 1, 2);
  order(plane, 0, 1);
  return plane;
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
