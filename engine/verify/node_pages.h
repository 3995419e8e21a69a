// A small cache of decoded node pages for the whole-file check.
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "engine/store/reader.h"
#include "engine/verify/checked_pages.h"
#include "format/node_page.h"

namespace ptc {

/// Reads node pages of a container and keeps the most recently used ones decoded.
/// Memory: one decoded page for each page of the capacity.   Threads: not thread-safe.
class NodePages {
 public:
  /// @param container, checked  must outlive this
  /// @param capacity            pages that are kept, at least 1
  NodePages(const ContainerReader& container, CheckedPages& checked, std::size_t capacity)
      : container_(container), checked_(checked), capacity_(capacity) {}

  /// A decoded node page and where its payload lies.
  struct Place {
    NodePage nodes;
    const std::byte* payload = nullptr;  ///< first decoded byte, for offsets within the page
    bool raw = false;  ///< the payload is stored uncompressed, so its offsets hold in the file too
  };
  /// Returns a page, reading it when it is not kept. The result is valid until the next call.
  /// @throws FormatError, std::system_error
  [[nodiscard]] Place page(std::uint32_t number);

 private:
  struct Page {
    PageHeader header;
    std::vector<std::byte> payload;
    std::uint64_t used = 0;  ///< clock_ at the last use
  };

  std::unordered_map<std::uint32_t, Page>::iterator load(std::uint32_t page);

  const ContainerReader& container_;
  CheckedPages& checked_;
  std::size_t capacity_;
  PageDecoder decoder_;
  std::unordered_map<std::uint32_t, Page> pages_;
  std::uint64_t clock_ = 0;
};

}  // namespace ptc
