// Sums over the pixels of a direction buffer, corrected for parallax to first order.
//
// The weight of a pixel is its exact solid angle times the cosine to the normal n, 0 below the
// horizon. Cells of receivers draw what is far as their centre sees it, so a receiver at the offset
// o from the centre sees it displaced. In the axes of a face, a point at t (1, u, v) moves by
//
//     (u o_w - o_u, v o_w - o_v) / t
//
// on the plane w = 1. To first order only the borders between pixels matter: each moves as the
// nearer of its two pixels does, since that one hides the other, and the weight that the border
// sweeps passes from the pixel that shrinks to the one that grows:
//
//          a          b                 a            b
//     +---------+---------+        +-----------+-------+     shift, in pixels, at most 4
//     |  near   |   far   |  --->  |  near     |  far  |     weight(a) += shift * weight of border
//     +---------+---------+        +-----------+-------+     weight(b) -= shift * weight of border
//               |--> shift                     |
//
// This is the derivative of visibility, which is all at edges (Ward and Heckbert 1992 take it from
// strata of rays, Li et al. 2018 from sampled edges). A border between two pixels that are covered
// alike changes nothing, because what one loses the other gains.
//
// A row is summed a vector of pixels at a time. What passes to the right stays in registers, and
// what passes down is kept in an array of one row:
//
//     row y      [ px ][ px ][ px ]      right: from lane to lane, `carried` from vector to vector
//                   |     |     |        below: `down`, written in row y and read in row y + 1
//     row y + 1  [ px ][ px ][ px ]
//
// The sum of all weights and the bent normal are not corrected.
#include <cmath>

#include "engine/shade/kernels/direction_kernels.h"

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/kernels/sum_pixels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/kernels/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

using W = hn::CappedTag<float, 16>;
using WI = hn::RebindToSigned<W>;
using WU = hn::RebindToUnsigned<W>;
using VW = hn::VFromD<W>;

constexpr float kMaxShift = 4;  // pixels; beyond that the first order says nothing

/// Returns an entry of a table of kViewpoints numbers for each lane.
HWY_INLINE VW look_up(const float* table, hn::VFromD<WI> index) {
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

/// PixelSums, one in each lane, with directions in the axes of a face.
struct LaneSums {
  VW total, covered, light[3], sky[3], open[3];
};

/// A face of the cube: its pixels, and the receiver's normal and offsets in its axes.
struct FaceView {
  const CubeGeometry& cube;
  const float* nearness;
  const std::uint32_t* rgbe;    ///< null without colours
  const float* sky;             ///< 3 planes, or null
  float nw, nu, nv;             ///< the receiver's normal, unit
  const PixelWeights* weights;  ///< null: a hemisphere by its cosine
  alignas(64) float offset_w[kViewpoints], offset_u[kViewpoints], offset_v[kViewpoints];

  /// Returns n . (1, 0, v), the part of n . (1, u, v) that a row of pixels shares.
  [[nodiscard]] float cosine(float v) const { return nw + nv * v; }
  /// Reports whether any direction of a row may lie above the horizon.
  [[nodiscard]] bool sees(int y) const {
    return (weights && weights->sphere) || cosine(cube.centre[y]) + std::abs(nu) > 0;
  }
  /// Returns n . (1, u, v), 0 below the horizon. @param row  cosine(v)
  HWY_INLINE VW cosine(VW u, float row) const {
    const W f;
    return hn::Max(hn::Zero(f), hn::MulAdd(hn::Set(f, nu), u, hn::Set(f, row)));
  }

  /// Returns cosine(), or what PixelWeights put in its place.
  /// @param inverse_length  1 / |(1, u, v)|
  template <bool kShaped>
  HWY_INLINE VW weigh(VW u, float row, VW inverse_length) const {
    const W f;
    if constexpr (kShaped) {
      if (weights->sphere) return hn::Div(hn::Set(f, 1.0F), inverse_length);
      const auto along = cosine(u, row);
      const auto least = hn::Set(f, weights->cone_cos);
      return hn::IfThenElseZero(hn::Ge(hn::Mul(along, inverse_length), least), along);
    } else {
      return cosine(u, row);
    }
  }

  /// Returns the share of a pixel that what covers it covers; 0 where nothing does.
  HWY_INLINE VW share_of(VW near, VW inverse_length) const {
    const W f;
    const auto one = hn::Set(f, 1.0F);
    const auto limit = hn::Set(f, weights->per_distance);
    // 1 - d / distance, where d = |(1, u, v)| / nearness
    const auto left =
        hn::Max(hn::Zero(f), hn::Sub(one, hn::Div(limit, hn::Mul(near, inverse_length))));
    auto share = hn::IfThenElseZero(hn::Gt(left, hn::Zero(f)), one);
    for (unsigned i = 0; i < weights->falloff; ++i) share = hn::Mul(share, left);
    return hn::IfThenZeroElse(hn::Eq(near, hn::Zero(f)), share);
  }

  /// Returns how far the border between two pixels moves towards the second, in pixels: as the
  /// nearer of them does.
  /// @param a, b    nearness of both pixels
  /// @param at      coordinate of the border along the axis
  /// @param offset  of the receiver along the axis, for each viewpoint
  HWY_INLINE VW shift_of(VW a, VW b, VW at, const float* offset) const {
    const W f;
    const WI i;
    const auto near = hn::Max(a, b);
    const auto viewpoint = hn::And(hn::BitCast(i, near), hn::Set(i, kViewpoints - 1));
    const auto move = hn::MulSub(at, look_up(offset_w, viewpoint), look_up(offset, viewpoint));
    const auto pixels =
        hn::Mul(hn::Mul(near, move), hn::Set(f, 0.5F * static_cast<float>(cube.resolution)));
    return hn::Max(hn::Min(pixels, hn::Set(f, kMaxShift)), hn::Set(f, -kMaxShift));
  }
};

/// Adds up the light of a group of pixels: the colour of what covers them, and the sky elsewhere.
/// @param at       index of the first pixel in its face
/// @param covered  weight of each covered pixel, else 0
/// @param open     weight of each pixel less the share of it that is covered
HWY_INLINE void add_light(const FaceView& face, std::size_t at, VW covered, VW open,
                          LaneSums& sums) {
  const W f;
  const auto resolution = static_cast<std::size_t>(face.cube.resolution);
  if (face.rgbe) {
    const UnpackedRgbe<W> rgbe = unpack_rgbe(f, hn::LoadU(WU(), face.rgbe + at));
    const auto scale = hn::Mul(rgbe.scale, covered);
    for (int k = 0; k < 3; ++k) sums.light[k] = hn::MulAdd(rgbe.byte[k], scale, sums.light[k]);
  }
  for (std::size_t k = 0; face.sky && k < 3; ++k) {
    const auto sky = hn::LoadU(f, face.sky + k * resolution * resolution + at);
    sums.sky[k] = hn::MulAdd(open, sky, sums.sky[k]);
  }
}

/// Adds up a row of pixels.
/// @tparam kMoves   whether borders move
/// @tparam kShaped  whether there are PixelWeights
/// @param last     whether no further row is above the horizon
/// @param down     weights that pass to this row from the row before; is overwritten with those
///                 that pass to the next row
template <bool kMoves, bool kShaped>
HWY_INLINE void add_row(const FaceView& face, int y, bool last, float* HWY_RESTRICT down,
                        LaneSums& sums) {
  const W f;
  const auto zero = hn::Zero(f);
  const CubeGeometry& cube = face.cube;
  const float row = face.cosine(cube.centre[y]);
  const float half_step = 1 / static_cast<float>(cube.resolution),
              edge = cube.centre[y] + half_step;
  const auto first_lane = hn::FirstN(f, 1);
  const auto one_up =
      hn::IndicesFromVec(f, hn::And(hn::Sub(hn::Iota(WI(), 0), hn::Set(WI(), 1)),
                                    hn::Set(WI(), static_cast<int>(hn::Lanes(f)) - 1)));
  auto carried = zero, row_open = zero;
  for (int x = 0; x < cube.resolution; x += static_cast<int>(hn::Lanes(f))) {
    // Weigh the pixels.
    const auto at = static_cast<std::size_t>(y * cube.resolution + x);
    const float* here = face.nearness + at;
    const auto near = hn::LoadU(f, here), pu = hn::LoadU(f, cube.centre + x);
    const auto inverse_length = hn::LoadU(f, cube.inverse_length + at);
    const auto own =
        hn::Mul(face.weigh<kShaped>(pu, row, inverse_length), hn::LoadU(f, cube.weight + at));
    auto weight = own;
    // Move the borders to the right and to the next row.
    if constexpr (kMoves) {
      const auto u = hn::Add(pu, hn::Set(f, half_step));
      const auto right = hn::Mul(
          face.shift_of(near, hn::LoadU(f, here + 1), u, face.offset_u),
          hn::Mul(face.weigh<kShaped>(u, row, inverse_length), hn::LoadU(f, cube.edge_u + at)));
      const auto turned = hn::TableLookupLanes(right, one_up);
      const auto from_left = hn::IfThenElse(first_lane, carried, turned);
      carried = turned;
      auto below = zero;
      if (!last) {
        below = hn::Mul(face.shift_of(near, hn::LoadU(f, here + cube.resolution), hn::Set(f, edge),
                                      face.offset_v),
                        hn::Mul(face.weigh<kShaped>(pu, face.cosine(edge), inverse_length),
                                hn::LoadU(f, cube.edge_v + at)));
      }
      weight =
          hn::Add(own, hn::Add(hn::Sub(right, from_left), hn::Sub(below, hn::LoadU(f, down + x))));
      hn::StoreU(below, f, down + x);
    }
    // Add up what covers, and the light.
    const auto empty = hn::Eq(near, zero);
    const auto covered = hn::IfThenZeroElse(empty, weight);
    auto hidden = covered;
    auto direction = hn::Mul(own, inverse_length);
    if constexpr (kShaped) {
      const auto share = face.share_of(near, inverse_length);
      hidden = hn::Mul(covered, share);
      direction = hn::NegMulAdd(share, direction, direction);
    } else {
      direction = hn::IfThenElseZero(empty, direction);
    }
    sums.total = hn::Add(sums.total, own);
    sums.covered = hn::Add(sums.covered, hidden);
    add_light(face, at, covered, hn::Sub(weight, hidden), sums);
    // Add up the uncovered directions; what a row shares is multiplied once, at its end.
    row_open = hn::Add(row_open, direction);
    sums.open[1] = hn::MulAdd(direction, pu, sums.open[1]);
  }
  sums.open[0] = hn::Add(sums.open[0], row_open);
  sums.open[2] = hn::MulAdd(row_open, hn::Set(f, cube.centre[y]), sums.open[2]);
}

/// Adds up the rows of a face that are above the horizon.
template <bool kMoves, bool kShaped>
HWY_INLINE void add_face(const FaceView& face, LaneSums& sums) {
  alignas(64) float down[kMaxResolution] = {};
  int y = 0, end = face.cube.resolution;
  while (y < end && !face.sees(y)) ++y;
  while (y < end && !face.sees(end - 1)) --end;
  for (; y < end; ++y) add_row<kMoves, kShaped>(face, y, y + 1 == end, down, sums);
}

}  // namespace

void sum_pixels(const CubeGeometry& cube, const PixelView& pixels, const float* sky,
                const glm::vec3& normal, const ViewOffsets* offsets, const PixelWeights* weights,
                PixelSums& sums) {
  const W f;
  const auto zero = hn::Zero(f);
  LaneSums lane{zero, zero, {zero, zero, zero}, {zero, zero, zero}, {zero, zero, zero}};
  VW open[3] = {zero, zero, zero};
  const std::size_t plane =
      static_cast<std::size_t>(cube.resolution) * static_cast<std::size_t>(cube.resolution);
  // Add up each face in its own axes, and turn its directions into those of the cube.
  for (int i = 0; i < 6; ++i) {
    const CubeFace axes(i);
    FaceView face{.cube = cube,
                  .nearness = pixels.nearness + static_cast<std::size_t>(i) * plane,
                  .rgbe = pixels.rgbe ? pixels.rgbe + static_cast<std::size_t>(i) * plane : nullptr,
                  .sky = sky ? sky + static_cast<std::size_t>(3 * i) * plane : nullptr,
                  .nw = axes.sign * normal[axes.w],
                  .nu = normal[axes.u],
                  .nv = normal[axes.v],
                  .weights = weights};
    if (!(weights && weights->sphere) && face.nw + std::abs(face.nu) + std::abs(face.nv) <= 0)
      continue;
    for (auto& sum : lane.open) sum = zero;
    if (offsets) {
      for (std::size_t k = 0; k < kViewpoints; ++k) {
        face.offset_w[k] = axes.sign * offsets->axis[axes.w][k];
        face.offset_u[k] = offsets->axis[axes.u][k];
        face.offset_v[k] = offsets->axis[axes.v][k];
      }
      weights ? add_face<true, true>(face, lane) : add_face<true, false>(face, lane);
    } else {
      weights ? add_face<false, true>(face, lane) : add_face<false, false>(face, lane);
    }
    open[axes.w] = hn::MulAdd(hn::Set(f, axes.sign), lane.open[0], open[axes.w]);
    open[axes.u] = hn::Add(open[axes.u], lane.open[1]);
    open[axes.v] = hn::Add(open[axes.v], lane.open[2]);
  }
  // Add up the lanes.
  const auto total = [&](VW lanes) { return hn::GetLane(hn::SumOfLanes(f, lanes)); };
  sums.total = total(lane.total);
  sums.covered = total(lane.covered);
  for (int k = 0; k < 3; ++k) {
    sums.light[k] = total(lane.light[k]);
    sums.sky[k] = total(lane.sky[k]);
    sums.open[k] = total(open[k]);
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(sum_pixels);

void sum_pixels(const CubeGeometry& cube, const PixelView& pixels, const float* sky,
                const glm::vec3& normal, const ViewOffsets* offsets, const PixelWeights* weights,
                PixelSums& sums) {
  HWY_DYNAMIC_DISPATCH(sum_pixels)(cube, pixels, sky, normal, offsets, weights, sums);
}

}  // namespace ptc
#endif
