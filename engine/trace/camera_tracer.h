// Rays of a camera at the discs of a container, through its octree.
#pragma once

#include <cstdint>
#include <span>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/trace/decoded_tree.h"
#include "engine/trace/shaft_list.h"
#include "engine/trace/trace_kernels.h"

namespace ptc {

/// Finds the discs that the samples of a picture see, tile by tile of neighbouring samples.
///
/// All rays begin at the eye, so a tile is a pyramid. The tree is walked once for it, down to what
/// is as small as the tile is wide there, and the rays begin at these boxes:
///
///             .-'|   []
///         .-' [] |[]    []       one walk for all rays of the tile, then
///     eye   -----|   []          the boxes that 8 neighbours of them may pass
///         `-. [] |[]  []
///             `-.|      []
///
/// Unlike receivers, a camera sees both sides of every disc, however near.
///
/// What a ray meets depends on the ray alone: not on the cap, the threads or the other rays.
///
/// Threads: one tracer for each thread.   Memory: kBytes.
class CameraTracer {
 public:
  /// Rays that narrow the list of their tile once more: neighbours are best.
  static constexpr std::size_t kFew = 8;
  /// Memory of a tracer, bytes.
  static constexpr std::uint64_t kBytes = DecodedTree::kBytes + (std::uint64_t{1} << 18);

  /// @param view, cache  must outlive this; of the same container
  /// @param eye          where the rays begin, scene units
  /// @param axes         of the camera, unit and at right angles; the third points forward
  CameraTracer(const SceneView& view, PageCache& cache, const glm::dvec3& eye,
               const glm::mat3& axes);

  /// Lets the rays of a tile meet the discs of the scene.
  /// @param directions  each with a part of 1 along the third axis; any kFew that follow one
  ///                    another should be neighbours
  /// @param hits        as many as directions; replaced where a disc is nearer. Depths are those of
  ///                    spec/shading.md#surfels along the third axis
  /// @throws FormatError when a page is damaged
  void meet(std::span<const glm::vec3> directions, std::span<RayHit> hits);

  /// Pins the page that holds the point of a hit.
  /// @throws FormatError when the page is damaged
  [[nodiscard]] PageGuard page_of(const RayHit& hit) { return tree_.page_of(hit.point); }

 private:
  DecodedTree tree_;
  glm::dvec3 place_;  ///< of the eye, lattice units
  glm::mat3 axes_;
  ShaftList list_;
  BoxList few_;
};

}  // namespace ptc
