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
using VF = hn::VFromD<F>;
using VU = hn::VFromD<U>;
using MF = hn::Mask<F>;

/// Height of the shallow paraboloid that stands for a disc, over its radius (spec/shading.md#surfels).
constexpr float kBump = 0.01F;
constexpr float kSlack = 1e-3F;      // pixels: rounding of a disc's bounds
constexpr float kWideSlack = 0.05F;  // likewise, where squares cancel
constexpr int kChunk = 64;           // discs that are sorted by face at once

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
HWY_INLINE void cover(float* HWY_RESTRICT nearness, std::uint32_t* HWY_RESTRICT rgbe, VF near,
                      MF inside, VU colour, VU viewpoint) {
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

/// @param centre  as CubeGeometry has it
HWY_INLINE void draw_on_face(const float* HWY_RESTRICT centre, int resolution, const CubePixels& pixels,
                             const FaceDiscs& discs, std::size_t i, std::uint32_t rgbe, VU viewpoint) {
  const F f;
  const auto aa = hn::Set(f, discs.aa[i]);
  const auto alpha = hn::Set(f, discs.alpha[i]);
  const auto square = hn::Set(f, discs.square[i]);
  const auto inverse = hn::Set(f, discs.inverse[i]);
  const auto bump = hn::Set(f, discs.bump[i]);
  const auto u0 = hn::Set(f, discs.u0[i]);
  const auto colour = hn::Set(U(), rgbe);
  const float v0 = discs.v0[i], ab2 = discs.ab2[i], bb = discs.bb[i], beta = discs.beta[i];
  const int lanes = static_cast<int>(hn::Lanes(f)), x0 = discs.x0[i] & -lanes, x1 = discs.x1[i], y1 = discs.y1[i];
  const std::ptrdiff_t first = discs.first[i] + discs.y0[i] * resolution;
  float* HWY_RESTRICT nearness = pixels.nearness + first;
  std::uint32_t* HWY_RESTRICT colours = pixels.rgbe + first;
  for (int y = discs.y0[i]; y < y1; ++y, nearness += resolution, colours += resolution) {
    const float dv = centre[y] - v0;
    const auto b = hn::Set(f, ab2 * dv), c = hn::Set(f, bb * dv * dv), w0 = hn::Set(f, 1 + beta * dv);
    for (int x = x0; x < x1; x += lanes) {
      const auto du = hn::Sub(hn::LoadU(f, centre + x), u0);
      const auto form = hn::MulAdd(hn::MulAdd(aa, du, b), du, c);
      const auto w = hn::MulAdd(alpha, du, w0);
      const auto near = hn::NegMulAdd(form, bump, hn::Mul(w, inverse));  // below 0 behind the receiver
      const auto inside = hn::Lt(form, hn::Mul(square, hn::Mul(w, w)));
      cover(nearness + x, colours + x, near, inside, colour, viewpoint);
    }
  }
}

/// Columns of a row that a disc may cover.
struct Span {
  int first = 0, end = 0;
};

/// A disc in the axes of a face. The pixel (1, u, v) meets its plane at t = height / slope,
/// slope = n . (1, u, v), and the disc where |t (1, u, v) - c|^2 < r^2; times slope^2, a quadratic in u
/// for a given v.
struct WideDisc {
  float cw, cu, cv, nw, nu, nv;
  float radius, height;
  float d = cw * cw + cu * cu + cv * cv - radius * radius;
  float a = height * height - 2 * height * nu * cu + nu * nu * d;  // of u^2
  float per_a = 1 / a;

  [[nodiscard]] Span columns(float v, int resolution) const {
    if (!(a > 1e-6F * radius * radius)) return {0, resolution};
    const float slope = nw + nv * v, ahead = cw + cv * v;
    const float b = nu * slope * d - height * (slope * cu + nu * ahead);  // half of the linear term
    const float c = height * height * (1 + v * v) - 2 * height * slope * ahead + slope * slope * d;
    const float square = b * b - a * c;
    if (square <= 0) return {};
    const float root = std::sqrt(square), scale = 0.5F * static_cast<float>(resolution);
    const auto pixel = [&](float u) { return std::clamp((u + 1) * scale, 0.0F, 2 * scale); };
    const float low = pixel((-b - root) * per_a) - 0.5F - kWideSlack, high = pixel((-b + root) * per_a) + 0.5F + kWideSlack;
    return {static_cast<int>(std::max(0.0F, low)), std::min(resolution, static_cast<int>(high))};
  }
};

/// Covers what a row of pixels sees of a disc, one division a vector.
HWY_INLINE void draw_wide_row(const CubeGeometry& cube, const CubePixels& pixels, const WideDisc& disc, int y, int row,
                              const Span& span, VU colour, VU viewpoint) {
  const F f;
  const auto lanes = static_cast<int>(hn::Lanes(f));
  const float v = cube.centre[y];
  const auto row_slope = hn::Set(f, disc.nw + disc.nv * v), per_height = hn::Set(f, 1 / disc.height);
  const auto square = hn::Set(f, disc.radius * disc.radius), bump = hn::Set(f, kBump / disc.radius);
  for (int x = span.first & -lanes; x < span.end; x += lanes) {
    const auto u = hn::LoadU(f, cube.centre + x);
    const auto plane = hn::Mul(hn::MulAdd(hn::Set(f, disc.nu), u, row_slope), per_height);  // nearness of it
    const auto t = hn::Div(hn::Set(f, 1.0F), plane);  // infinite, negative or NaN: a miss
    const auto du = hn::MulSub(u, t, hn::Set(f, disc.cu));
    const auto dv = hn::MulSub(hn::Set(f, v), t, hn::Set(f, disc.cv));
    const auto dw = hn::Sub(t, hn::Set(f, disc.cw));
    const auto off = hn::MulAdd(du, du, hn::MulAdd(dv, dv, hn::Mul(dw, dw)));
    const auto inside = hn::And(hn::Gt(t, hn::Zero(f)), hn::Lt(off, square));
    const auto lost = hn::Mul(hn::Mul(bump, off), hn::LoadU(f, cube.inverse_length + y * cube.resolution + x));
    const auto near = hn::NegMulAdd(lost, hn::Mul(plane, plane), plane);
    cover(pixels.nearness + row + x, pixels.rgbe + row + x, near, inside, colour, viewpoint);
  }
}

/// A disc within two radii of the receiver may fill the view, so every face is looked at.
void draw_wide_disc(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows, const float (&c)[3],
                    const float (&n)[3], float radius, std::uint32_t rgbe, VU viewpoint) {
  const auto colour = hn::Set(U(), rgbe);
  for (int face = 0; face < 6; ++face) {
    const int a = face / 2, u = (a + 1) % 3, v = (a + 2) % 3;
    const float sign = face % 2 == 0 ? 1.0F : -1.0F;
    const float reach = c[a] * sign + radius * std::sqrt(std::max(0.0F, 1 - n[a] * n[a]));
    if (reach <= 0) continue;
    const WideDisc disc{.cw = c[a] * sign, .cu = c[u], .cv = c[v], .nw = n[a] * sign, .nu = n[u], .nv = n[v],
                        .radius = radius, .height = c[0] * n[0] + c[1] * n[1] + c[2] * n[2]};
    for (int y = rows.first[face]; y < rows.end[face]; ++y) {
      const Span span = disc.columns(cube.centre[y], cube.resolution);
      draw_wide_row(cube, pixels, disc, y, (face * cube.resolution + y) * cube.resolution, span, colour, viewpoint);
    }
  }
}

/// The span of pixels whose centres lie within [middle - half, middle + half] on a face's axis.
HWY_INLINE void store_span(VF middle, VF half, float resolution, std::int32_t* first,
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

/// Discs in the axes of the cube, a lane each.
struct CubeLanes {
  VF c[3], n[3];   // centre, normal
  VF radius, radius2;
  VF height;       // c . n
};

/// Discs in the axes of the faces that their centres lie before, a lane each.
struct FaceLanes {
  VF cw, cu, cv, nw, nu, nv;
  VF radius, radius2;
};

/// Discs that faces across one axis see, in columns.
struct AxisDiscs {
  alignas(64) float cw[kChunk + kLanes];  ///< negative: before the face of the negative side
  float cu[kChunk + kLanes], cv[kChunk + kLanes], nw[kChunk + kLanes], nu[kChunk + kLanes], nv[kChunk + kLanes];
  float radius[kChunk + kLanes];
  std::uint32_t rgbe[kChunk + kLanes];
  std::size_t size;
};

HWY_INLINE VF dot(const VF (&a)[3], const VF (&b)[3]) {
  return hn::MulAdd(a[0], b[0], hn::MulAdd(a[1], b[1], hn::Mul(a[2], b[2])));
}

HWY_INLINE CubeLanes load_discs(const CubeGeometry& cube, const DiscQueue& discs, int begin) {
  const F f;
  const VF c[3] = {hn::LoadU(f, discs.x + begin), hn::LoadU(f, discs.y + begin), hn::LoadU(f, discs.z + begin)};
  const VF n[3] = {hn::LoadU(f, discs.nx + begin), hn::LoadU(f, discs.ny + begin), hn::LoadU(f, discs.nz + begin)};
  CubeLanes turned;
  for (int k = 0; k < 3; ++k) {
    const glm::mat3& m = cube.rotation;
    const VF row[3] = {hn::Set(f, m[0][k]), hn::Set(f, m[1][k]), hn::Set(f, m[2][k])};
    turned.c[k] = dot(row, c);
    turned.n[k] = dot(row, n);
  }
  turned.radius = hn::LoadU(f, discs.radius + begin);
  turned.radius2 = hn::Mul(turned.radius, turned.radius);
  turned.height = dot(turned.c, turned.n);
  return turned;
}

HWY_INLINE void draw_wide_discs(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows,
                                const CubeLanes& discs, MF mask, VU colour, VU viewpoint) {
  const F f;
  alignas(64) float c[3][kLanes], n[3][kLanes], radius[kLanes];
  alignas(64) std::uint32_t colours[kLanes];
  hn::StoreU(colour, U(), colours);
  for (int k = 0; k < 3; ++k) {
    hn::StoreU(discs.c[k], f, c[k]);
    hn::StoreU(discs.n[k], f, n[k]);
  }
  hn::StoreU(discs.radius, f, radius);
  for (unsigned rest = bits_of(f, mask); rest != 0; rest &= rest - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(rest));
    draw_wide_disc(cube, pixels, rows, {c[0][i], c[1][i], c[2][i]}, {n[0][i], n[1][i], n[2][i]}, radius[i], colours[i],
                   viewpoint);
  }
}

/// Stores which pixels discs may cover. @return the discs that cover some
/// @param first_row, end_row  of the pixels that matter
HWY_INLINE MF store_bounds(const FaceLanes& d, float resolution, hn::VFromD<I> first_row, hn::VFromD<I> end_row,
                           FaceDiscs& out) {
  const F f;
  const I i;
  const auto zero = hn::Zero(f), one = hn::Set(f, 1.0F);
  // Bounds along u: (cu - u cw)^2 = r^2 |k|^2 - r^2 (n.k)^2 with k = (-u, 1, 0) in (w, u, v).
  const auto ew2 = hn::Mul(d.radius2, hn::Max(zero, hn::NegMulAdd(d.nw, d.nw, one)));
  const auto p = hn::NegMulAdd(d.cw, d.cw, ew2);  // ew^2 - cw^2, below 0 where the disc is in front
  const auto whole = hn::Ge(p, hn::Mul(hn::Set(f, -1e-4F), d.radius2));
  const auto per_p = hn::Div(hn::Set(f, -1.0F), p);
  const auto span = [&](VF cx, VF nx, VF ny, std::int32_t* first, std::int32_t* last) {
    const auto q = hn::MulAdd(cx, d.cw, hn::Mul(d.radius2, hn::Mul(nx, d.nw)));
    const auto cross = hn::MulSub(d.cw, nx, hn::Mul(cx, d.nw));
    auto s = hn::MulAdd(d.cw, d.cw, hn::Mul(cx, cx));
    s = hn::NegMulAdd(cross, cross, s);
    s = hn::NegMulAdd(d.radius2, hn::Mul(ny, ny), s);
    const auto half = hn::Mul(d.radius, hn::Sqrt(hn::Max(s, zero)));
    store_span(hn::IfThenZeroElse(whole, hn::Mul(q, per_p)), hn::IfThenElse(whole, one, hn::Mul(half, per_p)),
               resolution, first, last);
  };
  span(d.cu, d.nu, d.nv, out.x0, out.x1);
  span(d.cv, d.nv, d.nu, out.y0, out.y1);
  const auto y0 = hn::Max(hn::LoadU(i, out.y0), first_row), y1 = hn::Min(hn::LoadU(i, out.y1), end_row);
  hn::StoreU(y0, i, out.y0);
  hn::StoreU(y1, i, out.y1);
  return hn::RebindMask(f, hn::And(hn::Lt(hn::LoadU(i, out.x0), hn::LoadU(i, out.x1)), hn::Lt(y0, y1)));
}

/// Stores what says which pixels discs cover, and how near.
HWY_INLINE void store_forms(const FaceLanes& d, VF per_height, FaceDiscs& out) {
  const F f;
  const auto one = hn::Set(f, 1.0F), two = hn::Set(f, 2.0F);
  const auto inverse = hn::Div(one, d.cw);
  const auto u0 = hn::Mul(d.cu, inverse), v0 = hn::Mul(d.cv, inverse);
  const auto length2 = hn::MulAdd(u0, u0, hn::MulAdd(v0, v0, one));
  const auto scale = hn::Mul(d.cw, per_height);
  const auto alpha = hn::Mul(d.nu, scale), beta = hn::Mul(d.nv, scale);
  const auto al = hn::Mul(alpha, length2), bl = hn::Mul(beta, length2);
  const auto size = hn::Mul(d.radius, inverse);
  hn::StoreU(u0, f, out.u0);
  hn::StoreU(v0, f, out.v0);
  hn::StoreU(hn::MulAdd(alpha, hn::NegMulAdd(two, u0, al), one), f, out.aa);
  hn::StoreU(hn::MulAdd(beta, hn::NegMulAdd(two, v0, bl), one), f, out.bb);
  hn::StoreU(hn::Mul(two, hn::MulSub(alpha, hn::Sub(bl, v0), hn::Mul(beta, u0))), f, out.ab2);
  hn::StoreU(alpha, f, out.alpha);
  hn::StoreU(beta, f, out.beta);
  hn::StoreU(hn::Mul(size, size), f, out.square);
  hn::StoreU(inverse, f, out.inverse);
  hn::StoreU(hn::Div(hn::Set(f, kBump), hn::Mul(d.radius, hn::Sqrt(length2))), f, out.bump);
}

/// Sorts discs by the axes across which faces see them: each on the face that its centre lies before. A
/// disc seen under less than 30 degrees reaches no face whose side its centre is not on.
HWY_INLINE void sort_by_axis(const CubeLanes& discs, MF mask, VU colour, AxisDiscs (&axes)[3]) {
  const F f;
  const U u32;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto far = hn::Add(hn::Abs(discs.c[axis]), discs.radius);  // beyond it no sphere around the disc reaches
    const auto reaches = [&](VF c) { return hn::Lt(hn::Sub(hn::Abs(c), discs.radius), far); };
    const auto seen = hn::And(mask, hn::And(reaches(discs.c[u]), reaches(discs.c[v])));
    AxisDiscs& out = axes[axis];
    const std::size_t at = out.size;
    hn::CompressBlendedStore(discs.c[axis], seen, f, out.cw + at);
    hn::CompressBlendedStore(discs.c[u], seen, f, out.cu + at);
    hn::CompressBlendedStore(discs.c[v], seen, f, out.cv + at);
    hn::CompressBlendedStore(discs.n[axis], seen, f, out.nw + at);
    hn::CompressBlendedStore(discs.n[u], seen, f, out.nu + at);
    hn::CompressBlendedStore(discs.n[v], seen, f, out.nv + at);
    hn::CompressBlendedStore(discs.radius, seen, f, out.radius + at);
    out.size += hn::CompressBlendedStore(colour, hn::RebindMask(u32, seen), u32, out.rgbe + at);
  }
}

/// Draws the discs of an axis.
HWY_INLINE void draw_across(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows,
                            const AxisDiscs& discs, int axis, VU viewpoint) {
  const F f;
  const I i;
  const int face_pixels = cube.resolution * cube.resolution, plus = 2 * axis, minus = 2 * axis + 1;
  FaceDiscs set;
  for (std::size_t begin = 0; begin < discs.size; begin += hn::Lanes(f)) {
    const auto load = [&](const float* column) { return hn::LoadU(f, column + begin); };
    const auto cw = load(discs.cw), nw = load(discs.nw), radius = load(discs.radius);
    const auto negative = hn::Lt(cw, hn::Zero(f));
    const FaceLanes d{hn::Abs(cw), load(discs.cu), load(discs.cv), hn::IfThenElse(negative, hn::Neg(nw), nw),
                      load(discs.nu), load(discs.nv), radius, hn::Mul(radius, radius)};
    const auto of_face = [&](int at_plus, int at_minus) {
      return hn::IfThenElse(hn::RebindMask(i, negative), hn::Set(i, at_minus), hn::Set(i, at_plus));
    };
    auto mask = store_bounds(d, static_cast<float>(cube.resolution), of_face(rows.first[plus], rows.first[minus]),
                             of_face(rows.end[plus], rows.end[minus]), set);
    mask = hn::And(mask, hn::FirstN(f, discs.size - begin));
    if (hn::AllFalse(f, mask)) continue;
    const auto height = hn::MulAdd(d.cw, d.nw, hn::MulAdd(d.cu, d.nu, hn::Mul(d.cv, d.nv)));
    store_forms(d, hn::Div(hn::Set(f, 1.0F), height), set);
    hn::StoreU(of_face(plus * face_pixels, minus * face_pixels), i, set.first);
    for (unsigned rest = bits_of(f, mask); rest != 0; rest &= rest - 1) {
      const auto k = static_cast<std::size_t>(std::countr_zero(rest));
      draw_on_face(cube.centre, cube.resolution, pixels, set, k, discs.rgbe[begin + k], viewpoint);
    }
  }
}

}  // namespace

void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows, const DiscQueue& discs,
                Sides sides, unsigned viewpoint) {
  const F f;
  const U u;
  const auto from = hn::Set(u, viewpoint);
  const auto lanes = static_cast<int>(hn::Lanes(f));
  AxisDiscs axes[3];
  for (int chunk = 0; chunk < discs.size; chunk += kChunk) {
    for (AxisDiscs& axis : axes) axis.size = 0;
    for (int begin = chunk; begin < std::min(discs.size, chunk + kChunk); begin += lanes) {
      const CubeLanes d = load_discs(cube, discs, begin);
      const auto back = hn::Ge(d.height, hn::Zero(f));
      const auto wide = hn::Lt(dot(d.c, d.c), hn::Mul(hn::Set(f, 4.0F), d.radius2));
      auto drawn = hn::And(hn::FirstN(f, static_cast<std::size_t>(discs.size - begin)), hn::Gt(d.radius, hn::Zero(f)));
      // Backs are clear to receivers within two radii.
      drawn = hn::AndNot(sides == Sides::front ? back : hn::And(back, wide), drawn);
      const auto colour = hn::IfThenZeroElse(hn::RebindMask(u, back), hn::LoadU(u, discs.rgbe + begin));
      if (const auto near = hn::And(drawn, wide); !hn::AllFalse(f, near)) {
        draw_wide_discs(cube, pixels, rows, d, near, colour, from);
      }
      sort_by_axis(d, hn::AndNot(wide, drawn), colour, axes);
    }
    for (int axis = 0; axis < 3; ++axis) draw_across(cube, pixels, rows, axes[axis], axis, from);
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(draw_discs);

void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows, const DiscQueue& discs,
                Sides sides, unsigned viewpoint) {
  HWY_DYNAMIC_DISPATCH(draw_discs)(cube, pixels, rows, discs, sides, viewpoint);
}

}  // namespace ptc
#endif
