// Draws discs into the pixels of a direction buffer: every pixel whose centre ray meets a disc.
//
// A disc goes through four stages, each on a vector of discs or pixels:
//
//     DiscQueue --> CubeLanes --> FaceQueue --> FaceDiscs --> Canvas
//     world         cube axes,    axes of each  bounds and    pixels
//                   culling       face it may   forms
//                                 reach
//     close discs:  CubeLanes --> draw_wide_disc() of wide_discs-inl.h
//
// Seen through a face, the disc of centre c, normal n and radius r lies around the projected centre
// (u0, v0) = (cu, cv) / cw. The ray p = (1, u0 + du, v0 + dv) meets the disc's plane n . x = h,
// h = c . n, at t = cw / w, where
//
//     w = 1 + alpha du + beta dv,    alpha = nu cw / h,    beta = nv cw / h.
//
// With p0 = (1, u0, v0) and L^2 = p0 . p0, the distance from the centre there is
//
//     |t p - c|^2 = (cw / w)^2 F(du, dv),
//     F = L^2 (w - 1)^2 - 2 (w - 1)(u0 du + v0 dv) + du^2 + dv^2
//       = aa du^2 + 2 ab du dv + bb dv^2,
//     aa = 1 + alpha (alpha L^2 - 2 u0),    bb = 1 + beta (beta L^2 - 2 v0),
//     ab = alpha (beta L^2 - v0) - beta u0,
//
// so that a pixel costs no division:
//
//     inside    F < (r / cw)^2 w^2
//     nearness  1 / t = w / cw, less kBump F / (r L) for the paraboloid of canvas-inl.h
//
// The bounds of the disc along u are the planes through the viewpoint and the v axis that touch it.
// The plane of u has the normal k = (-u, 1, 0) in (w, u, v), and touches the disc where
//
//     (c . k)^2 = r^2 (|k|^2 - (n . k)^2),
//
// a quadratic in u, with p = r^2 (1 - nw^2) - cw^2 and q = cu cw + r^2 nu nw:
//
//     u = (q -+ r sqrt(s)) / -p,    s = cw^2 + cu^2 - (cw nu - cu nw)^2 - r^2 nv^2.
//
// p is below 0 where the whole disc is in front of the viewpoint; elsewhere the bound is the face.
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

constexpr float kSlack = 1e-3F;  // pixels by which bounds are widened for rounding
constexpr int kChunk = 64;       // discs that are sorted by face at once

/// A vector of discs on their faces, set up for their pixels. The names are those of the equations
/// above.
struct FaceDiscs {
  alignas(64) float u0[kLanes], v0[kLanes];
  float aa[kLanes], ab2[kLanes], bb[kLanes];  ///< aa, 2 ab, bb
  float alpha[kLanes], beta[kLanes];
  float square[kLanes];   ///< (radius / cw)^2
  float inverse[kLanes];  ///< 1 / cw
  float bump[kLanes];     ///< nearness lost for each unit of F
  std::int32_t x0[kLanes], x1[kLanes], y0[kLanes], y1[kLanes];  ///< columns and rows, x1 and y1 not
                                                                ///< included
  std::int32_t first[kLanes];  ///< index of the first pixel of the face
};

/// One of these discs, spread over the lanes that draw its pixels.
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

  /// Draws the disc on a vector of pixels of one row.
  /// @param u, v  of the pixels
  /// @param at    index of the first one
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

/// Draws a disc that reaches into one vector of each of at most kRows rows. Rows that it does not
/// reach are drawn as well, without a branch; past the end of the face, centres are NaN and nothing
/// is inside.
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

/// Draws a disc of any size, row by row.
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

/// A vector of discs in the axes of the cube.
struct CubeLanes {
  VF c[3], n[3];  ///< centre and normal
  VF radius, radius2;
  VF height;  ///< c . n
};

/// A vector of discs, each in the axes of its face.
struct FaceLanes {
  VF cw, cu, cv, nw, nu, nv;
  VF radius, radius2;
};

/// Discs in the axes of the faces that may see them, in columns.
struct FaceQueue {
  static constexpr int kCapacity = 3 * kChunk + kLanes;  // a disc may be seen by three faces
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

/// Loads a vector of discs and turns them into the axes of the cube.
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

/// Draws the discs of a mask one after another as wide discs.
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

/// The pixels that a vector of discs may cover.
struct FaceBounds {
  hn::VFromD<I> x0, x1, y0, y1;  ///< columns and rows; x1 and y1 are not included
  MF seen;                       ///< discs that may cover a pixel at all

  /// Returns the discs of at most that many rows whose columns fit one vector.
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

/// Bounds a vector of discs on their faces.
/// @param first_row, end_row  rows that matter, for each disc
HWY_INLINE FaceBounds bounds_of(const FaceLanes& d, int resolution, hn::VFromD<I> first_row,
                                hn::VFromD<I> end_row) {
  // Find p, which both axes share. Where the disc reaches the plane of the viewpoint, the bound is
  // the whole face.
  const F f;
  const I i;
  const auto zero = hn::Zero(f), one = hn::Set(f, 1.0F);
  const auto ew2 = hn::Mul(d.radius2, hn::Max(zero, hn::NegMulAdd(d.nw, d.nw, one)));
  const auto p = hn::NegMulAdd(d.cw, d.cw, ew2);
  const auto whole = hn::Ge(p, hn::Mul(hn::Set(f, -1e-4F), d.radius2));
  const auto per_p = hn::Div(hn::Set(f, -1.0F), p);
  const float edge = static_cast<float>(resolution);
  const auto scale = hn::Set(f, 0.5F * edge);
  const auto pixel = [&](VF at, float slack) {
    return hn::Min(hn::Max(hn::MulAdd(at, scale, hn::Set(f, 0.5F * edge + slack)), zero),
                   hn::Set(f, edge));
  };
  // Bound one axis by the pixels whose centres lie within middle -+ half.
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
  // Begin at a multiple of a vector where that takes no more vectors.
  const int lanes = static_cast<int>(hn::Lanes(i));
  const auto aligned = hn::And(b.x0, hn::Set(i, -lanes));
  b.x0 = hn::IfThenElse(hn::Lt(hn::Sub(b.x1, aligned), hn::Set(i, lanes + 1)), aligned, b.x0);
  return b;
}

/// Stores the forms that say which pixels the discs cover, and how near.
/// @param per_height  1 / h
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

/// Appends discs to the faces that may see them. On each axis that is at most the face on the side
/// of the disc's centre: the disc is farther away than two radii, so it is seen within 30 degrees
/// of its centre, while every direction of a face is at least 35.3 degrees from the plane through
/// the viewpoint that is parallel to it.
HWY_INLINE void add_to_faces(const CubeLanes& discs, MF mask, VU colour, FaceQueue& out) {
  const F f;
  const I i;
  const U u32;
  for (int axis = 0; axis < 3; ++axis) {
    // Find the discs whose bounding spheres reach the pyramid of the face.
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto cw = hn::Abs(discs.c[axis]),
               far = hn::Add(cw, discs.radius);  // nothing of the disc is farther along the axis
    const auto reaches = [&](VF c) { return hn::Lt(hn::Sub(hn::Abs(c), discs.radius), far); };
    const auto seen = hn::And(mask, hn::And(reaches(discs.c[u]), reaches(discs.c[v])));
    // Append them in the axes of the face; that at -w has its axis w reversed.
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

/// Returns the discs within three radii whose centres lie close to the plane through the viewpoint
/// that is parallel to a face. Set up for that face, cw would be next to nothing, and the forms
/// would lose their digits in divisions by it.
HWY_INLINE MF across_faces(const CubeLanes& discs, VF distance2) {
  const F f;
  const auto beside =
      hn::Min(hn::Abs(discs.c[0]), hn::Min(hn::Abs(discs.c[1]), hn::Abs(discs.c[2])));
  return hn::And(hn::Lt(beside, hn::Mul(hn::Set(f, 0.05F), discs.radius)),
                 hn::Lt(distance2, hn::Mul(hn::Set(f, 9.0F), discs.radius2)));
}

/// Draws the discs of a queue, a vector of discs at a time.
template <class CanvasType>
HWY_INLINE void draw_queue(const CanvasType& canvas, const FaceRows& rows, const FaceQueue& queue) {
  const F f;
  const I i;
  const CubeGeometry& cube = canvas.cube;
  FaceDiscs set;
  for (std::size_t begin = 0; begin < queue.size; begin += hn::Lanes(f)) {
    // Load the discs, and find the pixels that they may cover.
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
    // Set up their forms.
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
    // Draw them sorted by size: a branch on the number of rows of each disc cannot be predicted,
    // and a mispredicted one costs as much as two rows.
    const auto two = hn::And(mask, bounds.within(2)),
               four = hn::AndNot(two, hn::And(mask, bounds.within(4)));
    for_each(two, [&](std::size_t k, std::uint32_t c) { draw_narrow<2>(canvas, set, k, c); });
    for_each(four, [&](std::size_t k, std::uint32_t c) { draw_narrow<4>(canvas, set, k, c); });
    for_each(hn::AndNot(hn::Or(two, four), mask),
             [&](std::size_t k, std::uint32_t c) { draw_broad(canvas, set, k, c); });
  }
}

/// Draws all discs, sorting kChunk of them by face at a time.
template <class CanvasType>
void draw_all(const CanvasType& canvas, const FaceRows& rows, const DiscQueue& discs, Sides sides) {
  const F f;
  const U u;
  const auto lanes = static_cast<int>(hn::Lanes(f));
  FaceQueue queue;
  for (int chunk = 0; chunk < discs.size; chunk += kChunk) {
    queue.size = 0;
    for (int begin = chunk; begin < std::min(discs.size, chunk + kChunk); begin += lanes) {
      // Cull discs without extent, and backs that are clear: all of them, or those within two
      // radii.
      const CubeLanes d = load_discs(canvas.cube, discs, begin);
      const auto back = hn::Ge(d.height, hn::Zero(f));
      const auto distance2 = dot(d.c, d.c);
      const auto close = hn::Lt(distance2, hn::Mul(hn::Set(f, 4.0F), d.radius2));
      auto drawn = hn::And(hn::FirstN(f, static_cast<std::size_t>(discs.size - begin)),
                           hn::Gt(d.radius, hn::Zero(f)));
      drawn = hn::AndNot(sides == Sides::front ? back : hn::And(back, close), drawn);
      // Make backs black.
      const auto colour =
          hn::IfThenZeroElse(hn::RebindMask(u, back), hn::LoadU(u, discs.rgbe + begin));
      // Draw close discs at once, and queue the others for their faces.
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
