#include "engine/shade/lost_pages.h"

#include "format/error.h"

namespace ptc {

bool LostPages::contains(std::uint32_t page, PageReader& reader) {
  if (page < states_.size()) {
    const std::uint8_t state = states_[page].load(std::memory_order_relaxed);
    if (state != kUnknown) return state == kLost;
  }
  try {
    static_cast<void>(reader.get(page));
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

bool read_unless_lost(const ContainerReader& container, std::uint32_t page,
                      std::span<std::byte> out, PageDecoder& decoder, LostPages* lost) {
  try {
    static_cast<void>(container.read_page(page, out, decoder));
  } catch (const FormatError& error) {
    if (lost == nullptr) throw;
    lost->add(page, error.what());
    return false;
  }
  return true;
}

std::map<std::uint32_t, std::string> LostPages::list() const {
  const std::lock_guard lock(mutex_);
  return why_;
}

}  // namespace ptc
