// What is known of the places of a chunk in the end: normals, radii and marks.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/scan/chunk_fit.h"
#include "engine/scan/orientation.h"

namespace ptc {

/// The result for one place, as it lies in a temporary file until all chunks are done.
struct PlaceResult {
  std::array<std::int16_t, 2> normal{};  ///< octahedral; to be flipped with its piece
  float radius = 0;                      ///< scene units; 0: no neighbour is near
  std::uint16_t piece = 0;               ///< of its chunk, see ChunkPieces
  std::uint8_t facts = 0;                ///< bits of PlaceFact
  std::uint8_t octave = 0;               ///< spacing, in steps of a quarter of an octave
  /// How far a receiver must rise above the place, in eighths of the radius: along the normal, and
  /// along the opposite one.
  std::array<std::uint8_t, 2> rise{};
};
static_assert(sizeof(PlaceResult) == 16 && std::is_trivially_copyable_v<PlaceResult>);

/// Facts about a place.
enum PlaceFact : std::uint8_t {
  kIsolated = 1,   ///< it is far from its neighbours, compared with their spacing
  kScattered = 2,  ///< its neighbours lie on no surface
};

/// Computes the results of a chunk whose normals are oriented.
/// @param unit  lattice unit in scene units
void make_results(const ScanChunk& chunk, const ChunkPieces& pieces, double unit,
                  std::vector<PlaceResult>& results);

/// Returns the greatest length that PlaceResult::octave stands for, lattice units.
[[nodiscard]] double length_of_octave(std::uint64_t octave) noexcept;

/// Returns the octahedral numbers of the opposite direction. Flipping twice gives the same numbers.
[[nodiscard]] std::array<std::int16_t, 2> flip_octahedral(
    const std::array<std::int16_t, 2>& normal) noexcept;

}  // namespace ptc
