// Direct irradiance at a surface point: suns, point lights, spot lights, emissive triangles and the
// sky, each by its own shadow rays.
//
// The irradiance is the integral of radiance times cosine over the hemisphere, and each kind of
// light has the estimator that suits it:
//
//     sun        directions uniform over its projected disc; each stands for an equal share
//     point      one ray; intensity times cosine over distance squared
//     spot       as a point light, times the share of its intensity in that direction
//     emitters   places chosen by what each emitter may give (area_lights.h)
//     sky        cosine rays, and with a map as many rays by its brightness, combined by the
//                balance heuristic (Veach and Guibas 1995)
//
//                  n
//                  |    / ray, from an origin that is clear of the surface (step_off.h)
//                  |   /
//     -------------x-------------
//
// Each kind takes its own scrambled Sobol sequence, so that the errors of two kinds are unrelated.
#include "engine/scene/light/direct_light.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/scene/sampling/directions.h"
#include "engine/scene/step_off.h"

namespace ptc {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

enum Kind : std::uint64_t { kSky = 1, kSkyMap, kArea, kFirstSun };

bool is_finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Returns the rig with its directions normalised.
// @throws RequestError when a number makes no sense
LightRig checked(LightRig rig) {
  check_lights(rig);
  for (Sun& sun : rig.suns) sun.to_sun = glm::normalize(sun.to_sun);
  for (SpotLight& spot : rig.spots) spot.direction = glm::normalize(spot.direction);
  rig.sky.up = glm::normalize(rig.sky.up);
  return rig;
}

bool is_lit(const glm::vec3& light) {
  return light.x > 0 || light.y > 0 || light.z > 0;
}

}  // namespace

// A place where light is received.
struct DirectLight::Place {
  glm::dvec3 position;  // on the surface
  glm::dvec3 origin;    // where rays begin: clear of the surface
  glm::vec3 normal;     // unit
  std::uint64_t seed;

  // Returns the sample points for one kind of light, unrelated to those for another.
  [[nodiscard]] SquarePoints points(std::uint64_t kind) const {
    return SquarePoints(splitmix64(seed) + kind);
  }
};

DirectLight::DirectLight(const RayScene& scene, LightRig rig)
    : scene_(scene), rig_(checked(std::move(rig))), area_(scene.mesh()) {
  if (rig_.sky.map && !rig_.sky.map->pixels.empty() && is_lit(rig_.sky.radiance)) {
    sky_density_.emplace(rig_.sky);
  }
  sky_is_black_ = !is_lit(rig_.sky.radiance) || (sky_density_ && sky_density_->is_black());
}

// The disc of the sun has one radiance, so directions are drawn with a density in proportion to the
// cosine to its middle. That is the measure of "irradiance on a surface that faces the sun", so
// each ray stands for the same share of it, and its irradiance on the receiver is that share times
// the cosine at the receiver over the cosine to the middle.
glm::vec3 DirectLight::from_sun(const Sun& sun, const Place& at, const SquarePoints& points,
                                unsigned rays) const {
  const float widest = std::sin(std::min(sun.angular_radius, 0.5f * kPi));
  if (rays == 0 || glm::dot(at.normal, sun.to_sun) <= -widest) return glm::vec3(0);
  if (widest == 0) rays = 1;
  const Basis frame(sun.to_sun);
  float sum = 0;
  for (std::uint32_t i = 0; i < rays; ++i) {
    const glm::vec3 local =
        widest > 0 ? cosine_direction(points.square(i), widest) : glm::vec3(0, 0, 1);
    const glm::vec3 direction = frame.to_world(local);
    const float cosine = glm::dot(at.normal, direction);
    if (cosine <= 0 || local.z <= 0 || scene_.occluded(at.origin, direction, 0, kFar)) continue;
    sum += cosine / local.z;
  }
  return sun.irradiance * (sum / static_cast<float>(rays));
}

// Measures distances and angles at the surface; only the shadow ray begins off it.
glm::vec3 DirectLight::from_point(const PointLight& point, const Place& at) const {
  const glm::dvec3 offset = point.position - at.position;
  const double distance = glm::length(offset);
  if (!(distance > scene_.epsilon())) return glm::vec3(0);
  const double cosine = glm::dot(glm::dvec3(at.normal), offset) / distance;
  if (cosine <= 0 || is_hidden(at, point.position)) return glm::vec3(0);
  return point.intensity * static_cast<float>(cosine / (distance * distance));
}

glm::vec3 DirectLight::from_spot(const SpotLight& spot, const Place& at) const {
  const auto share = static_cast<float>(spot_share(spot, at.position));
  if (share == 0) return glm::vec3(0);
  return from_point({.position = spot.position, .intensity = share * spot.intensity}, at);
}

glm::vec3 DirectLight::from_emitters(const Place& at, unsigned rays) const {
  if (area_.empty() || rays == 0) return glm::vec3(0);
  thread_local std::vector<EmitterSample> samples;
  const glm::vec3 local(at.position - scene_.mesh().origin);
  area_.sample(local, at.normal, rays, splitmix64(at.seed) + kArea, samples);
  glm::vec3 sum(0);
  for (const EmitterSample& sample : samples) {
    // End the ray a little before the emitter, as it begins a little off the receiver.
    const glm::dvec3 end = scene_.mesh().origin + glm::dvec3(sample.position) +
                           2 * scene_.epsilon() * glm::dvec3(sample.normal);
    if (!is_hidden(at, end)) sum += sample.irradiance;
  }
  return sum;
}

bool DirectLight::is_hidden(const Place& at, const glm::dvec3& end) const {
  const glm::dvec3 offset = end - at.origin;
  const double distance = glm::length(offset);
  return distance > 0 && scene_.occluded(at.origin, glm::vec3(offset / distance), 0, distance);
}

// Weighs a ray by the balance heuristic: L cos over the sum of all densities that could have
// brought its direction, each times its number of rays (Veach and Guibas 1995). So a direction that
// both samplings may bring does not count twice.
glm::vec3 DirectLight::along_sky_ray(const Place& at, const glm::vec3& direction, float cosine_rays,
                                     float map_rays, float map_density) const {
  const float cosine = glm::dot(at.normal, direction);
  if (cosine <= 0) return glm::vec3(0);
  const glm::vec3 light = rig_.sky.at(direction);
  if (!is_lit(light) || scene_.occluded(at.origin, direction, 0, kFar)) return glm::vec3(0);
  return light * (cosine / (cosine_rays * cosine / kPi + map_rays * map_density));
}

glm::vec3 DirectLight::from_sky(const Place& at, unsigned rays) const {
  // Divide the rays among the two densities.
  if (sky_is_black_ || rays == 0) return glm::vec3(0);
  const unsigned map_rays = sky_density_ ? rays / 2 : 0;
  const unsigned cosine_rays = rays - map_rays;
  const auto by_cosine = static_cast<float>(cosine_rays);
  const auto by_map = static_cast<float>(map_rays);
  const Basis frame(at.normal);
  glm::vec3 sum(0);
  // Trace rays by the cosine.
  const SquarePoints hemisphere = at.points(kSky);
  for (std::uint32_t i = 0; i < cosine_rays; ++i) {
    const glm::vec3 direction = frame.to_world(cosine_direction(hemisphere.square(i)));
    const float density = map_rays > 0 ? sky_density_->density(direction) : 0;
    sum += along_sky_ray(at, direction, by_cosine, by_map, density);
  }
  // Trace rays by the brightness of the map.
  const SquarePoints map = at.points(kSkyMap);
  for (std::uint32_t i = 0; i < map_rays; ++i) {
    const SkyDensity::Sample sample = sky_density_->sample(map.square(i));
    sum += along_sky_ray(at, sample.direction, by_cosine, by_map, sample.density);
  }
  return sum;
}

DirectLight::Result DirectLight::irradiance(const glm::dvec3& position, const glm::vec3& normal,
                                            const LightSampling& sampling,
                                            std::uint64_t seed) const {
  const glm::vec3 unit = glm::normalize(normal);
  if (!is_finite(unit) || !std::isfinite(glm::dot(position, position))) return {};
  const std::optional<glm::dvec3> origin = step_off(scene_, position, unit);
  if (!origin) return {};
  // Add up the lights. A result that overflows counts as black.
  const Place at{position, *origin, unit, seed};
  Result result;
  for (std::size_t i = 0; i < rig_.suns.size(); ++i) {
    result.local += from_sun(rig_.suns[i], at, at.points(kFirstSun + i), sampling.sun_rays);
  }
  for (const PointLight& point : rig_.points) result.local += from_point(point, at);
  for (const SpotLight& spot : rig_.spots) result.local += from_spot(spot, at);
  result.local += from_emitters(at, sampling.area_rays);
  result.sky = from_sky(at, sampling.sky_rays);
  if (!is_finite(result.local)) result.local = glm::vec3(0);
  if (!is_finite(result.sky)) result.sky = glm::vec3(0);
  return result;
}

}  // namespace ptc
