// Decodes keys into coordinates, many at once. The loops are plain, so that the compiler makes
// vectors of them (format/instruction_sets.h).
#include <algorithm>
#include <array>

#include "format/point_record.h"

namespace ptc {

void decode_positions(std::span<const PointRecord> points, PositionBlock& out,
                      InstructionSet set) noexcept {
  with_instructions(set, [&] {
    // Copy the keys out of the records first, so that the loops below read contiguous numbers.
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
