// Sums over the pixels of a face of a direction buffer (direction_kernels.h).
#include <algorithm>
#include <cmath>

#include "engine/shade/direction_kernels.h"

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/sum_face.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

constexpr int kSumLanes = 16;  // more than for discs, which are narrow
using W = hn::CappedTag<float, kSumLanes>;
using WI = hn::RebindToSigned<W>;
using WU = hn::RebindToUnsigned<W>;

constexpr int kMostResolution = 64;
constexpr float kMostShift = 4;  // pixels: beyond it the first order says nothing

/// Weights that pass over the edges of a row's pixels.
struct Passed {
  alignas(64) float right[1 + kMostResolution + kSumLanes] = {};  // from pixel x - 1 to x
  float down[kMostResolution] = {};                               // from the row above
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
  hn::VFromD<W> total, covered, light[3], sky[3], open_w, open_u, open_v;
};

/// A face and the receiver's normal and places in its axes.
struct FaceView {
  const CubeGeometry& cube;
  const FacePixels& pixels;
  const float* sky;
  const FaceOffsets* offsets;
  float nw, nu, nv;

  /// Cosine to a row of directions (1, u, v), without what u adds.
  [[nodiscard]] float cosine(float v) const { return nw + nv * v; }
  [[nodiscard]] bool sees(int y) const { return y < cube.resolution && cosine(cube.centre[y]) + std::abs(nu) > 0; }
  HWY_INLINE hn::VFromD<W> cosine(hn::VFromD<W> u, float row) const {
    const W f;
    return hn::Max(hn::Zero(f), hn::MulAdd(hn::Set(f, nu), u, hn::Set(f, row)));
  }
};

/// Lets the nearer of two neighbours in a row, and of row y and the next, take over weight.
HWY_INLINE void pass_weights(const FaceView& face, int y, Passed& passed, float* HWY_RESTRICT down) {
  const W f;
  const CubeGeometry& cube = face.cube;
  const float half_resolution = 0.5F * static_cast<float>(cube.resolution);
  const float half_step = 1 / static_cast<float>(cube.resolution);
  const float row = face.cosine(cube.centre[y]), edge = cube.centre[y] + half_step;
  const bool next_row = face.sees(y + 1);
  for (int x = 0; x < cube.resolution; x += static_cast<int>(hn::Lanes(f))) {
    const std::ptrdiff_t at = std::ptrdiff_t{y} * cube.resolution + x;
    const float* here = face.pixels.nearness + at;
    const auto near = hn::LoadU(f, here), pu = hn::LoadU(f, cube.centre + x);
    const auto u = hn::Add(pu, hn::Set(f, half_step));
    const auto along = shift_of(near, hn::LoadU(f, here + 1), u, face.offsets->w, face.offsets->u, half_resolution);
    hn::StoreU(hn::Mul(along, hn::Mul(face.cosine(u, row), hn::LoadU(f, cube.edge_u + at))), f, passed.right + 1 + x);
    if (!next_row) continue;
    const auto across = shift_of(near, hn::LoadU(f, here + cube.resolution), hn::Set(f, edge), face.offsets->w,
                                 face.offsets->v, half_resolution);
    hn::StoreU(hn::Mul(across, hn::Mul(face.cosine(pu, face.cosine(edge)), hn::LoadU(f, cube.edge_v + at))), f, down + x);
  }
  if (!next_row) std::fill_n(down, cube.resolution, 0.0F);
}

/// Adds up a row.
/// @param down  weights that pass to the next row
HWY_INLINE void add_row(const FaceView& face, int y, const Passed& passed, const float* HWY_RESTRICT down, LaneSums& sums) {
  const W f;
  const auto zero = hn::Zero(f);
  const CubeGeometry& cube = face.cube;
  const std::size_t plane = static_cast<std::size_t>(cube.resolution) * static_cast<std::size_t>(cube.resolution);
  const float row = face.cosine(cube.centre[y]);
  auto row_open = zero;
  for (int x = 0; x < cube.resolution; x += static_cast<int>(hn::Lanes(f))) {
    const auto at = static_cast<std::size_t>(y * cube.resolution + x);
    const auto pu = hn::LoadU(f, cube.centre + x);
    const auto own = hn::Mul(face.cosine(pu, row), hn::LoadU(f, cube.weight + at));
    const auto right = hn::Sub(hn::LoadU(f, passed.right + 1 + x), hn::LoadU(f, passed.right + x));
    const auto weight = hn::Add(own, hn::Add(right, hn::Sub(hn::LoadU(f, down + x), hn::LoadU(f, passed.down + x))));
    const auto empty = hn::Eq(hn::LoadU(f, face.pixels.nearness + at), zero);
    const auto covered = hn::IfThenZeroElse(empty, weight);
    sums.total = hn::Add(sums.total, own);
    sums.covered = hn::Add(sums.covered, covered);
    const UnpackedRgbe<W> rgbe = unpack_rgbe(f, hn::LoadU(WU(), face.pixels.rgbe + at));
    const auto scale = hn::Mul(rgbe.scale, covered);
    for (int k = 0; k < 3; ++k) sums.light[k] = hn::MulAdd(rgbe.byte[k], scale, sums.light[k]);
    for (std::size_t k = 0; face.sky && k < 3; ++k) {
      sums.sky[k] = hn::MulAdd(hn::Sub(weight, covered), hn::LoadU(f, face.sky + k * plane + at), sums.sky[k]);
    }
    const auto direction = hn::IfThenElseZero(empty, hn::Mul(own, hn::LoadU(f, cube.inverse_length + at)));
    sums.open_w = hn::Add(sums.open_w, direction);
    row_open = hn::Add(row_open, direction);
    sums.open_u = hn::MulAdd(direction, pu, sums.open_u);
  }
  sums.open_v = hn::MulAdd(row_open, hn::Set(f, cube.centre[y]), sums.open_v);
}

/// Sums in which nothing, or what moves, passes weights over edges.
HWY_INLINE void sum_rows(const FaceView& face, FaceSums& sums) {
  const W f;
  const auto zero = hn::Zero(f);
  LaneSums lane{zero, zero, {zero, zero, zero}, {zero, zero, zero}, zero, zero, zero};
  Passed passed;
  alignas(64) float down[kMostResolution] = {};
  for (int y = 0; y < face.cube.resolution; ++y) {
    if (!face.sees(y)) continue;
    if (face.offsets) pass_weights(face, y, passed, down);
    add_row(face, y, passed, down, lane);
    std::copy_n(down, face.cube.resolution, passed.down);
  }
  const auto add = [&](float& sum, auto lanes_sum) { sum += hn::GetLane(hn::SumOfLanes(f, lanes_sum)); };
  add(sums.total, lane.total);
  add(sums.covered, lane.covered);
  for (std::size_t k = 0; k < 3; ++k) {
    add(sums.light[k], lane.light[k]);
    add(sums.sky[k], lane.sky[k]);
  }
  add(sums.open[0], lane.open_w);
  add(sums.open[1], lane.open_u);
  add(sums.open[2], lane.open_v);
}

}  // namespace

void sum_face(const CubeGeometry& cube, const FacePixels& pixels, const float* sky, float nw, float nu, float nv,
              const FaceOffsets* offsets, FaceSums& sums) {
  sum_rows({cube, pixels, sky, offsets, nw, nu, nv}, sums);
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(sum_face);

void sum_face(const CubeGeometry& cube, const FacePixels& pixels, const float* sky, float nw, float nu, float nv,
              const FaceOffsets* offsets, FaceSums& sums) {
  HWY_DYNAMIC_DISPATCH(sum_face)(cube, pixels, sky, nw, nu, nv, offsets, sums);
}

}  // namespace ptc
#endif
