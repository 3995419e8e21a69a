// Point pages one after another.
#include "engine/build/container_points.h"

#include "format/point_page.h"

namespace ptc {

ContainerPoints::ContainerPoints(const ContainerReader& container)
    : container_(container), payload_(container.page_payload_limit()) {}

std::size_t ContainerPoints::next(std::span<PointRecord> out) {
  std::size_t filled = 0;
  while (filled < out.size()) {
    if (at_ == count_) {
      const auto pages = container_.point_pages();
      if (next_page_ == pages.size()) break;
      count_ = container_.read_page(pages[next_page_++], payload_, decoder_).record_count;
      at_ = 0;
    }
    const PointPage points(payload_.data(), count_);
    while (at_ < count_ && filled < out.size()) out[filled++] = points[at_++];
  }
  return filled;
}

}  // namespace ptc
