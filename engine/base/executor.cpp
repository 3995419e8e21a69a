#include "engine/base/executor.h"

#include <algorithm>
#include <stdexcept>

namespace ptc {

void Executor::for_ranges(
    std::size_t count, std::size_t grain,
    const std::function<void(std::size_t begin, std::size_t end)>& body) const {
  if (grain == 0) throw std::invalid_argument("Executor::for_ranges: grain is 0");
  const std::size_t pieces = count / grain + (count % grain != 0);
  for_each(pieces, [&](std::size_t piece, unsigned) {
    const std::size_t begin = piece * grain;
    body(begin, begin + std::min(grain, count - begin));
  });
}

}  // namespace ptc
