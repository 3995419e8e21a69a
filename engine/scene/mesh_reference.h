// Ray-traced answers on the mesh itself: what a build from surfels and a gather approximate.
#pragma once

#include <cstdint>
#include <span>

#include <glm/vec3.hpp>

#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"

namespace ptc {

/// What the rays from one receiver see.
struct RayTraced {
  float occlusion = 0;      ///< cosine-weighted share of the hemisphere that is covered, 0 to 1
  glm::vec3 irradiance{0};  ///< from light that surfaces reflect or emit, W/m^2
  glm::vec3 sky{0};         ///< from the sky where nothing covers it, W/m^2
};

/// How light reaches the surfaces that a receiver sees.
struct LightPaths {
  LightSampling sampling;  ///< numbers of shadow rays for the direct light at every hit
  /// The maximum number of reflections on the way to the receiver. 0 leaves out all light from
  /// surfaces, the light that they emit as well.
  unsigned bounces = 1;
  /// Whether the surfaces that the receiver sees add what they emit. False where the emitters'
  /// light at the receiver is asked of DirectLight, so that it would count twice.
  bool emission = true;
};

/// Traces stratified cosine rays from a receiver.
///
///     receiver ---- ray ----> hit ---- cosine ray ----> hit of the second bounce ...
///                              ^                         ^
///                              shadow rays to the lights at every hit
///
/// The radiance at a hit is its emission plus albedo / pi times the direct light there, light of
/// the sky included. A back side is black unless its material is double-sided; such a back
/// reflects, and does not emit. Light of further bounces comes along one path of cosine rays from
/// each hit. A surface at the end of such a path's ray adds its own emission only when
/// `paths.sampling.area_rays` is 0, because area rays bring that light otherwise.
///
/// The result is deterministic in `seed`. A point that step_off() finds under a contact is fully
/// occluded and receives nothing.
/// @param position  scene units, on the surface
/// @param normal    of any length; a vector without a direction gives a result of zeros
/// @param rays      number of rays; 0 gives a result of zeros
/// Threads: may be called concurrently.
[[nodiscard]] RayTraced trace_mesh(const RayScene& scene, const DirectLight& light,
                                   const glm::dvec3& position, const glm::vec3& normal,
                                   unsigned rays, const LightPaths& paths, std::uint64_t seed);
/// Traces rays along directions, unit vectors whose density above the normal goes with their
/// cosine. Otherwise as above: without directions the result is zeros.
[[nodiscard]] RayTraced trace_mesh(const RayScene& scene, const DirectLight& light,
                                   const glm::dvec3& position, const glm::vec3& normal,
                                   std::span<const glm::vec3> directions, const LightPaths& paths,
                                   std::uint64_t seed);

}  // namespace ptc
