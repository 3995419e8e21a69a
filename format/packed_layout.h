// Inside packed columns: what packing and unpacking share (spec/points.md#packed-columns).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "format/packed_columns.h"

namespace ptc {

inline constexpr std::size_t kHeadBytes = 10;  ///< of a column: shift, planes, base
inline constexpr std::size_t kHigh =
    12;  ///< bytes a point before a point page's bits 32 to 41 of x, y, z
inline constexpr unsigned kHighBits = kCoordinateBits - 32;

[[nodiscard]] constexpr std::uint64_t mask(unsigned bits) noexcept {
  return (std::uint64_t{1} << bits) - 1;
}

/// Where x, y, z keep their upper bits: shift of the axis whose column has so many bytes before it.
[[nodiscard]] inline unsigned high_shift(const PackedColumn& column) noexcept {
  return column.before / 4 * kHighBits;
}

/// @throws std::invalid_argument when a payload of `count` values in these columns has another size
void check_packed_size(std::size_t bytes, std::uint32_t count,
                       std::span<const PackedColumn> columns);

}  // namespace ptc
