// Keys to coordinates, many at once; compiled once per instruction set.
#include <algorithm>
#include <array>

#include "format/point_record.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "format/decode_positions.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

void decode_all(std::span<const PointRecord> points, PositionBlock& out) {
  std::array<std::uint64_t, kPositionBlock> high, low;
  for (std::size_t i = 0; i < points.size(); ++i) {
    high[i] = points[i].key.high;
    low[i] = points[i].key.low;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      out[axis][i] = detail::coordinate(high[i], low[i], axis);
    }
  }
}

}  // namespace
}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(decode_all);

void decode_positions(std::span<const PointRecord> points, PositionBlock& out) noexcept {
  HWY_DYNAMIC_DISPATCH(decode_all)(points, out);
}

}  // namespace ptc
#endif
