// Exact rays at the discs of a container, through its octree.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/trace/decoded_tree.h"
#include "engine/trace/trace_kernels.h"

namespace ptc {

/// Traces the rays of one receiver after another.
///
/// Most of a ray's way down the tree lies near its origin, and is the same for all rays of a
/// receiver. So these begin at a list of boxes, once for a receiver: what is larger than its
/// distance is opened, and what lies below the horizon is left out. Tiles of neighbouring rays
/// narrow the list to what they can meet, and a few of each tile do so again:
///
///     tree  -- once a receiver -->  200 boxes  -- once a tile -->  80  -- for each 8 -->  rays
///
/// What a ray meets depends on the ray alone: not on the cap, the threads, the order of pages or
/// the other rays.
///
/// Threads: one tracer for each thread.   Memory: kBytes.
class DiscTracer {
 public:
  /// Rays that share a narrowed list: neighbours are best.
  static constexpr std::size_t kTile = 32;
  /// Rays of a tile that share a list narrowed once more.
  static constexpr std::size_t kFew = 8;
  /// Memory of a tracer, bytes.
  static constexpr std::uint64_t kBytes = DecodedTree::kBytes + (std::uint64_t{1} << 18);

  /// @param view, cache  must outlive this; of the same container
  /// @param sides        which sides of discs stop rays
  DiscTracer(const SceneView& view, PageCache& cache, Sides sides);

  /// Chooses where the next rays start.
  /// @param origin  scene units
  /// @param axis    unit; the rays' directions d have d . axis >= 0
  /// @throws FormatError when a page is damaged
  void begin(const glm::dvec3& origin, const glm::vec3& axis);

  /// Lets rays meet the discs of the scene.
  /// @param directions  unit; in an order in which neighbours have like directions
  /// @param wanted      any: rays stop at the first disc that they find, and only
  ///                    RayHit::met() means something
  /// @param hits        as many as directions; replaced where a disc is nearer
  /// @throws FormatError when a page is damaged
  void meet(std::span<const glm::vec3> directions, RaysFor wanted, std::span<RayHit> hits);

  /// Returns the radiance that a ray which has met a disc sees, W / (m^2 sr), from the page of the
  /// disc's point.
  /// @param emission  whether what the disc emits is part of it
  /// @throws FormatError when the page is damaged
  [[nodiscard]] glm::vec3 radiance(const RayHit& hit, bool emission = true) {
    return hit.back ? glm::vec3(0) : tree_.outgoing(hit.point, emission);
  }

 private:
  /// Says whether no ray can meet a disc of a leaf.
  [[nodiscard]] bool is_empty(const ChildRef& leaf);

  DecodedTree tree_;
  glm::dvec3 place_{0};  ///< where rays begin, lattice units
  glm::vec3 axis_{0};
  std::vector<ListedBox> items_;
  std::vector<std::uint64_t> opened_;  ///< references of groups to look at
  std::vector<std::uint64_t> words_;   ///< references of the list's boxes
  BoxList list_, tile_, few_;
  bool listed_ = false;  ///< whether the list is whole, and belongs to place_ and axis_
};

}  // namespace ptc
