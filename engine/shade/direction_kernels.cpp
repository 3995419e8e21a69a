#include "engine/shade/direction_kernels.h"

#include <algorithm>
#include <bit>
#include <cmath>

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/direction_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using F = hn::CappedTag<float, kPixelLanes>;
using I = hn::RebindToSigned<F>;
using U = hn::RebindToUnsigned<F>;

/// Height of the shallow paraboloid that stands for a disc, over its radius (spec/shading.md#surfels).
constexpr float kBump = 0.01F;
constexpr float kSlack = 1e-3F;  // pixels: rounding of a disc's bounds

/// Discs on one face of the cube, set up for their pixels. A pixel at (du, dv) from the projected
/// centre sees the disc's plane at t = cw / w, w = 1 + alpha du + beta dv, and the disc itself where
///   aa du^2 + 2 ab du dv + bb dv^2 < (radius / cw)^2 w^2.
struct FaceDiscs {
  alignas(64) float u0[kPixelLanes], v0[kPixelLanes];
  float aa[kPixelLanes], ab2[kPixelLanes], bb[kPixelLanes];
  float alpha[kPixelLanes], beta[kPixelLanes];
  float square[kPixelLanes];    // (radius / cw)^2
  float inverse[kPixelLanes];   // 1 / cw
  float bump[kPixelLanes];      // nearness lost per unit of the quadratic form
  std::int32_t x0[kPixelLanes], x1[kPixelLanes], y0[kPixelLanes], y1[kPixelLanes];
  std::int32_t first[kPixelLanes];  // pixel of the face
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
  alignas(64) std::uint32_t colours[kPixelLanes];
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
      alignas(64) float lane_c[3][kPixelLanes], lane_n[3][kPixelLanes];
      for (int k = 0; k < 3; ++k) {
        hn::StoreU(c[k], f, lane_c[k]);
        hn::StoreU(n[k], f, lane_n[k]);
      }
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(f, near, bits);
      for (unsigned rest = bits[0]; rest != 0; rest &= rest - 1) {
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
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(f, mask, bits);
      for (unsigned rest = bits[0]; rest != 0; rest &= rest - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(rest));
        draw_on_face(cube, pixels, set, i, colours[i], from);
      }
    }
  }
}

namespace {

/// Sums take wider vectors than discs, which are narrow.
constexpr int kSumLanes = 16;
using W = hn::CappedTag<float, kSumLanes>;
using WI = hn::RebindToSigned<W>;
using WU = hn::RebindToUnsigned<W>;

constexpr int kMostResolution = 64;
constexpr float kMostShift = 4;  // pixels: beyond it the first order says nothing

/// What the pixels of a row show, in columns.
struct Row {
  alignas(64) float nearness[kMostResolution + kSumLanes];
  float value[7][kMostResolution + kSumLanes];  // covered, red, green, blue, sky red, green, blue
};

/// An entry of a table of kViewpoints for each lane.
HWY_INLINE hn::VFromD<W> look_up(const float* table, hn::VFromD<WI> index) {
  const W f;
  if constexpr (hn::MaxLanes(f) == 16) {
    return hn::TableLookupLanes(hn::Load(f, table), hn::IndicesFromVec(f, index));
  } else if constexpr (hn::MaxLanes(f) == 8) {
    const WI i;
    const auto low = hn::IndicesFromVec(f, hn::And(index, hn::Set(i, 7)));
    const auto upper = hn::RebindMask(f, hn::Gt(index, hn::Set(i, 7)));
    return hn::IfThenElse(upper, hn::TableLookupLanes(hn::Load(f, table + 8), low),
                          hn::TableLookupLanes(hn::Load(f, table), low));
  } else {
    return hn::GatherIndex(f, table, index);
  }
}

/// How far the edge between two pixels moves towards the second, in pixels: as the nearer of them does.
/// @param at  coordinate of the edge along the axis
/// @param offset_w, offset  of the receiver along w and along the axis, by viewpoint
HWY_INLINE hn::VFromD<W> shift_of(hn::VFromD<W> a, hn::VFromD<W> b, hn::VFromD<W> at, const float* offset_w,
                                  const float* offset, float half_resolution) {
  const W f;
  const WI i;
  const auto near = hn::Max(a, b);
  const auto viewpoint = hn::And(hn::BitCast(i, near), hn::Set(i, kViewpoints - 1));
  const auto move = hn::MulSub(at, look_up(offset_w, viewpoint), look_up(offset, viewpoint));
  const auto pixels = hn::Mul(hn::Mul(near, move), hn::Set(f, half_resolution));
  return hn::Max(hn::Min(pixels, hn::Set(f, kMostShift)), hn::Set(f, -kMostShift));
}

/// Sums of a face, a lane each.
struct LaneSums {
  hn::VFromD<W> total, value[7], open_w, open_u, open_v;
};

/// Decodes a row and adds it up.
template <int kValues>
HWY_INLINE void add_row(const CubeGeometry& cube, const CubePixels& pixels, const float* sky, int y, float cosine_row,
                        float nu, Row& out, LaneSums& sums) {
  const W f;
  const WU u;
  const WI s;
  const auto zero = hn::Zero(f);
  const auto lanes = static_cast<int>(hn::Lanes(f));
  const std::size_t plane = static_cast<std::size_t>(cube.resolution) * static_cast<std::size_t>(cube.resolution);
  auto row_open = zero;
  for (int x = 0; x < cube.resolution; x += lanes) {
    const auto at = static_cast<std::size_t>(y * cube.resolution + x);
    const auto pu = hn::LoadU(f, cube.centre + x);
    const auto cosine = hn::Max(zero, hn::MulAdd(hn::Set(f, nu), pu, hn::Set(f, cosine_row)));
    const auto weight = hn::Mul(cosine, hn::LoadU(f, cube.weight + at));
    const auto near = hn::LoadU(f, pixels.nearness + at);
    const auto empty = hn::Eq(near, zero);
    hn::StoreU(near, f, out.nearness + x);
    const auto c = hn::LoadU(u, pixels.rgbe + at);
    // rgbe: m 2^(e - 136); exponents below 9 are black here.
    const auto exponent = hn::Max(hn::Sub(hn::BitCast(s, hn::ShiftRight<24>(c)), hn::Set(s, 9)), hn::Zero(s));
    const auto scale = hn::IfThenZeroElse(empty, hn::BitCast(f, hn::ShiftLeft<23>(exponent)));
    const auto byte = hn::Set(u, 255U);
    const auto colour = [&](auto bits) {
      return hn::Mul(hn::ConvertTo(f, hn::BitCast(s, hn::And(bits, byte))), scale);
    };
    const auto put = [&](int k, hn::VFromD<W> value) {
      hn::StoreU(value, f, out.value[k] + x);
      sums.value[k] = hn::MulAdd(value, weight, sums.value[k]);
    };
    put(0, hn::IfThenZeroElse(empty, hn::Set(f, 1.0F)));
    put(1, colour(c));
    put(2, colour(hn::ShiftRight<8>(c)));
    put(3, colour(hn::ShiftRight<16>(c)));
    if constexpr (kValues == 7) {
      for (std::size_t k = 0; k < 3; ++k) {
        put(4 + static_cast<int>(k), hn::IfThenElseZero(empty, hn::LoadU(f, sky + k * plane + at)));
      }
    }
    sums.total = hn::Add(sums.total, weight);
    const auto direction = hn::IfThenElseZero(empty, hn::Div(weight, hn::LoadU(f, cube.length + at)));
    sums.open_w = hn::Add(sums.open_w, direction);
    row_open = hn::Add(row_open, direction);
    sums.open_u = hn::MulAdd(direction, pu, sums.open_u);
  }
  sums.open_v = hn::MulAdd(row_open, hn::Set(f, cube.centre[y]), sums.open_v);
}

/// Lets the values of one side of each edge take over weight from the other.
template <int kValues>
HWY_INLINE void add_edges(const Row& a, const Row& b, std::size_t at_a, std::size_t at_b, hn::VFromD<W> moved,
                          LaneSums& sums) {
  const W f;
  for (int k = 0; k < kValues; ++k) {
    const auto change = hn::Sub(hn::LoadU(f, a.value[k] + at_a), hn::LoadU(f, b.value[k] + at_b));
    sums.value[k] = hn::MulAdd(moved, change, sums.value[k]);
  }
}

template <int kValues>
HWY_INLINE void sum_rows(const CubeGeometry& cube, const CubePixels& pixels, const float* sky, float nw, float nu,
                         float nv, const FaceOffsets* offsets, FaceSums& sums) {
  const W f;
  const auto zero = hn::Zero(f);
  const auto lanes = static_cast<int>(hn::Lanes(f));
  const float half_resolution = 0.5F * static_cast<float>(cube.resolution);
  const auto half_step = hn::Set(f, 1 / static_cast<float>(cube.resolution));
  LaneSums lane{zero, {zero, zero, zero, zero, zero, zero, zero}, zero, zero, zero};
  Row rows[2];
  for (Row& row : rows) {  // what lies past the last edge of a row has no weight, but must be a number
    std::fill_n(row.nearness + cube.resolution, kSumLanes, 0.0F);
    for (auto& column : row.value) std::fill_n(column + cube.resolution, kSumLanes, 0.0F);
  }
  bool above = false;
  for (int y = 0; y < cube.resolution; ++y) {
    const float v = cube.centre[y];
    const float cosine_row = nw + nv * v;
    if (cosine_row + std::abs(nu) <= 0) {
      above = false;
      continue;
    }
    Row& row = rows[y % 2];
    const Row& last = rows[1 - y % 2];
    add_row<kValues>(cube, pixels, sky, y, cosine_row, nu, row, lane);
    for (int x = 0; offsets && x < cube.resolution; x += lanes) {
      const auto k = static_cast<std::size_t>(x);
      const std::size_t at = static_cast<std::size_t>(y * cube.resolution) + k;
      const auto pu = hn::LoadU(f, cube.centre + x);
      const auto here = hn::LoadU(f, row.nearness + k);
      const auto edge_cosine = [&](hn::VFromD<W> u, float row_cosine) {
        return hn::Max(zero, hn::MulAdd(hn::Set(f, nu), u, hn::Set(f, row_cosine)));
      };
      const auto next = hn::LoadU(f, row.nearness + k + 1);
      const auto u = hn::Add(pu, half_step);
      const auto along = hn::Mul(shift_of(here, next, u, offsets->w, offsets->u, half_resolution),
                                 hn::Mul(edge_cosine(u, cosine_row), hn::LoadU(f, cube.edge_u + at)));
      add_edges<kValues>(row, row, k, k + 1, along, lane);
      if (!above) continue;
      const auto before = hn::LoadU(f, last.nearness + k);
      const float edge = v - 1 / static_cast<float>(cube.resolution);
      const auto down = hn::Mul(shift_of(before, here, hn::Set(f, edge), offsets->w, offsets->v, half_resolution),
                                hn::Mul(edge_cosine(pu, nw + nv * edge),
                                        hn::LoadU(f, cube.edge_v + at - static_cast<std::size_t>(cube.resolution))));
      add_edges<kValues>(last, row, k, k, down, lane);
    }
    above = true;
  }
  const auto add = [&](float& sum, auto lanes_sum) { sum += hn::GetLane(hn::SumOfLanes(f, lanes_sum)); };
  add(sums.total, lane.total);
  add(sums.covered, lane.value[0]);
  for (std::size_t k = 0; k < 3; ++k) {
    add(sums.light[k], lane.value[1 + k]);
    if constexpr (kValues == 7) add(sums.sky[k], lane.value[4 + k]);
  }
  add(sums.open[0], lane.open_w);
  add(sums.open[1], lane.open_u);
  add(sums.open[2], lane.open_v);
}

}  // namespace

void sum_face(const CubeGeometry& cube, const CubePixels& pixels, const float* sky, float nw, float nu, float nv,
              const FaceOffsets* offsets, FaceSums& sums) {
  if (sky) {
    sum_rows<7>(cube, pixels, sky, nw, nu, nv, offsets, sums);
  } else {
    sum_rows<4>(cube, pixels, sky, nw, nu, nv, offsets, sums);
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(draw_discs);
HWY_EXPORT(sum_face);

void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const DiscQueue& discs, Sides sides,
                unsigned viewpoint) {
  HWY_DYNAMIC_DISPATCH(draw_discs)(cube, pixels, discs, sides, viewpoint);
}

void sum_face(const CubeGeometry& cube, const CubePixels& pixels, const float* sky, float nw, float nu, float nv,
              const FaceOffsets* offsets, FaceSums& sums) {
  HWY_DYNAMIC_DISPATCH(sum_face)(cube, pixels, sky, nw, nu, nv, offsets, sums);
}

}  // namespace ptc
#endif
