// Rays from a surface point to suns, lamps and emitters: where they go, and what they bring where
// nothing is in the way.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/light/area_lights.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// Returns the rig with its directions normalised.
/// @throws RequestError when a direction is zero, or a number is negative, not finite or out of
///         range
[[nodiscard]] LightRig normalised(LightRig rig);

/// A ray from a surface point to a light.
struct LightRay {
  glm::vec3 direction{0};   ///< unit, towards a sun; for other lights `end` says where they are
  bool ends = false;        ///< false: a sun, infinitely far away
  glm::dvec3 end{0};        ///< place of the light, scene units
  glm::vec3 end_normal{0};  ///< unit, of an emitter; zero for lamps without extent
  glm::vec3 irradiance{0};  ///< what the ray brings when nothing is in the way, W/m^2
};

/// Draws rays to all lights of a rig but its sky, and to emitters.
/// Memory: 76 bytes for each emitter.   Threads: const members may be called concurrently.
class LightRays {
 public:
  /// @param rig       normalised()
  /// @param emitters  relative to `origin`
  /// @param origin    scene units
  /// @param closest   lamps that are no farther away than this bring nothing, scene units
  LightRays(LightRig rig, std::vector<Emitter> emitters, const glm::dvec3& origin, double closest);

  /// Draws rays whose irradiances, summed over those that nothing stops, are an unbiased estimate
  /// of the light at a point.
  /// @param position  scene units
  /// @param normal    unit
  /// @param seed      fixes the sample points; each kind of light takes its own of them
  /// @param turn      number of this point among those that share the seed, whose samples are
  ///                  spread together
  /// @param out       is overwritten; lights behind the surface have no rays
  void draw(const glm::dvec3& position, const glm::vec3& normal, const LightSampling& sampling,
            std::uint64_t seed, std::uint32_t turn, std::vector<LightRay>& out) const;
  /// Says whether there is no light at all.
  [[nodiscard]] bool empty() const noexcept;
  [[nodiscard]] const LightRig& rig() const noexcept { return rig_; }

 private:
  void add_sun(const Sun& sun, const glm::vec3& normal, const SquarePoints& points, unsigned rays,
               std::uint32_t turn, std::vector<LightRay>& out) const;
  void add_point(const PointLight& point, const glm::dvec3& position, const glm::vec3& normal,
                 std::vector<LightRay>& out) const;

  LightRig rig_;
  AreaLights area_;
  glm::dvec3 origin_;
  double closest_;
};

/// Returns the share of a light that something hides, by luminance (Rec. 709), 0 to 1; 1 where none
/// could arrive at all.
/// @param arrives  irradiance that arrives, W/m^2
/// @param open     irradiance that would arrive if nothing hid it, W/m^2
[[nodiscard]] float hidden_share(const glm::vec3& arrives, const glm::vec3& open) noexcept;

/// The kinds of light, each of which takes its own sample points; the numbers of suns follow.
enum class LightKind : std::uint64_t { sky = 1, sky_map, area, first_sun };

/// Returns the sample points of one kind of light at a point, unrelated to those of another.
/// @param seed    of the point
/// @param number  of the sun
[[nodiscard]] inline SquarePoints light_points(std::uint64_t seed, LightKind kind,
                                               std::uint64_t number = 0) {
  return SquarePoints(splitmix64(seed) + static_cast<std::uint64_t>(kind) + number);
}

}  // namespace ptc
