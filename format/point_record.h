// One surfel on its way from the source to the file: what the sort moves.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "format/instruction_sets.h"
#include "format/morton.h"

namespace ptc {

/// A surfel with its place on the Z-curve in front. The key is the position.
struct PointRecord {
  MortonKey key;
  float radius = 0;                         ///< scene units; the disc circumscribes its square cell
  std::array<std::int16_t, 2> normal{};     ///< octahedral
  std::array<std::uint16_t, 3> radiance{};  ///< half, outgoing, W / (m^2 sr)
  std::array<std::uint8_t, 3> albedo{};     ///< diffuse reflectance, v / 255
  std::uint8_t flags = 0;                   ///< 0; reserved
  std::array<std::uint8_t, 6> reserved{};   ///< 0
};
static_assert(sizeof(PointRecord) == 40 && std::is_trivially_copyable_v<PointRecord>);

/// Lattice coordinates of up to kPositionBlock points, an array an axis.
inline constexpr std::size_t kPositionBlock = 256;
using PositionBlock = std::array<std::array<std::uint64_t, kPositionBlock>, 3>;

/// Decodes the keys of points into lattice coordinates.
/// @param points  at most kPositionBlock
/// @param out     its front is filled
void decode_positions(std::span<const PointRecord> points, PositionBlock& out,
                      InstructionSet set = widest_instructions()) noexcept;

}  // namespace ptc
