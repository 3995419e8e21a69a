// Shadow rays from many neighbouring places at the discs of a container, through its octree.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/trace/decoded_tree.h"
#include "engine/trace/shaft_list.h"
#include "engine/trace/trace_kernels.h"

namespace ptc {

/// Finds out which rays from places that lie close together are hidden from their lights.
///
/// Rays that have about the same direction make a beam. The tree is walked once for a beam, and
/// what the beam may pass is opened until it is no larger than the beam is wide; the rays begin at
/// these boxes:
///
///     places   ._._._._.          one walk for all rays of the beam, then
///               \ \ \ \ \         some 40 boxes for each ray
///                \ \ \ \ \  light
///
/// The answer for a ray depends on the ray and on the place around which rays start: not on the
/// cap, the threads or the other rays.
///
/// Threads: one tracer for each thread.   Memory: kBytes.
class ShadowTracer {
 public:
  /// Rays of a beam, at most.
  static constexpr std::size_t kBeam = 256;
  /// Memory of a tracer, bytes.
  static constexpr std::uint64_t kBytes = DecodedTree::kBytes + (std::uint64_t{1} << 18);

  /// @param view, cache  must outlive this; of the same container
  /// @param sides        which sides of discs stop rays
  ShadowTracer(const SceneView& view, PageCache& cache, Sides sides);

  /// Chooses the place around which the next rays begin.
  /// @param position  scene units
  void begin(const glm::dvec3& position) { place_ = tree_.place(position); }

  /// Tests rays. Those that follow one another should start at neighbouring places.
  /// @param hidden  for each ray: gets 1 when a disc lies before its end, else 0
  /// @throws FormatError when a page is damaged
  void test(std::span<const ShadowRay> rays, std::span<std::uint8_t> hidden);

 private:
  void trace_beam(std::span<const ShadowRay> rays, std::span<const std::uint32_t> beam,
                  std::span<std::uint8_t> hidden);

  DecodedTree tree_;
  glm::dvec3 place_{0};               ///< around which rays begin, lattice units
  std::vector<std::uint32_t> order_;  ///< indices of rays, by direction
  std::vector<std::uint32_t> keys_;   ///< of the rays, which order them
  ShaftList list_;
};

}  // namespace ptc
