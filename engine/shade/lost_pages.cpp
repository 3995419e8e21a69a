// Finds damaged pages by reading them. Two threads that find a page's state unknown both read the
// page; damage is a fact of the file, so both store the same state, and the states need no lock.
#include "engine/shade/lost_pages.h"

#include "format/error.h"

namespace ptc {

bool LostPages::contains(std::uint32_t page, PageReader& reader) {
  if (page < states_.size()) {
    const std::uint8_t state = states_[page].load(std::memory_order_relaxed);
    if (state != kUnknown) return state == kLost;
  }
  try {
    static_cast<void>(reader.pin(page));
  } catch (const FormatError& error) {
    add(page, error.what());
    return true;
  }
  states_[page].store(kWhole, std::memory_order_relaxed);
  return false;
}

void LostPages::add(std::uint32_t page, const char* why) {
  const std::lock_guard lock(mutex_);
  why_.try_emplace(page, why);
  states_.at(page).store(kLost, std::memory_order_relaxed);
}

std::map<std::uint32_t, std::string> LostPages::list() const {
  const std::lock_guard lock(mutex_);
  return why_;
}

PointScan::OnDamage noted_in(LostPages* lost) {
  if (!lost) return {};
  return [lost](std::uint32_t page, const FormatError& error) { lost->add(page, error.what()); };
}

}  // namespace ptc
