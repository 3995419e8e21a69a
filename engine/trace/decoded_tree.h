// The octree of a container as rays see it.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shading.h"
#include "engine/trace/trace_boxes.h"

namespace ptc {

/// Decodes groups and leaves when they are first asked for, and keeps what was decoded last. What
/// lies far from a ray's beginning is met from many places, so it is seldom decoded anew. Where the
/// view passes over damaged pages, rays meet nothing of what needs one; only a damaged page of the
/// root is an error then.
///
/// Threads: one for each thread.   Memory: kBytes.
class DecodedTree {
 public:
  /// Memory of a tree, bytes.
  static constexpr std::uint64_t kBytes = std::uint64_t{5} << 18;

  /// @param view, cache  must outlive this; of the same container
  /// @param backs        as TraceRules::clear_backs
  /// @param rim          radius of discs over their own, 1 or kRim
  DecodedTree(const SceneView& view, PageCache& cache, float backs, float rim);

  /// Returns a place in lattice units, within what floats can square.
  /// @param position  scene units
  [[nodiscard]] glm::dvec3 place(const glm::dvec3& position) const;
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
  /// Pins the page that holds a point. Nothing may be decoded while it is pinned.
  /// @throws FormatError when the page is damaged
  [[nodiscard]] PageGuard page_of(std::uint64_t point) { return scene_.points(point); }

  [[nodiscard]] const SceneView& view() const noexcept { return scene_.view(); }
  [[nodiscard]] const TraceRules& rules() const noexcept { return rules_; }

 private:
  void decode_group(std::uint64_t reference, TraceGroup& into);
  void decode_leaf(std::uint64_t first, std::uint32_t count, TraceLeaf& into);

  SceneReader scene_;
  TraceRules rules_;
  DecodedTable<TraceGroup> groups_;
  DecodedTable<TraceLeaf> leaves_;
};

}  // namespace ptc
