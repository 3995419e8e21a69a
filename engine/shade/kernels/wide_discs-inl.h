// Discs that are close to the viewpoint and may fill the view. The file is included by a file that
// is compiled once for each instruction set, so it is guarded once for each instruction set.
//
// The form of draw_discs.cpp is relative to the projected centre of a disc, which lies behind the
// viewpoint or at infinity for such discs. Here everything is relative to the viewpoint. With p =
// (1, u, v) the ray of a pixel, c the centre, n the normal, r the radius and h = c . n:
//
//     t = h / (n . p)                             where the ray meets the plane of the disc
//     |t p - c|^2 < r^2                           inside the disc
//     h^2 p.p - 2 h (n.p)(c.p) + d (n.p)^2 < 0    times (n.p)^2, with d = c.c - r^2
//
// For one row of pixels v is constant and the last line is a quadratic a u^2 + 2 b u + c < 0:
//
//     slope = nw + nv v                           n . p = slope + nu u
//     ahead = cw + cv v                           c . p = ahead + cu u
//     a = h^2 - 2 h nu cu + nu^2 d
//     b = d nu slope - h (cu slope + nu ahead)
//     c = h^2 (1 + v^2) - 2 h slope ahead + d slope^2
//
// Its roots bound the columns of the row. Where a is not above 0 the disc crosses the row's horizon
// and the whole row is looked at. Each pixel then repeats the test exactly, with t > 0.
#if defined(PTC_SHADE_WIDE_DISCS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef PTC_SHADE_WIDE_DISCS_INL_H
#undef PTC_SHADE_WIDE_DISCS_INL_H
#else
#define PTC_SHADE_WIDE_DISCS_INL_H
#endif

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <hwy/highway.h>

#include "engine/shade/kernels/canvas-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

/// Pixels by which the bounds of a disc are widened for rounding; its squares cancel each other.
constexpr float kWideSlack = 0.05F;

/// The columns of each row that a disc may cover.
struct Spans {
  alignas(64) std::int32_t first[kMaxResolution + kLanes];  ///< first column of each row
  std::int32_t end[kMaxResolution + kLanes];                ///< one past its last column
};

/// A disc in the axes of a face.
struct WideDisc {
  float cw, cu, cv, nw, nu, nv;  ///< centre, and unit normal
  float radius, height;          ///< height is c . n

  /// Finds the columns of some rows that the disc may cover, a vector of rows at a time.
  HWY_INLINE void find_spans(const CubeGeometry& cube, int first_row, int end_row,
                             Spans& spans) const {
    const F f;
    const I i;
    const auto set = [&](float value) { return hn::Set(f, value); };
    const float edge = static_cast<float>(cube.resolution);
    const float d = cw * cw + cu * cu + cv * cv - radius * radius;
    const float a = height * height - 2 * height * nu * cu + nu * nu * d;
    const bool bounded = a > 1e-6F * radius * radius;
    const auto half = set(0.5F * edge);
    const auto pixel = [&](VF u) {
      return hn::Min(hn::Max(hn::MulAdd(u, half, half), hn::Zero(f)), set(edge));
    };
    for (int y = first_row; y < end_row; y += static_cast<int>(hn::Lanes(f))) {
      auto first = hn::Zero(i), end = hn::Set(i, cube.resolution);
      if (bounded) {
        const auto v = hn::LoadU(f, cube.centre + y);
        const auto slope = hn::MulAdd(set(nv), v, set(nw)), ahead = hn::MulAdd(set(cv), v, set(cw));
        // Compute half of the linear term, and the constant term.
        const auto b =
            hn::MulSub(set(nu * d), slope,
                       hn::Mul(set(height), hn::MulAdd(set(cu), slope, hn::Mul(set(nu), ahead))));
        const auto square_v = hn::MulAdd(hn::Mul(v, v), set(height * height), set(height * height));
        const auto c =
            hn::MulAdd(slope, hn::MulSub(set(d), slope, hn::Mul(set(2 * height), ahead)), square_v);
        // Solve for u, and turn the roots into columns; without roots the row is empty.
        const auto square = hn::MulSub(b, b, hn::Mul(set(a), c));
        const auto root = hn::Sqrt(hn::Max(square, hn::Zero(f))), per_a = set(1 / a);
        const auto low = pixel(hn::Mul(hn::Neg(hn::Add(b, root)), per_a)),
                   high = pixel(hn::Mul(hn::Sub(root, b), per_a));
        first = hn::ConvertTo(i, hn::Max(hn::Sub(low, set(0.5F + kWideSlack)), hn::Zero(f)));
        end = hn::ConvertTo(i, hn::Min(hn::Add(high, set(0.5F + kWideSlack)), set(edge)));
        end = hn::IfThenElseZero(hn::RebindMask(i, hn::Gt(square, hn::Zero(f))), end);
      }
      hn::StoreU(first, i, spans.first + y);
      hn::StoreU(end, i, spans.end + y);
    }
  }
};

/// Covers the pixels of a row that see a disc.
/// @param y           row of the face, for its v
/// @param row         index of the row's first pixel
/// @param first, end  columns of the row
template <class CanvasType>
HWY_INLINE void draw_wide_row(const CanvasType& canvas, const WideDisc& disc, int y, int row,
                              int first, int end, VU colour) {
  const F f;
  const CubeGeometry& cube = canvas.cube;
  const auto lanes = static_cast<int>(hn::Lanes(f));
  const float v = cube.centre[y];
  const auto row_slope = hn::Set(f, disc.nw + disc.nv * v),
             per_height = hn::Set(f, 1 / disc.height);
  const auto square = hn::Set(f, disc.radius * disc.radius), bump = hn::Set(f, kBump / disc.radius);
  for (int x = first & -lanes; x < end; x += lanes) {
    // Find where the rays meet the disc's plane, and how far from the centre.
    const auto u = hn::LoadU(f, cube.centre + x);
    const auto plane = hn::Mul(hn::MulAdd(hn::Set(f, disc.nu), u, row_slope),
                               per_height);           // nearness of the plane
    const auto t = hn::Div(hn::Set(f, 1.0F), plane);  // infinite, negative or NaN for a miss
    const auto du = hn::MulSub(u, t, hn::Set(f, disc.cu));
    const auto dv = hn::MulSub(hn::Set(f, v), t, hn::Set(f, disc.cv));
    const auto dw = hn::Sub(t, hn::Set(f, disc.cw));
    const auto off = hn::MulAdd(du, du, hn::MulAdd(dv, dv, hn::Mul(dw, dw)));
    const auto inside = hn::And(hn::Gt(t, hn::Zero(f)), hn::Lt(off, square));
    // Add the depth of the paraboloid there, a length, as a share of the ray.
    const auto lost =
        hn::Mul(hn::Mul(bump, off), hn::LoadU(f, cube.inverse_length + y * cube.resolution + x));
    // Divide exactly. To first order the nearness is 1 / t - lost / t^2, which so close to the
    // plane, where t < lost, would be behind the receiver.
    canvas.cover(row + x, hn::Div(hn::Set(f, 1.0F), hn::Add(t, lost)), inside, colour);
  }
}

/// Draws a disc on every face that it may reach; one within two radii of the viewpoint may fill the
/// view.
/// @param c, n  centre and normal in the axes of the cube
template <class CanvasType>
void draw_wide_disc(const CanvasType& canvas, const FaceRows& rows, const float (&c)[3],
                    const float (&n)[3], float radius, std::uint32_t rgbe) {
  const CubeGeometry& cube = canvas.cube;
  const auto colour = hn::Set(U(), rgbe);
  Spans spans;
  for (int face = 0; face < 6; ++face) {
    const CubeFace a(face);
    // Skip the face when the whole disc lies behind its plane through the viewpoint.
    const float reach = c[a.w] * a.sign + radius * std::sqrt(std::max(0.0F, 1 - n[a.w] * n[a.w]));
    if (reach <= 0) continue;
    const WideDisc disc{.cw = c[a.w] * a.sign,
                        .cu = c[a.u],
                        .cv = c[a.v],
                        .nw = n[a.w] * a.sign,
                        .nu = n[a.u],
                        .nv = n[a.v],
                        .radius = radius,
                        .height = c[0] * n[0] + c[1] * n[1] + c[2] * n[2]};
    disc.find_spans(cube, rows.first[face], rows.end[face], spans);
    for (int y = rows.first[face]; y < rows.end[face]; ++y) {
      draw_wide_row(canvas, disc, y, (face * cube.resolution + y) * cube.resolution, spans.first[y],
                    spans.end[y], colour);
    }
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
