// What PTCX is measured against: a ray tracer on the same scene, as a user of Embree would write
// it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "engine/base/surfel.h"
#include "engine/io/mesh/mesh.h"
#include "engine/shade/shading.h"

namespace ptc::bench {

/// Cosine-distributed Sobol-Owen rays at discs or triangles. The radiance at a hit is looked up,
/// not computed, as in a bake.
///
/// Threads: trace() may be called concurrently.
class RayBaseline {
 public:
  enum class Job {
    occlusion,  ///< any-hit rays
    bleeding,   ///< closest-hit rays: occlusion and irradiance
  };
  /// Whether Embree gets one ray at a time, or 16 rays of similar direction.
  enum class Packets { single, sixteen };

  /// Prepares oriented discs, which have their radiance on the front; their backs follow
  /// spec/shading.md#sides. Which of several coplanar discs a ray meets is not defined. The discs
  /// must outlive this.
  /// @throws std::runtime_error without an Embree device; std::bad_alloc
  RayBaseline(std::span<const Surfel> discs, Sides sides);
  /// Prepares triangles with a lightmap: every texel, about `spacing` scene units wide, has the
  /// radiance of the nearest surfel that faces its way. Backs are black.
  /// @throws std::runtime_error without an Embree device; std::bad_alloc
  RayBaseline(const Mesh& mesh, std::span<const Surfel> radiance, double spacing);
  ~RayBaseline();

  /// Shades one receiver: occlusion, and irradiance when the job asks for it.
  /// @param rays  a power of two from 16 to 65536
  /// @param seed  of the rays' directions
  /// @throws std::invalid_argument for any other number of rays
  [[nodiscard]] Shading trace(const Receiver& receiver, Job job, Packets packets, unsigned rays,
                              std::uint64_t seed) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc::bench
