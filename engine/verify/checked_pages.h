// Pages that are read and checked completely, for the whole-file check.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/store/reader.h"

namespace ptc {

/// Compares the key range and the level in a page's header with those of its records.
/// @param payload  decoded payload, which passed the checks of ContainerReader::read_page()
/// @throws FormatError with the offset in the image
void check_page_keys(const PageHeader& header, std::span<const std::byte> payload,
                     std::uint8_t point_bytes);

/// Reads pages of a container and checks every rule of their content. It remembers which pages
/// passed, so that these need not be decoded again to be checked.
/// Memory: one byte for each page.   Threads: may be called concurrently.
class CheckedPages {
 public:
  /// @param container  must outlive this
  explicit CheckedPages(const ContainerReader& container)
      : container_(container), passed_(container.page_count()) {}

  /// Reads a page as ContainerReader::read_page() does, and checks its header against its content.
  /// @throws FormatError, std::system_error
  PageHeader read(std::uint32_t page, std::span<std::byte> payload, PageDecoder& decoder) {
    const PageHeader header = container_.read_page(page, payload, decoder);
    check_page_keys(header, payload.first(header.raw_bytes), container_.header().point_bytes);
    passed_[page].store(true, std::memory_order_relaxed);
    return header;
  }
  /// Returns whether a page was read and passed.
  [[nodiscard]] bool passed(std::uint32_t page) const noexcept {
    return passed_[page].load(std::memory_order_relaxed);
  }

 private:
  const ContainerReader& container_;
  std::vector<std::atomic<bool>> passed_;
};

}  // namespace ptc
