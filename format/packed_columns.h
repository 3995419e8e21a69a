// Columns of integers as differences in byte planes: what compresses well
// (spec/points.md#packed-columns).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "format/instruction_sets.h"
#include "format/schema.h"

namespace ptc {

inline constexpr std::uint8_t kCoordinateBits = 42;

/// A column of a payload, and how it is packed.
struct PackedColumn {
  static constexpr std::uint8_t kNone = 0xff;
  std::uint32_t before = 0;  ///< bytes a point of the payload's columns in front of it
  std::uint8_t bits = 0;  ///< of a value: 8, 16, 32, or kCoordinateBits of a point page's x, y, z
  std::uint8_t minus = kNone;  ///< number of an earlier column whose values are taken off first
};

/// The columns of a point page. They stand for its 34 bytes a point.
[[nodiscard]] std::span<const PackedColumn> packed_point_columns() noexcept;

/// The columns of an attribute page of a group.
[[nodiscard]] std::vector<PackedColumn> packed_group_columns(std::span<const Channel> channels,
                                                             std::uint16_t group);

/// Packs `count` values of each column, at least one.
/// @param payload  the columns, unpacked; of a point page one that keeps its rules
/// @param packed   its size is what they take
/// @throws std::invalid_argument when the payload has another size
void pack_columns(std::span<const std::byte> payload, std::uint32_t count,
                  std::span<const PackedColumn> columns, std::vector<std::byte>& packed,
                  InstructionSet set = widest_instructions());

/// @param payload  filled; its size is that of the unpacked columns
/// @throws std::invalid_argument when it is not, FormatError with the offset in `packed`
void unpack_columns(std::span<const std::byte> packed, std::uint32_t count,
                    std::span<const PackedColumn> columns, std::span<std::byte> payload);

}  // namespace ptc
