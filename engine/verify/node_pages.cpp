// The least recently used page makes room for a new one, and lends it its memory.
#include "engine/verify/node_pages.h"

#include <algorithm>
#include <utility>

namespace ptc {

NodePages::Place NodePages::page(std::uint32_t number) {
  auto found = pages_.find(number);
  if (found == pages_.end()) found = load(number);
  Page& page = found->second;
  page.used = ++clock_;
  return {NodePage(page.payload.data(), page.header.record_count), page.payload.data(),
          page.header.coding.codec == Codec::raw};
}

std::unordered_map<std::uint32_t, NodePages::Page>::iterator NodePages::load(std::uint32_t page) {
  // Evict the least recently used page, and keep its buffer for the new one.
  Page fresh;
  if (pages_.size() >= capacity_) {
    const auto oldest =
        std::ranges::min_element(pages_, {}, [](const auto& entry) { return entry.second.used; });
    fresh.payload = std::move(oldest->second.payload);
    pages_.erase(oldest);
  }
  // Read and decode the new page.
  fresh.payload.resize(container_.page_payload_limit());
  fresh.header = checked_.read(page, fresh.payload, decoder_);
  return pages_.emplace(page, std::move(fresh)).first;
}

}  // namespace ptc
