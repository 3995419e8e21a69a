// Sizes and offsets inside a node page (spec/nodes.md#node-group).
//
//   a page:     | slot of each group, u16 | zeros | group 0 | group 1 | ...
//
//   a group:    | head, 24 bytes | u64 x n | 15 columns of u16 x n | 6 columns of u32 x n | zeros |
//                                                                  | 6 more where a point emits
//
// The slot table and every group are padded with zeros to a multiple of 8 bytes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "format/morton.h"

namespace ptc {

inline constexpr std::size_t kGroupHeadBytes = 24;   ///< cell, level, child count, interior mask
inline constexpr std::size_t kGroupChildBytes = 62;  ///< u64, 9 x u16, 6 x u16, 6 x u32
inline constexpr std::size_t kEmissionBytes = 24;    ///< 6 x u32 of a child in a group that emits
inline constexpr unsigned kEmitsFlag = 1;            ///< flag of a group with these columns
inline constexpr std::size_t kSlotUnit = 8;          ///< slots count in bytes of this many
inline constexpr int kFirstPointBits = 48;           ///< of a leaf's reference; its count follows

/// The numbers of the columns of u16 that follow the references, in the order of GroupView's
/// picture.
enum Column : std::size_t {
  kMeanX,
  kMeanY,
  kMeanZ,
  kRadius,
  kConeAxis,
  kConeCos,
  kArea,
  kThickness,
  kGreatest
};
inline constexpr std::size_t kFacing = 9;     ///< first of 6 columns, one for each axis
inline constexpr std::size_t kRadiance = 15;  ///< first of 6 columns of u32, one for each axis
inline constexpr std::size_t kEmission = 27;  ///< first of 6 columns of u32, one for each axis

/// Rounds a number of bytes up to a multiple of kSlotUnit.
[[nodiscard]] constexpr std::size_t round_to_slot(std::size_t bytes) noexcept {
  return (bytes + kSlotUnit - 1) / kSlotUnit * kSlotUnit;
}

/// Returns the bytes of a group of n children without the padding behind it.
/// @param emits  whether it has the columns of emission
[[nodiscard]] constexpr std::size_t group_content_bytes(std::size_t children, bool emits) noexcept {
  return kGroupHeadBytes + (kGroupChildBytes + (emits ? kEmissionBytes : 0)) * children;
}

/// Returns the offset of a column from the start of a group of n children, in bytes. Columns of u32
/// count as two columns of u16.
[[nodiscard]] constexpr std::size_t column_at(std::size_t children, std::size_t column) noexcept {
  return kGroupHeadBytes + 8 * children + 2 * children * column;
}

/// Returns the edge of a cell at `level` in lattice units. Below the lattice, at levels of 42 and
/// more, a cell is one point and the edge is 1.
[[nodiscard]] constexpr double cell_edge(int level) noexcept {
  return level >= kLatticeBits ? 1.0
                               : static_cast<double>(std::uint64_t{1} << (kLatticeBits - level));
}

/// The steps per edge of the cell in which mean positions are stored; the greatest value is 65535.
inline constexpr double kMeanSteps = 65536;
/// The steps per 1 in which the share facing / area is stored.
inline constexpr double kFacingSteps = 65535;
/// The steps per 1 in which cone_cos is stored.
inline constexpr double kCosSteps = 32767;

}  // namespace ptc
