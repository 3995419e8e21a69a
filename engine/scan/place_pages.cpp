#include "engine/scan/place_pages.h"

#include <algorithm>
#include <bit>
#include <limits>

namespace ptc {
namespace {

constexpr std::uint32_t kNone = 0xffffffff;

std::size_t numbers_of(std::size_t page_places) noexcept {
  return 3 * page_places + 6 * (page_places / kGroupPlaces);
}

}  // namespace

PlacePages::PlacePages(const ScanSpool& spool, std::size_t slots)
    : spool_(spool),
      page_shift_(std::countr_zero(spool.index().page_places())),
      page_places_(spool.index().page_places()),
      groups_(page_places_ / kGroupPlaces),
      slot_numbers_(numbers_of(page_places_)),
      page_of_(slots, kNone),
      asked_(slots, 0),
      numbers_(slots * slot_numbers_),
      read_(page_places_) {}

std::uint64_t PlacePages::bytes(std::size_t page_places, std::size_t slots) noexcept {
  constexpr std::uint64_t kBookkeeping = 80;  // of a slot
  return slots * (numbers_of(page_places) * sizeof(double) + kBookkeeping) +
         page_places * sizeof(Place);
}

void PlacePages::load(std::span<const std::uint32_t> pages, std::vector<std::uint32_t>& slots) {
  ++call_;
  slots.assign(pages.size(), kNone);
  // Keep what is there before anything gives way.
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const auto found = slot_of_.find(pages[i]);
    if (found == slot_of_.end()) continue;
    slots[i] = found->second;
    asked_[found->second] = call_;
  }
  for (std::size_t i = 0; i < pages.size(); ++i) {
    if (slots[i] != kNone) continue;
    slots[i] = free_slot();
    fill(slots[i], pages[i]);
  }
}

std::uint32_t PlacePages::free_slot() noexcept {
  const auto oldest = std::ranges::min_element(asked_);
  const auto slot = static_cast<std::size_t>(oldest - asked_.begin());
  if (page_of_[slot] != kNone) slot_of_.erase(page_of_[slot]);
  page_of_[slot] = kNone;
  return static_cast<std::uint32_t>(slot);
}

void PlacePages::fill(std::uint32_t slot, std::uint32_t page) {
  // Read the places.
  const std::uint64_t first = std::uint64_t{page} * page_places_;
  const auto count =
      static_cast<std::size_t>(std::min<std::uint64_t>(page_places_, spool_.places() - first));
  const std::span<Place> places = std::span(read_).first(count);
  spool_.read_places(first, places);
  // Decode their positions, and put boxes around each group of them.
  double* numbers = numbers_.data() + slot * slot_numbers_;
  double* boxes = numbers + 3 * page_places_;
  std::fill_n(numbers, 3 * page_places_, std::numeric_limits<double>::infinity());
  for (std::size_t group = 0; group < groups_; ++group) {
    LatticeBox box;
    const std::size_t end = std::min(count, (group + 1) * kGroupPlaces);
    for (std::size_t i = group * kGroupPlaces; i < end; ++i) {
      const LatticePosition p = position_of(places[i].key);
      for (std::size_t k = 0; k < 3; ++k) numbers[k * page_places_ + i] = p[k];
      box.add(p);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      boxes[k * groups_ + group] = box.low[k];
      boxes[(3 + k) * groups_ + group] = box.high[k];
    }
  }
  page_of_[slot] = page;
  asked_[slot] = call_;
  slot_of_[page] = slot;
}

PageView PlacePages::view(std::uint32_t slot) const noexcept {
  const double* numbers = numbers_.data() + slot * slot_numbers_;
  const double* boxes = numbers + 3 * page_places_;
  PageView view{.groups = groups_};
  for (std::size_t k = 0; k < 3; ++k) {
    view.position[k] = numbers + k * page_places_;
    view.low[k] = boxes + k * groups_;
    view.high[k] = boxes + (3 + k) * groups_;
  }
  return view;
}

}  // namespace ptc
