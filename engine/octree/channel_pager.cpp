// Copies runs of each column: column c of a page with n points begins c.before * n bytes from the
// start of the payload, where c.before is the width of the columns before it.
#include "engine/octree/channel_pager.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace ptc {

ChannelPager::ChannelPager(std::span<const PackedColumn> columns, std::size_t payload_limit,
                           Source source)
    : columns_(columns), payload_(payload_limit), source_(std::move(source)) {
  for (const PackedColumn& column : columns_) point_bytes_ += column.bits / 8;
}

std::vector<std::byte> ChannelPager::next(std::size_t count) {
  std::vector<std::byte> out(count * point_bytes_);
  for (std::size_t filled = 0; filled < count;) {
    if (at_ == held_) {
      held_ = source_(payload_);
      at_ = 0;
    }
    const std::size_t part = std::min(count - filled, held_ - at_);
    for (const PackedColumn& column : columns_) {
      const std::size_t width = column.bits / 8;
      std::memcpy(out.data() + column.before * count + filled * width,
                  payload_.data() + column.before * held_ + at_ * width, part * width);
    }
    filled += part;
    at_ += part;
  }
  return out;
}

}  // namespace ptc
