// Fits surfaces to the neighbourhoods of a chunk of places.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/scan/neighbour_search.h"
#include "engine/scan/scan_spool.h"
#include "engine/scan/surface_fit.h"

namespace ptc {

/// The places of a chunk, except for the last one: a part of the work that is done by one thread.
inline constexpr std::size_t kChunkPlaces = std::size_t{1} << 15;
/// The maximum number of links of a place to others.
inline constexpr std::size_t kLinks = 16;
/// A link that does not exist.
inline constexpr std::uint32_t kNoLink = 0xffffffff;

/// Neighbours without which there is no plane through a place.
inline constexpr int kPlaneNeighbours = 3;

/// What the neighbours of a place say about it. Lengths are in lattice units.
struct PlaceFit {
  std::array<float, 3> normal{};      ///< unit, of either side
  std::array<float, 3> broad{};       ///< normal of the surface through all neighbours
  float reach = 0;                    ///< distance of the farthest neighbour; 0: there is none
  float noise = 0;                    ///< RMS distance of neighbours from the surface
  float offset = 0;                   ///< distance of the place from the surface, not negative
  std::array<float, 3> to_surface{};  ///< from the place along the fitted normal
  float nearest = 0;                  ///< distance of the nearest neighbour
  float spread = 0;                   ///< spacing, from how widely the neighbours spread
  float flatness = 0;                 ///< 1 for a plane, 0 for a ball
  float aside = 0;          ///< of the neighbours' mean, in the plane, in units of the reach
  float gap = 0;            ///< see FitLanes::gap
  std::uint8_t count = 0;   ///< neighbours
  bool wants_more = false;  ///< more neighbours would give a better fit
  bool scattered = false;   ///< the surface through all neighbours is noisy, or they are a line
  std::array<float, 6> directions{};  ///< see FitLanes::directions
};

/// A link from a place of a chunk to one of an earlier chunk.
struct OuterLink {
  std::uint32_t from;           ///< place, counted from the first one of its chunk
  std::uint64_t to;             ///< place, counted from the first of all
  std::array<float, 3> offset;  ///< lattice units
};

/// A chunk of consecutive places, and what is known of them.
struct ScanChunk {
  std::uint64_t first = 0;  ///< number of its first place
  std::vector<Place> places;
  std::vector<LatticePosition> positions;
  std::vector<PlaceBlock> blocks;
  std::vector<PlaceFit> fits;
  /// Some of the neighbours of each place, as places of this chunk, counted from its first one.
  std::vector<std::array<std::uint32_t, kLinks>> links;
  std::vector<OuterLink> outer;  ///< links to places of earlier chunks
};
/// The memory of a chunk, at most.
inline constexpr std::uint64_t kChunkBytes =
    kChunkPlaces * (sizeof(Place) + sizeof(LatticePosition) + sizeof(PlaceBlock) +
                    sizeof(PlaceFit) + kLinks * sizeof(std::uint32_t) + 2 * sizeof(OuterLink) + 4);

/// Fits surfaces to few neighbours where the points are clean, and to many where they are noisy or
/// lie on lines.
///
/// Threads: one; each thread has its own. The result does not depend on what was fitted before.
class ChunkFitter {
 public:
  /// @param spool  finished; must outlive this
  /// @param slots  pages that are held in memory
  ChunkFitter(const ScanSpool& spool, std::size_t slots);
  /// Returns the memory of a fitter, bytes.
  [[nodiscard]] static std::uint64_t bytes(std::size_t page_places, std::size_t slots) noexcept;

  /// Reads the places of a chunk, and fits a surface to each.
  /// @param number  of the chunk
  /// @throws std::system_error, DataError when the spool cannot be read
  void fit(std::uint64_t number, ScanChunk& chunk);

 private:
  /// Neighbourhoods that wait until all lanes are full.
  struct Batch {
    FitBatch rows;
    std::array<std::uint32_t, kFitLanes> places{};
    std::array<float, kFitLanes> reach{};
    std::size_t lanes = 0;
  };

  void fit_all(ScanChunk& chunk, std::span<const std::uint8_t> chosen, std::size_t neighbours,
               double& reach);
  void add(ScanChunk& chunk, std::uint32_t place, const Neighbours& neighbours);
  void flush(ScanChunk& chunk);

  const ScanSpool& spool_;
  NeighbourSearch search_;
  double reach_few_ = 0, reach_many_ = 0;
  std::unique_ptr<Batch> batch_;
  std::unique_ptr<FitLanes> lanes_;
};

}  // namespace ptc
