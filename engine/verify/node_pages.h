// Node pages of a container, decoded and kept while there is room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "engine/store/reader.h"
#include "format/node_page.h"

namespace ptc {

/// The least recently used pages make room.
class NodePages {
 public:
  /// @param container  must outlive this
  /// @param capacity   pages, at least 1
  NodePages(const ContainerReader& container, std::size_t capacity)
      : container_(container), capacity_(capacity) {}

  struct Place {
    NodePage nodes;
    const std::byte* payload = nullptr;
    bool raw = false;  ///< the payload lies in the file as it is
  };
  /// Valid until the next call.
  /// @throws FormatError, std::system_error
  [[nodiscard]] Place page(std::uint32_t number);

 private:
  struct Page {
    PageHeader header;
    std::vector<std::byte> payload;
    std::uint64_t used = 0;
  };

  std::unordered_map<std::uint32_t, Page>::iterator load(std::uint32_t page);

  const ContainerReader& container_;
  std::size_t capacity_;
  PageDecoder decoder_;
  std::unordered_map<std::uint32_t, Page> pages_;
  std::uint64_t clock_ = 0;
};

}  // namespace ptc
