#include "engine/store/attribute_rows.h"

#include <algorithm>
#include <cstring>

namespace ptc {
namespace {

/// Calls move(offset in a row, offset of the column, bytes of a value) for each component.
template <class Move>
std::size_t for_components(std::span<const Channel> channels, std::uint32_t count, std::size_t at,
                           const Move& move) {
  std::size_t column = 0;
  for (const Channel& channel : channels) {
    const std::size_t bytes = channel.component_bytes();
    for (unsigned c = 0; c < channel.components; ++c, at += bytes, column += bytes * count)
      move(at, column, bytes);
  }
  return at;
}

/// Copies `count` values of a size that the compiler knows.
template <std::size_t kBytes>
void copy_values(std::byte* to, std::size_t to_step, const std::byte* from, std::size_t from_step,
                 std::uint32_t count) noexcept {
  for (std::uint32_t i = 0; i < count; ++i, to += to_step, from += from_step)
    std::memcpy(to, from, kBytes);
}

void copy_values(std::byte* to, std::size_t to_step, const std::byte* from, std::size_t from_step,
                 std::uint32_t count, std::size_t bytes) noexcept {
  switch (bytes) {
    case 1:
      return copy_values<1>(to, to_step, from, from_step, count);
    case 2:
      return copy_values<2>(to, to_step, from, from_step, count);
    case 4:
      return copy_values<4>(to, to_step, from, from_step, count);
    default:
      return copy_values<8>(to, to_step, from, from_step, count);
  }
}

}  // namespace

std::size_t columns_to_rows(std::span<const Channel> channels, std::span<const std::byte> payload,
                            std::uint32_t count, std::span<std::byte> rows, std::size_t row_bytes,
                            std::size_t at) {
  return for_components(
      channels, count, at, [&](std::size_t place, std::size_t column, std::size_t bytes) {
        copy_values(rows.data() + place, row_bytes, payload.data() + column, bytes, count, bytes);
      });
}

std::size_t rows_to_columns(std::span<const Channel> channels, std::span<const std::byte> rows,
                            std::size_t row_bytes, std::size_t at, std::uint32_t count,
                            std::span<std::byte> payload) {
  return for_components(
      channels, count, at, [&](std::size_t place, std::size_t column, std::size_t bytes) {
        copy_values(payload.data() + column, bytes, rows.data() + place, row_bytes, count, bytes);
      });
}

AttributeRows::AttributeRows(const ContainerReader& container, std::span<const std::uint8_t> groups)
    : container_(container) {
  for (const Channel& channel : container.meta().channels) {
    if (std::ranges::find(groups, channel.group) != groups.end()) channels_.push_back(channel);
  }
  row_bytes_ = ptc::row_bytes(channels_);
  if (row_bytes_ > 0) payload_.resize(container.page_payload_limit());
}

std::span<const std::byte> AttributeRows::read(std::size_t rank, std::uint32_t count) {
  if (rank == rank_) return rows_;
  rank_ = kNone;  // so that nothing half read is returned where reading fails
  rows_.resize(count * row_bytes_);
  std::size_t at = 0;
  for (std::span<const Channel> rest = channels_; !rest.empty();) {
    // Read the next group; the schema orders channels by group
    const std::uint8_t group = rest.front().group;
    std::size_t channels = 1;
    while (channels < rest.size() && rest[channels].group == group) ++channels;
    const std::uint32_t page = container_.attribute_pages(group)[rank];
    static_cast<void>(container_.read_page(page, payload_, decoder_));
    at = columns_to_rows(rest.first(channels), payload_, count, rows_, row_bytes_, at);
    rest = rest.subspan(channels);
  }
  rank_ = rank;
  return rows_;
}

}  // namespace ptc
