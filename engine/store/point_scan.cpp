#include "engine/store/point_scan.h"

#include <algorithm>
#include <utility>

namespace ptc {

PointScan::PointScan(const ContainerReader& container, PageNumbers::Range pages, OnDamage on_damage)
    : container_(container),
      pages_(pages),
      on_damage_(std::move(on_damage)),
      payload_(container.page_payload_limit()) {}

bool PointScan::next() {
  if (next_ == pages_.size()) return false;
  const std::uint32_t page = pages_[next_++];
  count_ = container_.entry(page).record_count;
  whole_ = true;
  try {
    static_cast<void>(container_.read_page(page, payload_, decoder_));
  } catch (const FormatError& error) {
    if (!on_damage_) throw;
    on_damage_(page, error);
    whole_ = false;
  }
  return true;
}

void PointScan::skip(std::size_t pages) noexcept {
  next_ += std::min(pages, pages_.size() - next_);
}

std::uint64_t PointScan::skip_points(std::uint64_t points) noexcept {
  for (; next_count() > 0 && points >= next_count(); skip(1)) points -= next_count();
  return points;
}

std::uint32_t PointScan::next_count() const noexcept {
  return next_ == pages_.size() ? 0 : container_.entry(pages_[next_]).record_count;
}

}  // namespace ptc
