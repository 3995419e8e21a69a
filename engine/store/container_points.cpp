#include "engine/store/container_points.h"

#include "format/error.h"

namespace ptc {

std::size_t ContainerPoints::next(std::span<PointRecord> out) {
  std::size_t filled = 0;
  while (filled < out.size()) {
    if (at_ == scan_.count() && !open_page()) break;
    const PointPage points = scan_.points();
    while (at_ < points.size() && filled < out.size()) out[filled++] = points[at_++];
    last_ = out[filled - 1].key;
  }
  return filled;
}

void ContainerPoints::skip(std::uint64_t points) {
  const std::uint64_t left = scan_.skip_points(points);
  if (left > 0 && open_page()) at_ = static_cast<std::uint32_t>(left);
}

bool ContainerPoints::open_page() {
  if (!scan_.next()) return false;
  at_ = 0;
  if (scan_.points()[0].key < last_) refuse_order();
  return true;
}

// The reader has checked the order within each page. What is built from the stream also relies on
// the order of the pages.
void ContainerPoints::refuse_order() const {
  const std::uint32_t page = container_.point_pages()[scan_.index()];
  throw FormatError(kPageHeaderBytes, "spec/points.md#point-order",
                    "the first point precedes the one before")
      .rebased(container_.entry(page).offset, container_.path().string())
      .in_page(page);
}

}  // namespace ptc
