// The light that reaches a surface point straight from lights and emitters.
#pragma once

#include <cstdint>
#include <optional>

#include <glm/vec3.hpp>

#include "engine/scene/light/light_rays.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/light/sky_map.h"
#include "engine/scene/ray_scene.h"

namespace ptc {

/// Direct irradiance at surface points by shadow rays. Results are deterministic: the seed fixes
/// the sample points.
/// Memory: 76 bytes for each of emitters_of(), 4 bytes for each pixel of the sky map.
/// Threads: const members may be called concurrently.
class DirectLight {
 public:
  /// Prepares the lights of a rig and the emissive triangles of the scene's mesh.
  /// @param scene  must outlive this
  /// @throws RequestError when a direction is zero, or a number is negative, not finite or out of
  ///         range
  DirectLight(const RayScene& scene, LightRig rig);

  /// Irradiance at a point, split by where it comes from, W/m^2.
  struct Result {
    glm::vec3 local{0};  ///< from suns, point and spot lights and emissive triangles
    glm::vec3 sky{0};    ///< from the sky
  };
  /// Estimates the irradiance at a point. The estimate is unbiased except for the steps off the
  /// surface, and finite whatever the arguments are.
  /// @param position  scene units, on the surface; rays begin a few epsilons off it, see step_off()
  /// @param normal    of any length; a vector without a direction receives no light
  [[nodiscard]] Result irradiance(const glm::dvec3& position, const glm::vec3& normal,
                                  const LightSampling& sampling, std::uint64_t seed) const;
  /// Estimates the irradiance at a point whose rays begin where the caller says.
  /// @param origin  scene units, as step_off() returns it
  /// @param normal  of any length but 0
  [[nodiscard]] Result irradiance(const glm::dvec3& position, const glm::dvec3& origin,
                                  const glm::vec3& normal, const LightSampling& sampling,
                                  std::uint64_t seed) const;
  /// The irradiance at a point, W/m^2: of its own scene, and with other surfaces beside that.
  struct Shaded {
    glm::vec3 alone{0}, beside{0};
  };
  /// Estimates what other surfaces leave of the light at a point. Both results are by the same
  /// rays, those of irradiance().
  /// @param others    surfaces that are not in the scene of this
  /// @param position, origin, normal, sampling, seed  as for irradiance()
  /// @return          nothing when no ray that brings light meets the others
  [[nodiscard]] std::optional<Shaded> shaded_by(const RayScene& others, const glm::dvec3& position,
                                                const glm::dvec3& origin, const glm::vec3& normal,
                                                const LightSampling& sampling,
                                                std::uint64_t seed) const;
  /// Says whether no light and no emitter shines.
  [[nodiscard]] bool is_black() const noexcept { return sky_is_black_ && rays_.empty(); }
  /// Estimates the share of the light of suns, point and spot lights that the mesh hides, as
  /// hidden_share().
  /// @param position, normal, seed  as for irradiance()
  [[nodiscard]] float shadow(const glm::dvec3& position, const glm::vec3& normal, unsigned sun_rays,
                             std::uint64_t seed) const;
  /// Returns the rig with its directions normalised.
  [[nodiscard]] const LightRig& rig() const noexcept { return rays_.rig(); }

 private:
  struct Place;
  [[nodiscard]] Result irradiance(const Place& at, const LightSampling& sampling) const;
  /// Irradiance of lights and emitters, with what is hidden and without.
  struct Sums {
    glm::vec3 arrives{0}, open{0};
  };
  [[nodiscard]] static std::optional<Place> place_at(const RayScene& scene,
                                                     const glm::dvec3& position,
                                                     const glm::vec3& normal, std::uint64_t seed);
  [[nodiscard]] Sums from_lights(const Place& at, const LightSampling& sampling) const;
  [[nodiscard]] glm::vec3 from_sky(const Place& at, unsigned rays) const;
  class OpenRays;
  template <class Take>
  void draw_sky(const Place& at, unsigned rays, const Take& take) const;
  template <class Take>
  void add_sky_ray(const Place& at, const glm::vec3& direction, float cosine_rays, float map_rays,
                   float map_density, const Take& take) const;
  [[nodiscard]] bool is_hidden(const RayScene& by, const Place& at, const LightRay& ray) const;

  const RayScene& scene_;
  LightRays rays_;
  std::optional<SkyDensity> sky_density_;  ///< set when the sky has a map that gives light
  bool sky_is_black_ = true;
};

}  // namespace ptc
