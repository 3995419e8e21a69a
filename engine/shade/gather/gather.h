// The hierarchical gather: light at many neighbouring receivers at once (spec/shading.md#gather).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/shade/gather/direction_buffer.h"
#include "engine/shade/gather/near_lists.h"
#include "engine/shade/gather/openings.h"
#include "engine/shade/gather/receiver_cell.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/kernels/disc_queue.h"
#include "engine/shade/kernels/gather_kernels.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Shades receivers in cells of an implicit octree over them. What all receivers of a cell see
/// within the angle GatherOptions::parallax is drawn once, into a buffer that the cell's children
/// inherit.
///
/// The results depend on the receivers of the call and on the options alone, not on the cache, the
/// order of pages or what was shaded before.
/// Threads: one gather for each thread.
/// Memory: a direction buffer (48 KiB at resolution 32) for each level of receiver cells, and lists
/// of what cells leave to those within them (spec/notes/lists.md).
class Gather {
 public:
  /// The number of things that a cell leaves to the cells within before it leaves near clusters
  /// unopened, too. More take more memory than a cap is charged, fewer take time
  /// (spec/notes/lists.md).
  static constexpr std::size_t kThingsLeft = 24576;

  /// @param view         must outlive the gather, as must the cache
  /// @param visibility   finds the sky through small openings, where the whole hemisphere counts;
  ///                     empty: the sky stays as it is drawn
  /// @param things_left  kThingsLeft, or fewer in a test
  Gather(const SceneView& view, PageCache& cache, const GatherOptions& options,
         const VisibilityMaker& visibility = {}, std::size_t things_left = kThingsLeft);

  /// Shades receivers.
  /// @param receivers  neighbours, in any order; a few thousand at once share best
  /// @param results    as many as receivers, in the same order
  /// @param grid       of the options' resolution; its variant also shifts the receiver cells
  /// @throws FormatError for a damaged page, unless the view notes lost pages; std::system_error
  /// @param weights    as many as receivers, or none. Receivers of weight 0 have their part in the
  ///                   cells, but no results: the others get what a call for all would give them,
  ///                   for less. (Where the sky is found through small openings, the receiver
  ///                   before has a part in it, which is then another one.)
  void shade(std::span<const Receiver> receivers, std::span<Shading> results,
             const DirectionGrid& grid, std::span<const float> weights = {});
  /// The counts of all calls so far.
  [[nodiscard]] const GatherCounts& counts() const noexcept { return counts_; }
  /// Returns the bytes of the lists of what cells leave to those within them, as long as they were
  /// in any call so far.
  [[nodiscard]] std::size_t list_bytes() const noexcept;
  /// What the receivers of the last call take of the work, if it had weights: each its share of
  /// what it has in common with the whole call, whether that was shaded or not.
  [[nodiscard]] const GatherWork& work() const noexcept { return work_; }

 private:
  /// One depth of receiver cells: what the current cell of that depth draws and leaves.
  struct Level {
    explicit Level(const GatherOptions& options) : buffer(options.resolution, options.bleeding) {}

    glm::dvec3 centre{0};  ///< lattice units
    DirectionBuffer buffer;
    NearLists left;
  };

  void place(std::span<const Receiver> from);
  void sum_weights(std::span<const float> weights);
  [[nodiscard]] double weight_of(std::span<const PlacedReceiver> cell) const;
  void add_work(std::span<const PlacedReceiver> cell, const GatherCounts& before);
  void shade_cell(std::span<const PlacedReceiver> cell, const DirectionBuffer& inherited,
                  std::size_t depth, float bound);
  void resolve(std::span<const PlacedReceiver> cell, const DirectionBuffer& drawn,
               std::size_t depth, float bound);
  const DirectionBuffer& collect(const ReceiverCell& cell, const DirectionBuffer& inherited,
                                 DirectionBuffer& own, NearLists* left, std::size_t depth,
                                 float& bound);
  std::size_t look_at_clusters(const Level& around, std::size_t from, const glm::vec3& move,
                               const CellTest& test, CellOutput& out);
  std::size_t look_at_surfels(const Level& around, std::size_t from, const glm::vec3& move,
                              const CellTest& test, CellOutput& out);
  void push(const ClusterPayload& payload);
  void look_at_group(const ChildRef& reference, const CellTest& test, CellOutput& out);
  template <class Flush>
  void look_at_run(const ChildRef& leaf, const CellTest& test, CellOutput& out, const Flush& flush);

  SceneReader scene_;
  GatherOptions options_;
  std::size_t things_left_;
  std::optional<PixelWeights> weights_;  ///< of GatherOptions::around, unless that is plain
  const DirectionGrid* grid_ = nullptr;  ///< of the current call
  GatherCounts counts_;
  std::vector<PlacedReceiver> receivers_;  ///< of the current call, along the Z-curve
  std::vector<double> weight_before_;      ///< of each receiver, and of all at the end; or empty
  GatherWork work_;
  std::span<const Receiver> given_;             ///< of the current call, in the caller's order
  std::span<Shading> results_;                  ///< of the current call
  std::vector<std::unique_ptr<Level>> levels_;  ///< by depth, made when first needed
  std::vector<ClusterPayload>
      payloads_;                       ///< clusters that the current cells left, outer cells first
  std::vector<ChildRef> stack_;        ///< nodes to visit
  std::vector<std::uint32_t> opened_;  ///< clusters to open, of those that the cell around left
  DirectionBuffer empty_, leaf_;
  DiscQueue queue_;
  std::optional<Openings> openings_;
};

}  // namespace ptc
