// Sizes and offsets in a node page (spec/nodes.md#node-group).
#pragma once

#include <cstddef>
#include <cstdint>

#include "format/morton.h"

namespace ptc {

inline constexpr std::size_t kGroupHeadBytes = 24;
inline constexpr std::size_t kGroupChildBytes = 60;  // u64, 8 x u16, 6 x u16, 6 x u32
inline constexpr std::size_t kSlotUnit = 8;
inline constexpr int kFirstPointBits = 48;

// Columns of u16 after the children, in the order of GroupView's picture.
enum Column : std::size_t {
  kMeanX,
  kMeanY,
  kMeanZ,
  kRadius,
  kConeAxis,
  kConeCos,
  kArea,
  kThickness
};
inline constexpr std::size_t kFacing = 8;     // 6 columns, one an axis
inline constexpr std::size_t kRadiance = 14;  // 6 columns of u32, one an axis

[[nodiscard]] constexpr std::size_t round_to_slot(std::size_t bytes) noexcept {
  return (bytes + kSlotUnit - 1) / kSlotUnit * kSlotUnit;
}

/// Bytes of a group of n children without what pads it.
[[nodiscard]] constexpr std::size_t group_content_bytes(std::size_t children) noexcept {
  return kGroupHeadBytes + kGroupChildBytes * children;
}

/// First byte of a column in a group of n children.
[[nodiscard]] constexpr std::size_t column_at(std::size_t children, std::size_t column) noexcept {
  return kGroupHeadBytes + 8 * children + 2 * children * column;
}

/// Edge of a group's cell in lattice units; below the lattice a cell is one point.
[[nodiscard]] constexpr double cell_edge(int level) noexcept {
  return level >= kLatticeBits ? 1.0
                               : static_cast<double>(std::uint64_t{1} << (kLatticeBits - level));
}

/// Mean positions count 1/65536 of that edge, up to 65535.
inline constexpr double kMeanSteps = 65536;
/// facing / area counts 1/65535.
inline constexpr double kFacingSteps = 65535;
/// cone_cos counts 1/32767.
inline constexpr double kCosSteps = 32767;

}  // namespace ptc
