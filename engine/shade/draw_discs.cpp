// Discs drawn into the pixels of a direction buffer (direction_kernels.h).
#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/shade/direction_kernels.h"

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/draw_discs.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

constexpr int kLanes = DiscQueue::kLanes;
using F = hn::CappedTag<float, kLanes>;
using I = hn::RebindToSigned<F>;
using U = hn::RebindToUnsigned<F>;

/// Height of the shallow paraboloid that stands for a disc, over its radius (spec/shading.md#surfels).
constexpr float kBump = 0.01F;
constexpr float kSlack = 1e-3F;  // pixels: rounding of a disc's bounds

/// Discs on one face of the cube, set up for their pixels. A pixel at (du, dv) from the projected
/// centre sees the disc's plane at t = cw / w, w = 1 + alpha du + beta dv, and the disc itself where
///   aa du^2 + 2 ab du dv + bb dv^2 < (radius / cw)^2 w^2.
struct FaceDiscs {
  alignas(64) float u0[kLanes], v0[kLanes];
  float aa[kLanes], ab2[kLanes], bb[kLanes];
  float alpha[kLanes], beta[kLanes];
  float square[kLanes];    // (radius / cw)^2
  float inverse[kLanes];   // 1 / cw
  float bump[kLanes];      // nearness lost per unit of the quadratic form
  std::int32_t x0[kLanes], x1[kLanes], y0[kLanes], y1[kLanes];
  std::int32_t first[kLanes];  // pixel of the face
};

/// Covers pixels x .. x + lanes of a row.
HWY_INLINE void cover(float* HWY_RESTRICT nearness, std::uint32_t* HWY_RESTRICT rgbe, hn::VFromD<F> near,
                      hn::Mask<F> inside, hn::VFromD<U> colour, hn::VFromD<U> viewpoint) {
  const F f;
  const U u;
  near = hn::BitCast(f, hn::Or(hn::AndNot(hn::Set(u, kViewpoints - 1U), hn::BitCast(u, near)), viewpoint));
  const auto old_near = hn::LoadU(f, nearness);
  const auto old_colour = hn::LoadU(u, rgbe);
  const auto tie = hn::And(hn::Eq(near, old_near), hn::RebindMask(f, hn::Lt(colour, old_colour)));
  const auto take = hn::And(inside, hn::Or(hn::Gt(near, old_near), tie));
  hn::StoreU(hn::IfThenElse(take, near, old_near), f, nearness);
  hn::StoreU(hn::IfThenElse(hn::RebindMask(u, take), colour, old_colour), u, rgbe);
}

HWY_INLINE void draw_on_face(const CubeGeometry& cube, const CubePixels& pixels, const FaceDiscs& discs, std::size_t i,
                             std::uint32_t rgbe, hn::VFromD<U> viewpoint) {
  const F f;
  const auto aa = hn::Set(f, discs.aa[i]);
  const auto alpha = hn::Set(f, discs.alpha[i]);
  const auto square = hn::Set(f, discs.square[i]);
  const auto inverse = hn::Set(f, discs.inverse[i]);
  const auto bump = hn::Set(f, discs.bump[i]);
  const auto u0 = hn::Set(f, discs.u0[i]);
  const auto colour = hn::Set(U(), rgbe);
  const int lanes = static_cast<int>(hn::Lanes(f));
  const int last = cube.resolution - lanes;
  for (int y = discs.y0[i]; y < discs.y1[i]; ++y) {
    const float dv = cube.centre[y] - discs.v0[i];
    const auto b = hn::Set(f, discs.ab2[i] * dv);
    const auto c = hn::Set(f, discs.bb[i] * dv * dv);
    const auto w0 = hn::Set(f, 1 + discs.beta[i] * dv);
    const int row = discs.first[i] + y * cube.resolution;
    for (int begin = discs.x0[i]; begin < discs.x1[i]; begin += lanes) {
      const int x = std::min(begin, last);  // drawing a pixel again changes nothing
      const auto du = hn::Sub(hn::LoadU(f, cube.centre + x), u0);
      const auto form = hn::MulAdd(hn::MulAdd(aa, du, b), du, c);
      const auto w = hn::MulAdd(alpha, du, w0);
      const auto near = hn::NegMulAdd(form, bump, hn::Mul(w, inverse));  // below 0 behind the receiver
      const auto inside = hn::Lt(form, hn::Mul(square, hn::Mul(w, w)));
      cover(pixels.nearness + row + x, pixels.rgbe + row + x, near, inside, colour, viewpoint);
    }
  }
}

/// A disc within two radii of the receiver may fill the view: every face, every pixel, one division
/// each.
void draw_wide_disc(const CubeGeometry& cube, const CubePixels& pixels, const float (&c)[3], const float (&n)[3],
                    float radius, std::uint32_t rgbe, hn::VFromD<U> viewpoint) {
  const F f;
  const float height = c[0] * n[0] + c[1] * n[1] + c[2] * n[2];
  const auto colour = hn::Set(U(), rgbe);
  const auto square = hn::Set(f, radius * radius);
  const auto bump = hn::Set(f, kBump / radius);
  const auto lanes = static_cast<int>(hn::Lanes(f));
  for (int face = 0; face < 6; ++face) {
    const int a = face / 2, ua = (a + 1) % 3, va = (a + 2) % 3;
    const float sign = face % 2 == 0 ? 1.0F : -1.0F;
    const float reach = c[a] * sign + radius * std::sqrt(std::max(0.0F, 1 - n[a] * n[a]));
    if (reach <= 0) continue;
    const int first = face * cube.resolution * cube.resolution;
    for (int y = 0; y < cube.resolution; ++y) {
      const float v = cube.centre[y];
      const auto row_slope = hn::Set(f, n[a] * sign + n[va] * v);
      const int row = y * cube.resolution;
      for (int x = 0; x < cube.resolution; x += lanes) {
        const auto u = hn::LoadU(f, cube.centre + x);
        const auto slope = hn::MulAdd(hn::Set(f, n[ua]), u, row_slope);
        const auto t = hn::Div(hn::Set(f, height), slope);  // infinite, negative or NaN: a miss
        const auto du = hn::MulSub(u, t, hn::Set(f, c[ua]));
        const auto dv = hn::MulSub(hn::Set(f, v), t, hn::Set(f, c[va]));
        const auto dw = hn::Sub(t, hn::Set(f, c[a] * sign));
        const auto off = hn::MulAdd(du, du, hn::MulAdd(dv, dv, hn::Mul(dw, dw)));
        const auto inside = hn::And(hn::Gt(t, hn::Zero(f)), hn::Lt(off, square));
        const auto length = hn::LoadU(f, cube.length + row + x);
        const auto near = hn::Div(hn::Set(f, 1.0F), hn::Add(t, hn::Div(hn::Mul(bump, off), length)));
        cover(pixels.nearness + first + row + x, pixels.rgbe + first + row + x, near, inside, colour, viewpoint);
      }
    }
  }
}

/// The span of pixels whose centres lie within [middle - half, middle + half] on a face's axis.
HWY_INLINE void store_span(hn::VFromD<F> middle, hn::VFromD<F> half, float resolution, std::int32_t* first,
                           std::int32_t* last) {
  const F f;
  const I i;
  const auto scale = hn::Set(f, resolution * 0.5F);
  const auto low = hn::MulAdd(hn::Sub(middle, half), scale, hn::Set(f, resolution * 0.5F - 0.5F - kSlack));
  const auto high = hn::MulAdd(hn::Add(middle, half), scale, hn::Set(f, resolution * 0.5F + 0.5F + kSlack));
  const auto clamp = [&](auto v) { return hn::Min(hn::Max(v, hn::Zero(f)), hn::Set(f, resolution)); };
  hn::StoreU(hn::ConvertTo(i, hn::Ceil(clamp(low))), i, first);
  hn::StoreU(hn::ConvertTo(i, hn::Floor(clamp(high))), i, last);
}

}  // namespace

void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const DiscQueue& discs, Sides sides,
                unsigned viewpoint) {
  const F f;
  const U u;
  const auto from = hn::Set(u, viewpoint);
  const auto lanes = static_cast<int>(hn::Lanes(f));
  const auto resolution = static_cast<float>(cube.resolution);
  const int face_pixels = cube.resolution * cube.resolution;
  const auto zero = hn::Zero(f);
  const auto one = hn::Set(f, 1.0F);
  FaceDiscs set;
  alignas(64) std::uint32_t colours[kLanes];
  for (int begin = 0; begin < discs.size; begin += lanes) {
    const auto x = hn::LoadU(f, discs.x + begin), y = hn::LoadU(f, discs.y + begin), z = hn::LoadU(f, discs.z + begin);
    const auto nx = hn::LoadU(f, discs.nx + begin), ny = hn::LoadU(f, discs.ny + begin),
               nz = hn::LoadU(f, discs.nz + begin);
    const auto r = hn::LoadU(f, discs.radius + begin);
    const auto turn = [&](int row, auto a, auto b, auto c) {
      const float* m = cube.rotation[row];
      return hn::MulAdd(hn::Set(f, m[0]), a, hn::MulAdd(hn::Set(f, m[1]), b, hn::Mul(hn::Set(f, m[2]), c)));
    };
    const decltype(r) c[3] = {turn(0, x, y, z), turn(1, x, y, z), turn(2, x, y, z)};
    const decltype(r) n[3] = {turn(0, nx, ny, nz), turn(1, nx, ny, nz), turn(2, nx, ny, nz)};
    const auto height = hn::MulAdd(c[0], n[0], hn::MulAdd(c[1], n[1], hn::Mul(c[2], n[2])));
    const auto distance2 = hn::MulAdd(c[0], c[0], hn::MulAdd(c[1], c[1], hn::Mul(c[2], c[2])));
    const auto r2 = hn::Mul(r, r);
    const auto back = hn::Ge(height, zero);
    const auto wide = hn::Lt(distance2, hn::Mul(hn::Set(f, 4.0F), r2));
    auto drawn = hn::And(hn::FirstN(f, static_cast<std::size_t>(discs.size - begin)), hn::Gt(r, zero));
    // Backs are clear to receivers within two radii.
    drawn = hn::AndNot(sides == Sides::front ? back : hn::And(back, wide), drawn);
    if (hn::AllFalse(f, drawn)) continue;
    hn::StoreU(hn::IfThenZeroElse(hn::RebindMask(u, back), hn::LoadU(u, discs.rgbe + begin)), u, colours);

    if (const auto near = hn::And(drawn, wide); !hn::AllFalse(f, near)) {
      alignas(64) float lane_c[3][kLanes], lane_n[3][kLanes];
      for (int k = 0; k < 3; ++k) {
        hn::StoreU(c[k], f, lane_c[k]);
        hn::StoreU(n[k], f, lane_n[k]);
      }
      for (unsigned rest = bits_of(f, near); rest != 0; rest &= rest - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(rest));
        draw_wide_disc(cube, pixels, {lane_c[0][i], lane_c[1][i], lane_c[2][i]},
                       {lane_n[0][i], lane_n[1][i], lane_n[2][i]}, discs.radius[static_cast<std::size_t>(begin) + i],
                       colours[i], from);
      }
      drawn = hn::AndNot(wide, drawn);
    }

    // A disc seen under less than 30 degrees reaches no face whose side its centre is not on.
    const auto per_height = hn::Div(one, height);
    for (int a = 0; a < 3; ++a) {
      const int ua = (a + 1) % 3, va = (a + 2) % 3;
      const auto cw = hn::Abs(c[a]), cu = c[ua], cv = c[va];
      const auto extent2 = [&](auto m) { return hn::Mul(r2, hn::Max(zero, hn::NegMulAdd(m, m, one))); };
      const auto ew2 = extent2(n[a]);
      const auto far = hn::Add(cw, r);  // beyond it no sphere around the disc reaches
      auto mask = hn::And(drawn, hn::And(hn::Lt(hn::Sub(hn::Abs(cu), r), far), hn::Lt(hn::Sub(hn::Abs(cv), r), far)));
      if (hn::AllFalse(f, mask)) continue;
      const auto negative = hn::Lt(c[a], zero);
      const auto nw = hn::IfThenElse(negative, hn::Neg(n[a]), n[a]);
      const auto nu = n[ua], nv = n[va];

      // Bounds along u: (cu - u cw)^2 = r^2 |k|^2 - r^2 (n.k)^2 with k = (-u, 1, 0) in (w, u, v).
      const auto p = hn::NegMulAdd(cw, cw, ew2);  // ew^2 - cw^2, below 0 where the disc is in front
      const auto whole = hn::Ge(p, hn::Mul(hn::Set(f, -1e-4F), r2));
      const auto per_p = hn::Div(hn::Set(f, -1.0F), p);
      const auto span = [&](auto cx, auto nx_, auto ny_, std::int32_t* first, std::int32_t* last) {
        const auto q = hn::MulAdd(cx, cw, hn::Mul(r2, hn::Mul(nx_, nw)));
        const auto cross = hn::MulSub(cw, nx_, hn::Mul(cx, nw));
        auto s = hn::MulAdd(cw, cw, hn::Mul(cx, cx));
        s = hn::NegMulAdd(cross, cross, s);
        s = hn::NegMulAdd(r2, hn::Mul(ny_, ny_), s);
        const auto half = hn::Mul(r, hn::Sqrt(hn::Max(s, zero)));
        store_span(hn::IfThenZeroElse(whole, hn::Mul(q, per_p)), hn::IfThenElse(whole, one, hn::Mul(half, per_p)),
                   resolution, first, last);
      };
      span(cu, nu, nv, set.x0, set.x1);
      span(cv, nv, nu, set.y0, set.y1);
      const I i32;
      const auto some = hn::And(hn::Lt(hn::LoadU(i32, set.x0), hn::LoadU(i32, set.x1)),
                                hn::Lt(hn::LoadU(i32, set.y0), hn::LoadU(i32, set.y1)));
      mask = hn::And(mask, hn::RebindMask(f, some));
      if (hn::AllFalse(f, mask)) continue;

      const auto inverse = hn::Div(one, cw);
      const auto u0 = hn::Mul(cu, inverse), v0 = hn::Mul(cv, inverse);
      const auto length2 = hn::MulAdd(u0, u0, hn::MulAdd(v0, v0, one));
      const auto scale = hn::Mul(cw, per_height);
      const auto alpha = hn::Mul(nu, scale), beta = hn::Mul(nv, scale);
      const auto al = hn::Mul(alpha, length2), bl = hn::Mul(beta, length2);
      const auto two = hn::Set(f, 2.0F);
      hn::StoreU(u0, f, set.u0);
      hn::StoreU(v0, f, set.v0);
      hn::StoreU(hn::MulAdd(alpha, hn::NegMulAdd(two, u0, al), one), f, set.aa);
      hn::StoreU(hn::MulAdd(beta, hn::NegMulAdd(two, v0, bl), one), f, set.bb);
      hn::StoreU(hn::Mul(two, hn::MulSub(alpha, hn::Sub(bl, v0), hn::Mul(beta, u0))), f, set.ab2);
      hn::StoreU(alpha, f, set.alpha);
      hn::StoreU(beta, f, set.beta);
      const auto size = hn::Mul(r, inverse);
      hn::StoreU(hn::Mul(size, size), f, set.square);
      hn::StoreU(inverse, f, set.inverse);
      hn::StoreU(hn::Div(hn::Set(f, kBump), hn::Mul(r, hn::Sqrt(length2))), f, set.bump);
      const auto plus = hn::Set(i32, 2 * a * face_pixels), minus = hn::Set(i32, (2 * a + 1) * face_pixels);
      hn::StoreU(hn::IfThenElse(hn::RebindMask(i32, negative), minus, plus), i32, set.first);
      for (unsigned rest = bits_of(f, mask); rest != 0; rest &= rest - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(rest));
        draw_on_face(cube, pixels, set, i, colours[i], from);
      }
    }
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(draw_discs);

void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const DiscQueue& discs, Sides sides,
                unsigned viewpoint) {
  HWY_DYNAMIC_DISPATCH(draw_discs)(cube, pixels, discs, sides, viewpoint);
}

}  // namespace ptc
#endif
