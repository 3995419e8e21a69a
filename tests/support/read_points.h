// All points of a source, for tests that look at every one.
#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "engine/base/stream.h"
#include "engine/base/surfel.h"

namespace ptc::test {

/// The points of a source and the rows of their channels, one after another.
struct ReadPoints {
  std::vector<Surfel> surfels;
  std::vector<std::byte> rows;

  [[nodiscard]] std::size_t row_bytes() const { return rows.size() / surfels.size(); }
  /// Returns the value that lies `offset` bytes into the row of a point.
  template <class T>
  [[nodiscard]] T value(std::size_t point, std::size_t offset) const {
    T value;
    std::memcpy(&value, rows.data() + point * row_bytes() + offset, sizeof value);
    return value;
  }
};

/// Reads a source to its end, in blocks that fit no page.
[[nodiscard]] inline ReadPoints read_points(PointSource& source) {
  ReadPoints read;
  std::vector<Surfel> block(777);
  while (const std::size_t count = source.next(block)) {
    const auto surfels = std::span(block).first(count);
    read.surfels.insert(read.surfels.end(), surfels.begin(), surfels.end());
    const auto rows = source.attributes();
    read.rows.insert(read.rows.end(), rows.begin(), rows.end());
  }
  return read;
}

}  // namespace ptc::test
