// Point pages one after another.
#include "engine/octree/container_points.h"

#include "format/error.h"
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
      if (PointPage(payload_.data(), count_)[0].key < last_) refuse(pages[next_page_ - 1]);
    }
    const PointPage points(payload_.data(), count_);
    while (at_ < count_ && filled < out.size()) out[filled++] = points[at_++];
    last_ = out[filled - 1].key;
  }
  return filled;
}

// Within a page the reader has checked the order; what is built from the stream relies on all of
// it.
void ContainerPoints::refuse(std::uint32_t page) const {
  throw FormatError(kPageHeaderBytes, "spec/points.md#point-order",
                    "the first point of the page precedes the one before")
      .rebased(container_.entry(page).offset, container_.path().string());
}

}  // namespace ptc
