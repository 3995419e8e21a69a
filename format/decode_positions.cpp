// Keys to coordinates, many at once.
#include <algorithm>
#include <array>

#include "format/point_record.h"

namespace ptc {

void decode_positions(std::span<const PointRecord> points, PositionBlock& out,
                      InstructionSet set) noexcept {
  with_instructions(set, [&] {
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
  });
}

}  // namespace ptc
