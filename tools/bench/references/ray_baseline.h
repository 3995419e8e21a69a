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

/// Cosine-distributed Sobol-Owen rays at discs or triangles; light at hits is looked up, not
/// computed, as in a bake. Threads: calls may be made concurrently.
class RayBaseline {
 public:
  enum class Job {
    occlusion,  ///< any-hit rays
    bleeding,   ///< closest-hit rays: occlusion and irradiance
  };
  enum class Packets { single, sixteen };

  /// Oriented discs, their radiance on the front; backs as spec/shading.md#sides has them. Of
  /// coplanar discs a ray meets either. They must outlive this.
  RayBaseline(std::span<const Surfel> discs, Sides sides);
  /// Triangles with a lightmap: every texel, about `spacing` wide, has the radiance of the nearest
  /// surfel that faces its way. Backs are black.
  RayBaseline(const Mesh& mesh, std::span<const Surfel> radiance, double spacing);
  ~RayBaseline();

  /// Occlusion, and irradiance when the job asks for it.
  /// @param rays  a power of two from 16 to 65536
  /// @throws std::invalid_argument at another number
  [[nodiscard]] Shading trace(const Receiver& receiver, Job job, Packets packets, unsigned rays,
                              std::uint64_t seed) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc::bench
