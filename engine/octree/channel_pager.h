// Columns of attribute pages, moved to pages of another length.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "format/packed_columns.h"

namespace ptc {

/// Moves the columns of one channel group from pages of one size to pages of another.   Memory: a
/// page.
class ChannelPager {
 public:
  /// Fills the payload of the next page that there is. @return how many points it has
  using Source = std::function<std::uint32_t(std::span<std::byte> payload)>;

  /// @param columns        of the group's pages; what they span must outlive this
  /// @param payload_limit  of the pages that come
  ChannelPager(std::span<const PackedColumn> columns, std::size_t payload_limit, Source source);

  /// Payload of a page with the next `count` points.
  [[nodiscard]] std::vector<std::byte> next(std::size_t count);

 private:
  std::span<const PackedColumn> columns_;
  std::size_t point_bytes_ = 0;
  std::vector<std::byte> payload_;
  Source source_;
  std::size_t held_ = 0;  ///< points of the page in payload_
  std::size_t at_ = 0;
};

}  // namespace ptc
