// The exact nearest neighbours of places, wherever on the Z-curve they lie.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/scan/neighbour_kernels.h"
#include "engine/scan/place_pages.h"
#include "engine/scan/scan_spool.h"

namespace ptc {

/// Consecutive places of a chunk that lie close together, [begin, end).
struct PlaceBlock {
  std::uint32_t begin, end;
};
/// The maximum number of places in a block.
inline constexpr std::size_t kBlockPlaces = 48;

/// Splits consecutive places into blocks: cells of the octree with at most kBlockPlaces places, or
/// several small ones beside each other in one cell. The result depends on the places alone.
/// @param blocks  is overwritten
void split_blocks(std::span<const Place> places, std::vector<PlaceBlock>& blocks);

/// The nearest neighbours of one place. The place itself is among them, at distance 0.
struct Neighbours {
  const Candidates& candidates;
  std::span<const std::uint32_t> found;  ///< indices into the candidates, by ascending place
  std::array<float, 3> position;         ///< of the place, in the coordinates of the candidates
  float farthest;                        ///< greatest squared distance, lattice units squared
  const PlacePages* pages;               ///< null when ids are indices into `far`
  const std::uint64_t* far;

  /// Returns the number of the place of a candidate.
  [[nodiscard]] std::uint64_t place(std::uint32_t candidate) const noexcept {
    const std::uint32_t id = candidates.id[candidate];
    return pages != nullptr ? pages->place(id) : far[id];
  }
};

/// Finds the nearest neighbours of the places of a block. Distances are those of floats relative to
/// the centre of the block; of places at the same distance, the first ones on the curve count as
/// nearer. So the result depends on the places alone, not on what is in memory.
///
/// All places in a box around the block are gathered, and the neighbours are chosen among them. The
/// box must reach as far as the farthest neighbour; if it does not, it grows:
///
///     +--------------------+
///     |  . .   .  .   .    |      the box reaches `reach` beyond the block; `limit` is how far
///     |    +--------+   .  |      from q it holds every place
///     | .  | . q----|------|
///     |    |  .  .  |  .   |
///     |  . +--------+      |
///     +--------------------+
///
/// Where a sparse block lies beside a dense region, such a box would hold too many places. Then
/// pages are searched by increasing distance, for each place on its own.
///
/// Threads: one; each thread has its own.
class NeighbourSearch {
 public:
  /// Receives the index of a query in the block, and its neighbours.
  using Take = std::function<void(std::uint32_t query, const Neighbours& neighbours)>;

  /// @param spool  finished; must outlive this
  /// @param slots  pages that are held in memory
  NeighbourSearch(const ScanSpool& spool, std::size_t slots);
  /// Returns the memory that this takes for pages of a size, bytes.
  [[nodiscard]] static std::uint64_t bytes(std::size_t page_places, std::size_t slots) noexcept;

  /// Finds neighbours of some places of a block.
  /// @param block    positions of all places of the block
  /// @param queries  indices into the block
  /// @param wanted   the number of neighbours, the place itself included; all places when there are
  ///                 fewer
  /// @param reach    lattice units; what blocks like this one need, or 0; is brought up to date
  void search(std::span<const LatticePosition> block, std::span<const std::uint32_t> queries,
              std::size_t wanted, double& reach, const Take& take);

 private:
  /// The block that is being searched.
  struct Task {
    std::span<const LatticePosition> block;
    std::size_t wanted;
    LatticeBox box;
    LatticePosition centre, half;
  };

  /// A place that search_far() found.
  struct Near {
    float squared;
    std::uint64_t place;
    std::array<float, 3> position;
    bool operator<(const Near& other) const noexcept {
      return squared != other.squared ? squared < other.squared : place < other.place;
    }
  };

  [[nodiscard]] std::array<float, 3> relative(const Task& task, const LatticePosition& p) const;
  [[nodiscard]] bool gather(const Task& task, const LatticeBox& grown, double reach);
  [[nodiscard]] double take_complete(const Task& task, double reach, bool everything,
                                     double& needed, const Take& take);
  [[nodiscard]] std::vector<Near> collect_far(const Task& task, std::uint32_t query);
  void search_far(const Task& task, std::uint32_t query, const Take& take);

  const ScanSpool& spool_;
  PlacePages pages_;
  Candidates candidates_, far_candidates_;
  std::vector<std::uint32_t> overlapping_, slots_, found_, pending_;
  std::vector<std::uint64_t> far_places_;
};

}  // namespace ptc
