// The gather of one receiver by itself: a cut through the octree, nothing shared, no vectors.
#pragma once

#include <algorithm>
#include <cstdint>

#include "engine/shade/gather/direction_buffer.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Height of the top of a thing over a receiver's horizon (spec/shading.md#horizon): of a ball, or
/// of a slab where that is less.
/// @param to  of the middle, from the receiver   @param slab_normal  unit; zero: a ball
[[nodiscard]] float height_of_top(const glm::vec3& to, const glm::vec3& normal, float radius,
                                  const glm::vec3& slab_normal, float thickness);

struct ClusterShape {
  glm::vec3 mean{0};  ///< normal over area, not unit
  float area = 0;
  float radius = 0;     ///< of the bounding sphere
  float thickness = 0;  ///< of the slab across the mean normal
};

/// A disc in place of a cluster.
struct Splat {
  glm::vec3 normal{0};
  float radius = 0;
  bool one_surfel =
      false;  ///< its back is black; else it faces the receiver and is dimmed by what does not
};

/// What a cluster is drawn as (spec/shading.md#splats).
/// @param toward     unit, from the cluster to the receiver
/// @param projected  area of its fronts or of its backs as the receiver sees them, the greater;
/// above 0
[[nodiscard]] Splat make_splat(const ClusterShape& shape, const glm::vec3& toward, float projected,
                               float inflation);

/// What the light of a cluster's fronts is spread over, to be the radiance of its splat.
/// @param front  projected area of its fronts   @param projected  as for make_splat
[[nodiscard]] inline float lit_area(const Splat& splat, float front, float projected) {
  return splat.one_surfel ? front : std::max(front, kDark * projected);
}

/// Shades receivers one at a time by the rules of spec/shading.md#gather, written a second time:
/// what the hierarchical gather is tested and timed against. One per thread. Source: Kontkanen,
/// Tabellion and Overbeck 2011, section 3, with exact discs for their splats.
class PlainGather {
 public:
  PlainGather(const SceneView& view, PageCache& cache, const GatherOptions& options)
      : scene_(view, cache), options_(options), buffer_(options.resolution) {}

  /// @param grid  of the options' resolution
  [[nodiscard]] Shading shade(const Receiver& receiver, const DirectionGrid& grid);
  [[nodiscard]] const GatherCounts& counts() const noexcept { return counts_; }

 private:
  void visit_group(const ChildRef& reference, const Receiver& receiver);
  void visit_points(const ChildRef& run, const Receiver& receiver);

  SceneReader scene_;
  GatherOptions options_;
  const DirectionGrid* grid_ = nullptr;  // of the call
  GatherCounts counts_;
  DirectionBuffer buffer_;
  DiscQueue queue_;
  std::vector<ChildRef> stack_;
};

}  // namespace ptc
