// Ways in which a file can be changed after it was written, numbered so that all can be tried.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace ptc::bench {

/// A whole file.
using Bytes = std::vector<std::byte>;

/// Where a page lies in a file, its padding included.
struct PagePlace {
  std::size_t offset = 0;  ///< offset of the page's header
  std::size_t bytes = 0;   ///< header, payload and padding
};

/// One kind of change, with `count` numbered ways to make it.
struct Mutation {
  std::string name;
  std::size_t count = 0;
  /// Stores the file changed in way k in `out`. @return whether that differs from the whole file
  bool (*apply)(const Bytes& whole, std::span<const PagePlace> pages, std::size_t k,
                Bytes& out) = nullptr;
};

/// Lists all kinds of changes to a file.
[[nodiscard]] std::vector<Mutation> mutations_of(const Bytes& whole,
                                                 std::span<const PagePlace> pages);

}  // namespace ptc::bench
