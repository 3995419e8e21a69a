// The record of one surfel on its way from the input to the file; the external sort moves these.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "format/instruction_sets.h"
#include "format/morton.h"

namespace ptc {

/// Three numbers of a colour as half patterns.
using Half3 = std::array<std::uint16_t, 3>;

/// A surfel whose position is given by its place on the Z-curve.
struct PointRecord {
  MortonKey key;                         ///< position on the lattice of the scene's Frame
  float radius = 0;                      ///< scene units; the disc circumscribes its square cell
  std::array<std::int16_t, 2> normal{};  ///< octahedral u and v
  Half3 radiance{};                      ///< reflected, RGB as half patterns, W / (m^2 sr)
  std::array<std::uint8_t, 3> albedo{};  ///< diffuse reflectance, RGB in steps of 1 / 255
  std::uint8_t flags = 0;                ///< 0; reserved
  Half3 emission{};                      ///< own light, RGB as half patterns, W / (m^2 sr)
};
static_assert(sizeof(PointRecord) == 40 && std::is_trivially_copyable_v<PointRecord>);

/// The greatest number of points in a PositionBlock.
inline constexpr std::size_t kPositionBlock = 256;
/// The lattice coordinates of up to kPositionBlock points, one array for each axis.
using PositionBlock = std::array<std::array<std::uint64_t, kPositionBlock>, 3>;

/// Decodes the keys of points into lattice coordinates.
/// @param points  at most kPositionBlock
/// @param out     receives the coordinates; entries from points.size() on keep their values
/// @param set     one that has_instructions()
void decode_positions(std::span<const PointRecord> points, PositionBlock& out,
                      InstructionSet set = widest_instructions()) noexcept;

}  // namespace ptc
