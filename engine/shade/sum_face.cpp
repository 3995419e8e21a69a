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
HWY_INLINE void add_row(const CubeGeometry& cube, const FacePixels& pixels, const float* sky, int y, float cosine_row,
                        float nu, Row& out, LaneSums& sums) {
  const W f;
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
    const UnpackedRgbe<W> rgbe = unpack_rgbe(f, hn::LoadU(WU(), pixels.rgbe + at));
    const auto scale = hn::IfThenZeroElse(empty, rgbe.scale);
    const auto put = [&](int k, hn::VFromD<W> value) {
      hn::StoreU(value, f, out.value[k] + x);
      sums.value[k] = hn::MulAdd(value, weight, sums.value[k]);
    };
    put(0, hn::IfThenZeroElse(empty, hn::Set(f, 1.0F)));
    for (int k = 0; k < 3; ++k) put(1 + k, hn::Mul(rgbe.byte[k], scale));
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
HWY_INLINE void sum_rows(const CubeGeometry& cube, const FacePixels& pixels, const float* sky, float nw, float nu,
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

void sum_face(const CubeGeometry& cube, const FacePixels& pixels, const float* sky, float nw, float nu, float nv,
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

HWY_EXPORT(sum_face);

void sum_face(const CubeGeometry& cube, const FacePixels& pixels, const float* sky, float nw, float nu, float nv,
              const FaceOffsets* offsets, FaceSums& sums) {
  HWY_DYNAMIC_DISPATCH(sum_face)(cube, pixels, sky, nw, nu, nv, offsets, sums);
}

}  // namespace ptc
#endif
