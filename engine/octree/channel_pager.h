// Repacks the columns of attribute pages into pages with another number of points.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "format/packed_columns.h"

namespace ptc {

/// Moves the columns of one channel group from pages of one size to pages of another:
///
///   source pages   | a0 a1 a2 b0 b1 b2 | a3 a4 a5 b3 b4 b5 |      a, b: columns, digit: point
///   result pages   | a0 a1 b0 b1 | a2 a3 b2 b3 | ...
///
/// Memory: one page.
class ChannelPager {
 public:
  /// Writes the payload of the next source page. @return the number of its points, at least 1
  using Source = std::function<std::uint32_t(std::span<std::byte> payload)>;

  /// @param columns        columns of the group's pages; must outlive this
  /// @param payload_limit  size of the largest source payload, bytes
  ChannelPager(std::span<const PackedColumn> columns, std::size_t payload_limit, Source source);

  /// Returns the payload of a page with the next `count` points.
  [[nodiscard]] std::vector<std::byte> next(std::size_t count);

 private:
  std::span<const PackedColumn> columns_;
  std::size_t point_bytes_ = 0;
  std::vector<std::byte> payload_;
  Source source_;
  std::size_t held_ = 0;  ///< points of the source page in payload_
  std::size_t at_ = 0;    ///< the next point of that page
};

}  // namespace ptc
