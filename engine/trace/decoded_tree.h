// The octree of a container as rays from one origin see it.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shading.h"
#include "engine/trace/trace_boxes.h"

namespace ptc {

/// Decodes groups and leaves when they are first asked for, and keeps what was decoded last. So a
/// page is mostly looked up once for each group that rays of an origin open, not once for each ray.
///
/// Threads: one for each thread.   Memory: kBytes.
class DecodedTree {
 public:
  /// Memory of a tree, bytes.
  static constexpr std::uint64_t kBytes = std::uint64_t{5} << 18;

  /// @param view, cache  must outlive this; of the same container
  /// @param sides        which sides of discs stop rays
  DecodedTree(const SceneView& view, PageCache& cache, Sides sides);

  /// Chooses where rays start, and forgets what was decoded for another place.
  /// @param origin  scene units
  /// @param axis    unit; all rays have directions d with d . axis >= 0, and discs that lie
  ///                wholly below that horizon are left out
  /// @return        false when rays started there already, so that all is as it was
  bool begin(const glm::dvec3& origin, const glm::vec3& axis);
  /// Chooses a place around which rays of any direction start.
  /// @param origin  scene units
  /// @param reach   how far from there they start at most, edges
  void begin_around(const glm::dvec3& origin, float reach);

  /// Returns a group.
  /// @param reference  of an interior node, as it is stored (spec/nodes.md#node-group)
  /// @throws FormatError when it leads to no group, or its page is damaged
  [[nodiscard]] const TraceGroup& group(std::uint64_t reference) {
    return groups_.find(reference, [&](TraceGroup& into) { decode_group(reference, into); });
  }
  /// Returns a run of points.
  /// @param first  number of its first point
  /// @param count  at most kTraceDiscs points
  /// @throws FormatError when their page is damaged
  [[nodiscard]] const TraceLeaf& leaf(std::uint64_t first, std::uint32_t count) {
    return leaves_.find(first << 8 | count,
                        [&](TraceLeaf& into) { decode_leaf(first, count, into); });
  }
  /// Returns the radiance of the light that leaves the front of a point, W / (m^2 sr), from its
  /// page.
  /// @param emission  whether what the point emits is part of it
  /// @throws FormatError when the page is damaged
  [[nodiscard]] glm::vec3 outgoing(std::uint64_t point, bool emission);

  [[nodiscard]] const SceneView& view() const noexcept { return scene_.view(); }
  [[nodiscard]] Sides sides() const noexcept { return starts_.sides; }

 private:
  [[nodiscard]] glm::dvec3 lattice(const glm::dvec3& position) const;
  void decode_group(std::uint64_t reference, TraceGroup& into);
  void decode_leaf(std::uint64_t first, std::uint32_t count, TraceLeaf& into);

  SceneReader scene_;
  RayStarts starts_;
  DecodedTable<TraceGroup> groups_;
  DecodedTable<TraceLeaf> leaves_;
};

}  // namespace ptc
