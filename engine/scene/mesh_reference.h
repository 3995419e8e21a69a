// Ray-traced answers on the true surface: what the gather approximates.
#pragma once

#include <cstdint>

#include "engine/scene/lights.h"
#include "engine/scene/ray_scene.h"

namespace ptc {

/// What rays see from a receiver.
struct RayTraced {
  float occlusion = 0;      ///< cosine-weighted share of the hemisphere that is covered, 0 to 1
  glm::vec3 irradiance{0};  ///< of light that surfaces reflect or emit: pi * mean radiance at hits
  glm::vec3 sky{0};         ///< irradiance from the uncovered sky
};

/// Traces `rays` stratified cosine rays from a receiver; radiance at a hit is emission plus
/// albedo / pi times direct light there (sky included), 0 on a back side unless the material is
/// double-sided: then the back reflects, and does not emit. Deterministic in `seed`.
/// @param normal  of any length; without a direction there is nothing to see
[[nodiscard]] RayTraced trace_mesh(const RayScene& scene, const DirectLight& light,
                                   const glm::dvec3& position, const glm::vec3& normal,
                                   unsigned rays, const LightSampling& sampling,
                                   std::uint64_t seed);

}  // namespace ptc
