// Loops over streams of points.
#include "engine/sort/point_streams.h"

#include <algorithm>
#include <vector>

namespace ptc {

std::size_t read_full(PointStream& points, std::span<PointRecord> block) {
  std::size_t filled = 0;
  while (filled < block.size()) {
    const std::size_t count = points.next(block.subspan(filled));
    if (count == 0) break;
    filled += count;
  }
  return filled;
}

void pass_over(PointStream& points, std::uint64_t count) {
  constexpr std::uint64_t kPassed = 1 << 14;  // records that are passed over at once
  std::vector<PointRecord> passed(
      static_cast<std::size_t>(std::min<std::uint64_t>(count, kPassed)));
  while (count > 0) {
    const auto most = static_cast<std::size_t>(std::min<std::uint64_t>(count, passed.size()));
    const std::size_t now = points.next(std::span(passed).first(most));
    if (now == 0) return;
    count -= now;
  }
}

}  // namespace ptc
