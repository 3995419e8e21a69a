// Ray-traced answers on the true surface: what the gather approximates.
#pragma once

#include <cstdint>

#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"

namespace ptc {

/// What rays see from a receiver.
struct RayTraced {
  float occlusion = 0;      ///< cosine-weighted share of the hemisphere that is covered, 0 to 1
  glm::vec3 irradiance{0};  ///< of light that surfaces reflect or emit: pi * mean radiance at hits
  glm::vec3 sky{0};         ///< irradiance from the uncovered sky
};

/// How light gets to what a receiver sees.
struct LightPaths {
  LightSampling sampling;  ///< of direct light at every hit
  unsigned bounces =
      1;  ///< reflections before the receiver, at most; 0: no light from surfaces, emitted neither
};

/// Traces `rays` stratified cosine rays from a receiver; radiance at a hit is emission plus
/// albedo / pi times direct light there (sky included), 0 on a back side unless the material is
/// double-sided: then the back reflects, and does not emit. Light of further bounces comes along a
/// path of cosine rays, one a hit; what such a ray meets emits only when `sampling` has no area
/// rays, which bring that light otherwise. Deterministic in `seed`.
/// @param normal  of any length; without a direction there is nothing to see
[[nodiscard]] RayTraced trace_mesh(const RayScene& scene, const DirectLight& light,
                                   const glm::dvec3& position, const glm::vec3& normal,
                                   unsigned rays, const LightPaths& paths, std::uint64_t seed);

}  // namespace ptc
