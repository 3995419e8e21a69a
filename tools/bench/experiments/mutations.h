// Ways in which a file may be changed after it was written, numbered.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace ptc::bench {

using Bytes = std::vector<std::byte>;

/// Where a page lies in a file, its padding included.
struct PagePlace {
  std::size_t offset = 0;
  std::size_t bytes = 0;
};

/// One kind of change: `count` ways to make it.
struct Mutation {
  std::string name;
  std::size_t count = 0;
  /// The file after way k, in `out`; false when that changes nothing.
  bool (*apply)(const Bytes& whole, std::span<const PagePlace> pages, std::size_t k,
                Bytes& out) = nullptr;
};

/// All kinds for a file.
[[nodiscard]] std::vector<Mutation> mutations_of(const Bytes& whole,
                                                 std::span<const PagePlace> pages);

}  // namespace ptc::bench
