// Discs drawn into the pixels of a direction buffer (direction_kernels.h).
#include <algorithm>
#include <bit>

#include "engine/shade/kernels/direction_kernels.h"

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/kernels/draw_discs.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/kernels/canvas-inl.h"
#include "engine/shade/kernels/wide_discs-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

constexpr float kSlack = 1e-3F;  // pixels: rounding of a disc's bounds
constexpr int kChunk = 64;       // discs that are sorted by face at once

/// Discs on one face of the cube, set up for their pixels. A pixel at (du, dv) from the projected
/// centre sees the disc's plane at t = cw / w, w = 1 + alpha du + beta dv, and the disc itself
/// where
///   aa du^2 + 2 ab du dv + bb dv^2 < (radius / cw)^2 w^2.
struct FaceDiscs {
  alignas(64) float u0[kLanes], v0[kLanes];
  float aa[kLanes], ab2[kLanes], bb[kLanes];
  float alpha[kLanes], beta[kLanes];
  float square[kLanes];   // (radius / cw)^2
  float inverse[kLanes];  // 1 / cw
  float bump[kLanes];     // nearness lost per unit of the quadratic form
  std::int32_t x0[kLanes], x1[kLanes], y0[kLanes], y1[kLanes];
  std::int32_t first[kLanes];  // pixel of the face
};

/// What a vector of pixels needs of a disc.
struct FaceDisc {
  VF aa, alpha, square, inverse, bump, u0;
  VU colour;
  float v0, ab2, bb, beta;

  HWY_INLINE FaceDisc(const FaceDiscs& discs, std::size_t i, std::uint32_t rgbe)
      : aa(hn::Set(F(), discs.aa[i])),
        alpha(hn::Set(F(), discs.alpha[i])),
        square(hn::Set(F(), discs.square[i])),
        inverse(hn::Set(F(), discs.inverse[i])),
        bump(hn::Set(F(), discs.bump[i])),
        u0(hn::Set(F(), discs.u0[i])),
        colour(hn::Set(U(), rgbe)),
        v0(discs.v0[i]),
        ab2(discs.ab2[i]),
        bb(discs.bb[i]),
        beta(discs.beta[i]) {}

  /// @param at  the pixels
  /// @param v   of their row
  template <class CanvasType>
  HWY_INLINE void draw(const CanvasType& canvas, VF u, float v, std::ptrdiff_t at) const {
    const F f;
    const float dv = v - v0;
    const auto du = hn::Sub(u, u0);
    const auto form =
        hn::MulAdd(hn::MulAdd(aa, du, hn::Set(f, ab2 * dv)), du, hn::Set(f, bb * dv * dv));
    const auto w = hn::MulAdd(alpha, du, hn::Set(f, 1 + beta * dv));
    const auto near =
        hn::NegMulAdd(form, bump, hn::Mul(w, inverse));  // below 0 behind the receiver
    canvas.cover(at, near, hn::Lt(form, hn::Mul(square, hn::Mul(w, w))), colour);
  }
};

/// Draws a disc that reaches into one vector of each of so many rows at most. The rows that it does
/// not reach are drawn too, without a branch; past the face, centres are NaN and nothing is inside.
template <int kRows, class CanvasType>
HWY_INLINE void draw_narrow(const CanvasType& canvas, const FaceDiscs& discs, std::size_t i,
                            std::uint32_t rgbe) {
  const FaceDisc disc(discs, i, rgbe);
  const float* centre = canvas.cube.centre;
  const std::ptrdiff_t first = discs.first[i] + discs.y0[i] * canvas.cube.resolution + discs.x0[i];
  const auto u = hn::LoadU(F(), centre + discs.x0[i]);
  for (int row = 0; row < kRows; ++row) {
    disc.draw(canvas, u, centre[discs.y0[i] + row], first + row * canvas.cube.resolution);
  }
}

/// Draws a disc of any size.
template <class CanvasType>
HWY_INLINE void draw_broad(const CanvasType& canvas, const FaceDiscs& discs, std::size_t i,
                           std::uint32_t rgbe) {
  const FaceDisc disc(discs, i, rgbe);
  const float* centre = canvas.cube.centre;
  const int lanes = static_cast<int>(hn::Lanes(F())), x1 = discs.x1[i], y1 = discs.y1[i];
  std::ptrdiff_t row = discs.first[i] + discs.y0[i] * canvas.cube.resolution;
  for (int y = discs.y0[i]; y < y1; ++y, row += canvas.cube.resolution) {
    for (int x = discs.x0[i]; x < x1; x += lanes)
      disc.draw(canvas, hn::LoadU(F(), centre + x), centre[y], row + x);
  }
}

/// Discs in the axes of the cube, a lane each.
struct CubeLanes {
  VF c[3], n[3];  // centre, normal
  VF radius, radius2;
  VF height;  // c . n
};

/// Discs in the axes of the faces that their centres lie before, a lane each.
struct FaceLanes {
  VF cw, cu, cv, nw, nu, nv;
  VF radius, radius2;
};

/// Discs in the axes of the faces that see them, in columns.
struct FaceQueue {
  static constexpr int kCapacity = 3 * kChunk + kLanes;  // a disc is before three faces at most
  alignas(64) float cw[kCapacity];
  float cu[kCapacity], cv[kCapacity], nw[kCapacity], nu[kCapacity], nv[kCapacity],
      radius[kCapacity];
  std::uint32_t rgbe[kCapacity];
  std::int32_t face[kCapacity];
  std::size_t size = 0;
};

HWY_INLINE VF dot(const VF (&a)[3], const VF (&b)[3]) {
  return hn::MulAdd(a[0], b[0], hn::MulAdd(a[1], b[1], hn::Mul(a[2], b[2])));
}

HWY_INLINE CubeLanes load_discs(const CubeGeometry& cube, const DiscQueue& discs, int begin) {
  const F f;
  const VF c[3] = {hn::LoadU(f, discs.x + begin), hn::LoadU(f, discs.y + begin),
                   hn::LoadU(f, discs.z + begin)};
  const VF n[3] = {hn::LoadU(f, discs.nx + begin), hn::LoadU(f, discs.ny + begin),
                   hn::LoadU(f, discs.nz + begin)};
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

template <class CanvasType>
HWY_INLINE void draw_wide_discs(const CanvasType& canvas, const FaceRows& rows,
                                const CubeLanes& discs, MF mask, VU colour) {
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
    draw_wide_disc(canvas, rows, {c[0][i], c[1][i], c[2][i]}, {n[0][i], n[1][i], n[2][i]},
                   radius[i], colours[i]);
  }
}

/// Pixels that discs may cover.
struct FaceBounds {
  hn::VFromD<I> x0, x1, y0, y1;
  MF seen;  // those that may cover some

  /// Discs of so many rows at most that begin and end in one vector.
  HWY_INLINE MF within(int rows) const {
    const I i;
    const auto narrow = hn::Lt(hn::Sub(x1, x0), hn::Set(i, static_cast<int>(hn::Lanes(i)) + 1));
    return hn::RebindMask(F(), hn::And(narrow, hn::Lt(hn::Sub(y1, y0), hn::Set(i, rows + 1))));
  }
  HWY_INLINE void store(FaceDiscs& out) const {
    const I i;
    hn::StoreU(x0, i, out.x0);
    hn::StoreU(x1, i, out.x1);
    hn::StoreU(y0, i, out.y0);
    hn::StoreU(y1, i, out.y1);
  }
};

/// @param first_row, end_row  of the pixels that matter
HWY_INLINE FaceBounds bounds_of(const FaceLanes& d, int resolution, hn::VFromD<I> first_row,
                                hn::VFromD<I> end_row) {
  const F f;
  const I i;
  const auto zero = hn::Zero(f), one = hn::Set(f, 1.0F);
  // Bounds along u: (cu - u cw)^2 = r^2 |k|^2 - r^2 (n.k)^2 with k = (-u, 1, 0) in (w, u, v).
  const auto ew2 = hn::Mul(d.radius2, hn::Max(zero, hn::NegMulAdd(d.nw, d.nw, one)));
  const auto p = hn::NegMulAdd(d.cw, d.cw, ew2);  // ew^2 - cw^2, below 0 where the disc is in front
  const auto whole = hn::Ge(p, hn::Mul(hn::Set(f, -1e-4F), d.radius2));
  const auto per_p = hn::Div(hn::Set(f, -1.0F), p);
  const float edge = static_cast<float>(resolution);
  const auto scale = hn::Set(f, 0.5F * edge);
  const auto pixel = [&](VF at, float slack) {
    return hn::Min(hn::Max(hn::MulAdd(at, scale, hn::Set(f, 0.5F * edge + slack)), zero),
                   hn::Set(f, edge));
  };
  // The span of pixels whose centres lie within middle -+ half.
  const auto span = [&](VF cx, VF nx, VF ny, hn::VFromD<I>& first, hn::VFromD<I>& end) {
    const auto q = hn::MulAdd(cx, d.cw, hn::Mul(d.radius2, hn::Mul(nx, d.nw)));
    const auto cross = hn::MulSub(d.cw, nx, hn::Mul(cx, d.nw));
    auto s = hn::MulAdd(d.cw, d.cw, hn::Mul(cx, cx));
    s = hn::NegMulAdd(cross, cross, s);
    s = hn::NegMulAdd(d.radius2, hn::Mul(ny, ny), s);
    const auto middle = hn::IfThenZeroElse(whole, hn::Mul(q, per_p));
    const auto half =
        hn::IfThenElse(whole, one, hn::Mul(hn::Mul(d.radius, hn::Sqrt(hn::Max(s, zero))), per_p));
    first = hn::ConvertTo(i, hn::Ceil(pixel(hn::Sub(middle, half), -0.5F - kSlack)));
    end = hn::ConvertTo(i, hn::Floor(pixel(hn::Add(middle, half), 0.5F + kSlack)));
  };
  FaceBounds b;
  span(d.cu, d.nu, d.nv, b.x0, b.x1);
  span(d.cv, d.nv, d.nu, b.y0, b.y1);
  b.y0 = hn::Max(b.y0, first_row);
  b.y1 = hn::Min(b.y1, end_row);
  b.seen = hn::RebindMask(f, hn::And(hn::Lt(b.x0, b.x1), hn::Lt(b.y0, b.y1)));
  // Whole vectors where that takes no more of them.
  const int lanes = static_cast<int>(hn::Lanes(i));
  const auto aligned = hn::And(b.x0, hn::Set(i, -lanes));
  b.x0 = hn::IfThenElse(hn::Lt(hn::Sub(b.x1, aligned), hn::Set(i, lanes + 1)), aligned, b.x0);
  return b;
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

/// Appends discs to the faces that may see them, each across every axis on the side where its
/// centre is. A disc seen under less than 30 degrees reaches no face whose side its centre is not
/// on.
HWY_INLINE void add_to_faces(const CubeLanes& discs, MF mask, VU colour, FaceQueue& out) {
  const F f;
  const I i;
  const U u32;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto cw = hn::Abs(discs.c[axis]),
               far = hn::Add(cw, discs.radius);  // no sphere around the disc reaches beyond
    const auto reaches = [&](VF c) { return hn::Lt(hn::Sub(hn::Abs(c), discs.radius), far); };
    const auto seen = hn::And(mask, hn::And(reaches(discs.c[u]), reaches(discs.c[v])));
    const auto negative = hn::Lt(discs.c[axis], hn::Zero(f));
    const std::size_t at = out.size;
    append(cw, seen, f, out.cw + at);
    append(discs.c[u], seen, f, out.cu + at);
    append(discs.c[v], seen, f, out.cv + at);
    append(hn::IfThenElse(negative, hn::Neg(discs.n[axis]), discs.n[axis]), seen, f, out.nw + at);
    append(discs.n[u], seen, f, out.nu + at);
    append(discs.n[v], seen, f, out.nv + at);
    append(discs.radius, seen, f, out.radius + at);
    const auto face =
        hn::IfThenElse(hn::RebindMask(i, negative), hn::Set(i, 2 * axis + 1), hn::Set(i, 2 * axis));
    append(face, hn::RebindMask(i, seen), i, out.face + at);
    out.size += append(colour, hn::RebindMask(u32, seen), u32, out.rgbe + at);
  }
}

/// Discs that cross a face's plane beside their centres: set up for that face, they would lose
/// their figures in divisions by next to nothing.
HWY_INLINE MF across_faces(const CubeLanes& discs, VF distance2) {
  const F f;
  const auto beside =
      hn::Min(hn::Abs(discs.c[0]), hn::Min(hn::Abs(discs.c[1]), hn::Abs(discs.c[2])));
  return hn::And(hn::Lt(beside, hn::Mul(hn::Set(f, 0.05F), discs.radius)),
                 hn::Lt(distance2, hn::Mul(hn::Set(f, 9.0F), discs.radius2)));
}

/// Draws the discs of a queue.
template <class CanvasType>
HWY_INLINE void draw_queue(const CanvasType& canvas, const FaceRows& rows, const FaceQueue& queue) {
  const F f;
  const I i;
  const CubeGeometry& cube = canvas.cube;
  FaceDiscs set;
  for (std::size_t begin = 0; begin < queue.size; begin += hn::Lanes(f)) {
    const auto load = [&](const float* column) { return hn::LoadU(f, column + begin); };
    const auto radius = load(queue.radius);
    const FaceLanes d{load(queue.cw), load(queue.cu), load(queue.cv), load(queue.nw),
                      load(queue.nu), load(queue.nv), radius,         hn::Mul(radius, radius)};
    auto mask = hn::FirstN(f, queue.size - begin);
    const auto face = hn::IfThenElseZero(hn::RebindMask(i, mask), hn::LoadU(i, queue.face + begin));
    const FaceBounds bounds = bounds_of(d, cube.resolution, hn::GatherIndex(i, rows.first, face),
                                        hn::GatherIndex(i, rows.end, face));
    mask = hn::And(mask, bounds.seen);
    if (hn::AllFalse(f, mask)) continue;
    const auto height = hn::MulAdd(d.cw, d.nw, hn::MulAdd(d.cu, d.nu, hn::Mul(d.cv, d.nv)));
    store_forms(d, hn::Div(hn::Set(f, 1.0F), height), set);
    hn::StoreU(hn::Mul(face, hn::Set(i, cube.resolution * cube.resolution)), i, set.first);
    bounds.store(set);
    const std::uint32_t* rgbe = queue.rgbe + begin;
    const auto for_each = [&](MF some, const auto& body) {
      for (unsigned rest = bits_of(f, some); rest != 0; rest &= rest - 1) {
        const auto k = static_cast<std::size_t>(std::countr_zero(rest));
        body(k, rgbe[k]);
      }
    };
    // One by one their numbers of rows cannot be foretold, and a branch mistaken costs as much as
    // two rows.
    const auto two = hn::And(mask, bounds.within(2)),
               four = hn::AndNot(two, hn::And(mask, bounds.within(4)));
    for_each(two, [&](std::size_t k, std::uint32_t c) { draw_narrow<2>(canvas, set, k, c); });
    for_each(four, [&](std::size_t k, std::uint32_t c) { draw_narrow<4>(canvas, set, k, c); });
    for_each(hn::AndNot(hn::Or(two, four), mask),
             [&](std::size_t k, std::uint32_t c) { draw_broad(canvas, set, k, c); });
  }
}

template <class CanvasType>
void draw_all(const CanvasType& canvas, const FaceRows& rows, const DiscQueue& discs, Sides sides) {
  const F f;
  const U u;
  const auto lanes = static_cast<int>(hn::Lanes(f));
  FaceQueue queue;
  for (int chunk = 0; chunk < discs.size; chunk += kChunk) {
    queue.size = 0;
    for (int begin = chunk; begin < std::min(discs.size, chunk + kChunk); begin += lanes) {
      const CubeLanes d = load_discs(canvas.cube, discs, begin);
      const auto back = hn::Ge(d.height, hn::Zero(f));
      const auto distance2 = dot(d.c, d.c);
      const auto close = hn::Lt(distance2, hn::Mul(hn::Set(f, 4.0F), d.radius2));
      auto drawn = hn::And(hn::FirstN(f, static_cast<std::size_t>(discs.size - begin)),
                           hn::Gt(d.radius, hn::Zero(f)));
      // Backs are clear to receivers within two radii.
      drawn = hn::AndNot(sides == Sides::front ? back : hn::And(back, close), drawn);
      const auto colour =
          hn::IfThenZeroElse(hn::RebindMask(u, back), hn::LoadU(u, discs.rgbe + begin));
      const auto wide = hn::And(drawn, hn::Or(close, across_faces(d, distance2)));
      if (!hn::AllFalse(f, wide)) draw_wide_discs(canvas, rows, d, wide, colour);
      add_to_faces(d, hn::AndNot(wide, drawn), colour, queue);
    }
    draw_queue(canvas, rows, queue);
  }
}

}  // namespace

void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows,
                const DiscQueue& discs, Sides sides, unsigned viewpoint) {
  if (pixels.rgbe) {
    draw_all(Canvas<true>(cube, pixels, viewpoint), rows, discs, sides);
  } else {
    draw_all(Canvas<false>(cube, pixels, viewpoint), rows, discs, sides);
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(draw_discs);

void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows,
                const DiscQueue& discs, Sides sides, unsigned viewpoint) {
  HWY_DYNAMIC_DISPATCH(draw_discs)(cube, pixels, rows, discs, sides, viewpoint);
}

}  // namespace ptc
#endif
