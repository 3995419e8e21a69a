// The hierarchical gather: light at many neighbouring receivers at once (spec/shading.md#gather).
#pragma once

#include <memory>
#include <span>

#include "engine/shade/gather/direction_buffer.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Shades receivers in cells of an implicit octree over them: what all receivers of a cell see
/// within `parallax` is drawn once, into a buffer that the cell's children inherit. One per thread.
///
/// Results depend on the receivers of the call and on the options, not on the cache, the order of
/// pages or what was shaded before.
/// Memory: a direction buffer (48 KiB at resolution 32) per level of receiver cells, and lists.
class Gather {
 public:
  Gather(const SceneView& view, PageCache& cache, const GatherOptions& options);
  ~Gather();

  /// @param receivers  neighbours, in any order; a few thousand share best
  /// @param results    as many
  /// @param grid       of the options' resolution; its variant shifts the cells too
  void shade(std::span<const Receiver> receivers, std::span<Shading> results,
             const DirectionGrid& grid);
  [[nodiscard]] const GatherCounts& counts() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
