// The layout inside packed columns, shared by packing and unpacking
// (spec/points.md#packed-columns).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "format/packed_columns.h"

namespace ptc {

inline constexpr std::size_t kHeadBytes = 10;  ///< head of a column: shift, planes, base
inline constexpr std::size_t kHigh =
    12;  ///< bytes per point in front of a point page's column `high`
inline constexpr unsigned kHighBits =
    kCoordinateBits - 32;  ///< bits of each coordinate in that column

/// Returns a number whose lowest `bits` bits are one, for 1 to 64 bits.
[[nodiscard]] constexpr std::uint64_t mask(unsigned bits) noexcept {
  return ~std::uint64_t{0} >> (64 - bits);
}

/// Returns the shift of a coordinate's upper bits in the column `high` of a point page: 0 for x, 10
/// for y, 20 for z.
[[nodiscard]] inline unsigned high_shift(const PackedColumn& column) noexcept {
  return column.before / 4 * kHighBits;
}

/// Checks that a payload of `bytes` bytes holds exactly `count` values, at least one, of each
/// column. @throws std::invalid_argument when it does not
void check_packed_size(std::size_t bytes, std::uint32_t count,
                       std::span<const PackedColumn> columns);

}  // namespace ptc
