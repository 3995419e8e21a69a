// The gather of one receiver by itself: a cut through the octree, without sharing and without
// vector instructions.
#pragma once

#include <algorithm>
#include <cstdint>

#include "engine/shade/gather/direction_buffer.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Returns the height of a thing's top over a receiver's horizon (spec/shading.md#horizon): that of
/// its bounding sphere or that of its slab, whichever is less.
/// @param to           middle of the thing, relative to the receiver
/// @param normal       of the receiver, unit
/// @param radius       of the sphere; the slab reaches as far across its normal
/// @param slab_normal  unit; zero where there is no slab
/// @param thickness    of the slab, on each side of its middle
[[nodiscard]] float height_of_top(const glm::vec3& to, const glm::vec3& normal, float radius,
                                  const glm::vec3& slab_normal, float thickness);

/// The shape of a cluster, lengths in scene units.
struct ClusterShape {
  glm::vec3 mean{0};    ///< sum of area times normal over the area; not unit
  float area = 0;       ///< scene units squared
  float radius = 0;     ///< of the bounding sphere
  float thickness = 0;  ///< of the slab across the mean normal
};

/// The disc that is drawn in place of a cluster.
struct Splat {
  glm::vec3 normal{0};  ///< unit
  float radius = 0;     ///< scene units
  /// Whether the disc is drawn as one surfel, with a black back. Any other disc faces the receiver,
  /// and the backs in the cluster dim it.
  bool one_surfel = false;
};

/// Returns the unit direction from which a cluster shows the area and the light that it is drawn
/// with: along the mean normal of a sheet or against it, on the side of the receiver, and towards
/// the receiver for any other cluster.
/// @param toward  unit, from the cluster to the receiver
[[nodiscard]] glm::vec3 seen_from(const ClusterShape& shape, const glm::vec3& toward);

/// Returns the disc that a cluster is drawn as (spec/shading.md#splats).
/// @param toward     unit, from the cluster to the receiver
/// @param projected  area of its fronts or of its backs from seen_from(), whichever is greater;
///                   above 0
/// @param inflation  GatherOptions::inflation
[[nodiscard]] Splat make_splat(const ClusterShape& shape, const glm::vec3& toward, float projected,
                               float inflation);

/// Returns the area that the light of a cluster's fronts is spread over: front radiance times front
/// area, divided by this, is the radiance of the splat.
/// @param front      projected area of the cluster's fronts, over its area
/// @param projected  greater projected area of fronts and backs, over its area
[[nodiscard]] inline float lit_area(const Splat& splat, float front, float projected) {
  return splat.one_surfel ? front : std::max(front, kDark * projected);
}

/// Shades receivers one at a time by the rules of spec/shading.md#gather, written a second time.
/// The hierarchical gather is tested and timed against it. Threads: one object for each thread.
/// Source: Kontkanen, Tabellion and Overbeck 2011, section 3, with exact discs for their splats.
class PlainGather {
 public:
  /// Takes a reader of the cache. @param view, cache  must outlive this
  PlainGather(const SceneView& view, PageCache& cache, const GatherOptions& options)
      : scene_(view, cache), options_(options), buffer_(options.resolution) {}

  /// Shades one receiver.
  /// @param grid  has the resolution of the options
  /// @throws FormatError when a page is damaged or a reference leads nowhere
  [[nodiscard]] Shading shade(const Receiver& receiver, const DirectionGrid& grid);
  /// Returns the counts over all receivers so far.
  [[nodiscard]] const GatherCounts& counts() const noexcept { return counts_; }

 private:
  /// Draws or opens the children of a group.
  void visit_group(const ChildRef& reference, const Receiver& receiver);
  /// Draws the points of a leaf.
  void visit_points(const ChildRef& run, const Receiver& receiver);

  SceneReader scene_;
  GatherOptions options_;
  const DirectionGrid* grid_ = nullptr;  ///< of the current call
  GatherCounts counts_;
  DirectionBuffer buffer_;
  DiscQueue queue_;
  std::vector<ChildRef> stack_;  ///< nodes that are still to be visited
};

}  // namespace ptc
