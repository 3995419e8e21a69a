// Columns of integers as differences in byte planes, a form that compresses well
// (spec/points.md#packed-columns).
//
//   one column:  | shift, planes, base: 10 bytes | plane 0: n bytes | plane 1 | ...
//
//   values   9000 9002 9001 9005        neighbours on the Z-curve differ little
//   steps         +2   -1   +4
//   codes    0    4    1    8           zigzag: small steps of either sign are small numbers
//   planes   byte 0 of all codes, byte 1 of all codes, ...; planes of zeros at the top are left out
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "format/instruction_sets.h"
#include "format/schema.h"

namespace ptc {

/// The bits of a coordinate of a point page: 32 in its own column and 10 in the column `high`.
inline constexpr std::uint8_t kCoordinateBits = 42;

/// Describes a column of a payload and how it is packed.
struct PackedColumn {
  static constexpr std::uint8_t kNone = 0xff;  ///< no column is subtracted
  std::uint32_t before = 0;  ///< bytes per point of the columns in front of it in the payload
  std::uint8_t bits = 0;  ///< of a value: 8, 16, 32, 64, or kCoordinateBits for x, y, z of points
  std::uint8_t minus = kNone;  ///< index of an earlier column whose values are subtracted first
};

/// Returns the columns of a point page, in the order in which they are packed. Together they hold
/// all bytes of each point.
/// @param point_bytes  FileHeader::point_bytes
[[nodiscard]] std::span<const PackedColumn> packed_point_columns(std::uint8_t point_bytes) noexcept;

/// Returns the columns of an attribute page of a channel group, one for each component of each
/// channel, in the order of the payload.
[[nodiscard]] std::vector<PackedColumn> packed_group_columns(std::span<const Channel> channels,
                                                             std::uint8_t group);

/// Packs `count` values of each column.
/// @param payload  the unpacked columns; a point page must keep the rules of PointPage::verify()
/// @param count    values per column, at least one
/// @param packed   receives the packed columns and is resized to them
/// @throws std::invalid_argument when the size of the payload does not match `count` and `columns`
void pack_columns(std::span<const std::byte> payload, std::uint32_t count,
                  std::span<const PackedColumn> columns, std::vector<std::byte>& packed,
                  InstructionSet set = widest_instructions());

/// Unpacks `count` values of each column, the inverse of pack_columns().
/// @param packed   untrusted bytes
/// @param payload  receives the unpacked columns; its size must match `count` and `columns`
/// @throws std::invalid_argument when the size of the payload does not match; FormatError with the
///         offset in `packed` when the packed bytes break a rule
void unpack_columns(std::span<const std::byte> packed, std::uint32_t count,
                    std::span<const PackedColumn> columns, std::span<std::byte> payload);

}  // namespace ptc
