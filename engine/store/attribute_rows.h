// Reads the channels of points as rows, one for each point.
//
//   attribute pages     a0 a1 a2 | b0 b1 b2      c0 c1 c2        columns, a page for each group
//   rows                a0 b0 c0 | a1 b1 c1 | a2 b2 c2
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/store/reader.h"

namespace ptc {

/// The channels of a container as rows: the values of the channels in the order of the schema,
/// little-endian, without padding. Memory: the rows of a page, and an attribute page.
class AttributeRows {
 public:
  /// @param container  must outlive this
  explicit AttributeRows(const ContainerReader& container)
      : AttributeRows(container, container.groups()) {}
  /// @param groups  channels of other groups are left out, and not read
  AttributeRows(const ContainerReader& container, std::span<const std::uint8_t> groups);

  /// The channels of a row, in their order.
  [[nodiscard]] const std::vector<Channel>& channels() const noexcept { return channels_; }

  /// Returns the bytes of a row; 0 without channels.
  [[nodiscard]] std::size_t row_bytes() const noexcept { return row_bytes_; }
  /// Returns the rows of the points of a point page, valid until the next call. The page that was
  /// asked for last is not read again.
  /// @param rank   of the point page
  /// @param count  points of that page
  /// @throws FormatError when an attribute page is damaged; std::system_error
  [[nodiscard]] std::span<const std::byte> read(std::size_t rank, std::uint32_t count);

 private:
  const ContainerReader& container_;
  std::vector<Channel> channels_;  ///< that are read, by group
  std::size_t row_bytes_ = 0;
  PageDecoder decoder_;
  std::vector<std::byte> payload_, rows_;
  std::size_t rank_ = kNone;  ///< of the page whose rows are held

  static constexpr std::size_t kNone = ~std::size_t{0};
};

/// Writes columns as rows: column after column of `payload` into every row from `at` on.
/// @param channels    whose columns follow each other in `payload`
/// @param row_bytes   distance of two rows
/// @return            offset in a row behind the last value
std::size_t columns_to_rows(std::span<const Channel> channels, std::span<const std::byte> payload,
                            std::uint32_t count, std::span<std::byte> rows, std::size_t row_bytes,
                            std::size_t at);
/// Writes rows as columns, the inverse of columns_to_rows().
std::size_t rows_to_columns(std::span<const Channel> channels, std::span<const std::byte> rows,
                            std::size_t row_bytes, std::size_t at, std::uint32_t count,
                            std::span<std::byte> payload);

}  // namespace ptc
