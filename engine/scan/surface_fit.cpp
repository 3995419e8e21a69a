// A plane through the neighbours, by principal components, gives a frame: u and v in the plane, w
// across it. In this frame the surface is a polynomial
//
//     w = a + b u + c v + d u^2 + e u v + f v^2
//
// whose gradient at the point is (b, c), so that the normal is (-b, -c, 1). The even terms take up
// the curvature and cost no precision: over a neighbourhood that lies evenly around the point, odd
// and even terms are independent. The fit is repeated with weights
//
//     1 / (1 + (r / (c s))^2)^2     of the distance r from the surface, s is the RMS of r
//
// (Geman and McClure 1987), so that neighbours on another surface lose their say. What curvature
// cannot be told from noise is held back by a ridge on the even terms, in proportion to s^2.
//
// Next to an edge the first fit is a compromise between two faces, from which the weights may not
// find back. But one half of the neighbourhood, that away from the edge, lies on the point's own
// face. Where the plane through a half fits far better than the surface through all, the weights
// begin from that plane:
//
//          half away   |   half towards the edge
//      .     .     .   x    .   .                      x  the point
//                      |         \ .
//                      |          \  .  on another face
//
// Where a plane through the point has more neighbours on it than the polynomial, as on a strip
// between two edges, the fit begins again from that plane (common_plane-inl.h). Only few neighbours
// are searched for such a plane: many are taken where noise hides it.
//
// Lanes are neighbourhoods; a loop goes over their neighbours. Nothing passes between lanes, so the
// width of vectors does not change a bit.
#include "engine/scan/surface_fit.h"

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/scan/surface_fit.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/scan/common_plane-inl.h"
#include "engine/scan/polynomial-inl.h"
#include "engine/scan/principal_plane-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

constexpr float kNear = 0.5F;          // squared distance up to which directions count
constexpr float kSpread = 6.2831853F;  // 2 pi: see spread below

/// Distances to the nearest neighbours in eight directions.
HWY_INLINE void measure_directions(const FitBatch& batch, std::size_t lane, const Plane& plane,
                                   const FrameRows& rows, FitLanes& out) {
  const F f;
  const V zero = hn::Zero(f), far = set(4);
  const V count = hn::Load(f, batch.count + lane);
  // Sectors in the order of their angles: bit 2 is v < 0, bit 1 the quarter, bit 0 the half of it.
  V sector[8] = {far, far, far, far, far, far, far, far};
  V uu = zero, uv = zero, vv = zero;
  for (std::size_t row = 0; row < batch.rows; ++row) {
    const auto in = hn::Lt(set(static_cast<float>(row)), count);
    const V u = hn::Load(f, rows.u[row] + lane), v = hn::Load(f, rows.v[row] + lane);
    const V squared = mul_add(u, u, mul(v, v));
    const auto right = hn::Ge(u, zero), upper = hn::Ge(v, zero);
    const auto flat = hn::Ge(hn::Abs(u), hn::Abs(v));
    const auto put = [&](int i, auto where) {
      sector[i] = hn::IfThenElse(where, hn::Min(sector[i], squared), sector[i]);
    };
    const auto up = hn::And(in, upper), down = hn::AndNot(upper, in);
    put(0, hn::And(up, hn::And(right, flat)));
    put(1, hn::And(up, hn::AndNot(flat, right)));
    put(2, hn::AndNot(hn::Or(right, flat), up));
    put(3, hn::And(up, hn::AndNot(right, flat)));
    put(4, hn::And(down, hn::AndNot(right, flat)));
    put(5, hn::AndNot(hn::Or(right, flat), down));
    put(6, hn::And(down, hn::AndNot(flat, right)));
    put(7, hn::And(down, hn::And(right, flat)));
    // Add up directions of near neighbours.
    const V weight = hn::IfThenElseZero(
        in, hn::Div(hn::Max(hn::Sub(set(kNear), squared), zero), hn::Add(squared, set(1e-12F))));
    uu = mul_add(weight, mul(u, u), uu);
    uv = mul_add(weight, mul(u, v), uv);
    vv = mul_add(weight, mul(v, v), vv);
  }
  // Keep the three greatest distances of the sectors that are not empty.
  V top[3] = {zero, zero, zero};
  for (const V& nearest : sector) {
    V value = hn::IfThenElse(hn::Ge(nearest, far), zero, nearest);
    for (V& kept : top) {
      const V less = hn::Min(kept, value);
      kept = hn::Max(kept, value);
      value = less;
    }
  }
  hn::Store(hn::Sqrt(top[2]), f, out.gap + lane);
  // Turn the mean of directions back from the plane into space.
  const V sum = hn::Add(set(1e-12F), hn::Add(uu, vv));
  const V* a = plane.axis[2];
  const V* b = plane.axis[1];
  for (int k = 0; k < 6; ++k) {
    const int i = k < 3 ? k : (k + 1) % 3, j = k < 3 ? k : (k + 2) % 3;
    const V cross = hn::Add(mul(a[i], b[j]), mul(b[i], a[j]));
    const V entry = mul_add(uu, mul(a[i], a[j]), mul_add(vv, mul(b[i], b[j]), mul(uv, cross)));
    hn::Store(hn::Div(entry, sum), f, out.directions[k] + lane);
  }
}

/// Stores a normal: the gradient of the polynomial, or the plane's where that is steep.
HWY_INLINE void store_normal(const Plane& plane, const V* unknown, std::size_t lane,
                             float (&out)[3][kFitLanes]) {
  const F f;
  const V steepness = mul_add(unknown[kU], unknown[kU], mul(unknown[kV], unknown[kV]));
  const auto usable = hn::Le(steepness, set(4));
  const V b = hn::IfThenElseZero(usable, unknown[kU]);
  const V c = hn::IfThenElseZero(usable, unknown[kV]);
  V normal[3];
  for (int k = 0; k < 3; ++k) {
    normal[k] =
        hn::Sub(hn::Sub(plane.axis[0][k], mul(b, plane.axis[2][k])), mul(c, plane.axis[1][k]));
  }
  const V scale = hn::Div(set(1), hn::Sqrt(hn::Max(dot(normal, normal), set(1e-20F))));
  for (int k = 0; k < 3; ++k) hn::Store(mul(normal[k], scale), f, out[k] + lane);
}

}  // namespace

void fit_lanes(const FitBatch& batch, FitLanes& out) {
  const F f;
  FrameRows rows;
  for (std::size_t lane = 0; lane < kFitLanes; lane += hn::Lanes(f)) {
    Plane plane = find_plane(batch, lane);
    V unknown[kUnknowns];
    V square = fit_polynomial(batch, lane, plane, rows, unknown);
    store_normal(plane, unknown, lane, out.broad);
    hn::Store(hn::Sqrt(square), f, out.scatter + lane);
    if (batch.rows <= kFewNeighbours)
      prefer_common_plane(batch, lane, plane, rows, unknown, square);
    store_normal(plane, unknown, lane, out.normal);
    measure_directions(batch, lane, plane, rows, out);
    // Describe the neighbourhood. Over a disc of radius p, the mean squares along both axes are
    // p^2 / 4; with n neighbours, the spacing is p sqrt(pi / n).
    const V tiny = set(1e-20F), count = hn::Max(hn::Load(f, batch.count + lane), set(1));
    const V across = hn::Add(plane.extent[1], plane.extent[2]);
    const V mean_u = dot(plane.mean, plane.axis[2]), mean_v = dot(plane.mean, plane.axis[1]);
    hn::Store(hn::Sqrt(square), f, out.noise + lane);
    hn::Store(unknown[kOne], f, out.offset + lane);
    hn::Store(hn::Sqrt(plane.nearest), f, out.nearest + lane);
    hn::Store(hn::Sqrt(hn::Div(mul(across, set(kSpread)), count)), f, out.spread + lane);
    hn::Store(hn::Div(hn::Sub(plane.extent[1], plane.extent[0]), hn::Add(plane.extent[1], tiny)), f,
              out.flatness + lane);
    hn::Store(hn::Sqrt(hn::Div(plane.extent[1], hn::Add(plane.extent[2], tiny))), f,
              out.width + lane);
    hn::Store(hn::Sqrt(mul_add(mean_u, mean_u, mul(mean_v, mean_v))), f, out.aside + lane);
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(fit_lanes);

void fit_surfaces(const FitBatch& batch, FitLanes& out) noexcept {
  HWY_DYNAMIC_DISPATCH(fit_lanes)(batch, out);
}

}  // namespace ptc
#endif
