// Direct irradiance at a surface point: suns, point lights, spot lights and emissive triangles by
// the rays of light_rays.h, and the sky by cosine rays and, with a map, as many rays by its
// brightness, combined by the balance heuristic (Veach and Guibas 1995).
//
//                  n
//                  |    / ray, from an origin that is clear of the surface (step_off.h)
//                  |   /
//     -------------x-------------
//
// Each kind takes its own scrambled Sobol sequence, so that the errors of two kinds are unrelated.
#include "engine/scene/light/direct_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/scene/sampling/directions.h"
#include "engine/scene/step_off.h"

namespace ptc {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

bool is_finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
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
};

DirectLight::DirectLight(const RayScene& scene, LightRig rig)
    : scene_(scene),
      rays_(normalised(std::move(rig)), emitters_of(scene.mesh()), scene.mesh().origin,
            scene.epsilon()) {
  const Sky& sky = rays_.rig().sky;
  if (sky.map && sky.map->size() > 0 && is_lit(sky.radiance)) sky_density_.emplace(sky);
  sky_is_black_ = !is_lit(sky.radiance) || (sky_density_ && sky_density_->is_black());
}

std::optional<DirectLight::Place> DirectLight::place_at(const RayScene& scene,
                                                        const glm::dvec3& position,
                                                        const glm::vec3& normal,
                                                        std::uint64_t seed) {
  const glm::vec3 unit = glm::normalize(normal);
  if (!is_finite(unit) || !std::isfinite(glm::dot(position, position))) return std::nullopt;
  const std::optional<glm::dvec3> origin = step_off(scene, position, unit);
  if (!origin) return std::nullopt;
  return Place{position, *origin, unit, seed};
}

DirectLight::Sums DirectLight::from_lights(const Place& at, const LightSampling& sampling) const {
  thread_local std::vector<LightRay> rays;
  rays_.draw(at.position, at.normal, sampling, at.seed, 0, rays);
  Sums sums;
  for (const LightRay& ray : rays) {
    sums.open += ray.irradiance;
    if (!is_hidden(scene_, at, ray)) sums.arrives += ray.irradiance;
  }
  return sums;
}

bool DirectLight::is_hidden(const RayScene& by, const Place& at, const LightRay& ray) const {
  if (!ray.ends) return by.occluded(at.origin, ray.direction, 0, kFar);
  // End a ray a little before its emitter, as it begins a little off the receiver
  const glm::dvec3 end = ray.end + 2 * scene_.epsilon() * glm::dvec3(ray.end_normal);
  const glm::dvec3 offset = end - at.origin;
  const double distance = glm::length(offset);
  return distance > 0 && by.occluded(at.origin, glm::vec3(offset / distance), 0, distance);
}

// Sums up the light of rays from one place, which are traced as many at once as RayScene takes.
class DirectLight::OpenRays {
 public:
  OpenRays(const RayScene& scene, const Place& at) : scene_(scene), at_(at) {}

  // @param light  what the ray brings when nothing is in the way
  void add(const glm::vec3& direction, const glm::vec3& light) {
    directions_[size_] = direction;
    lights_[size_] = light;
    if (++size_ == directions_.size()) trace();
  }

  [[nodiscard]] glm::vec3 sum() {
    if (size_ > 0) trace();
    return sum_;
  }

 private:
  void trace() {
    const std::uint32_t hidden =
        scene_.occluded(at_.origin, std::span(directions_).first(size_), 0, kFar);
    for (std::size_t i = 0; i < size_; ++i) {
      if ((hidden >> i & 1U) == 0) sum_ += lights_[i];
    }
    size_ = 0;
  }

  const RayScene& scene_;
  const Place& at_;
  std::array<glm::vec3, RayScene::kRaysAtOnce> directions_{}, lights_{};
  std::size_t size_ = 0;
  glm::vec3 sum_{0};
};

// Weighs a ray by the balance heuristic: L cos over the sum of all densities that could have
// brought its direction, each times its number of rays (Veach and Guibas 1995). So a direction that
// both samplings may bring does not count twice.
template <class Take>
void DirectLight::add_sky_ray(const Place& at, const glm::vec3& direction, float cosine_rays,
                              float map_rays, float map_density, const Take& take) const {
  const float cosine = glm::dot(at.normal, direction);
  if (cosine <= 0) return;
  const glm::vec3 light = rays_.rig().sky.at(direction);
  if (!is_lit(light)) return;
  take(direction, light * (cosine / (cosine_rays * cosine / kPi + map_rays * map_density)));
}

// Calls take(direction, light) for each ray to the sky, with what it brings when nothing is in the
// way.
template <class Take>
void DirectLight::draw_sky(const Place& at, unsigned rays, const Take& take) const {
  // Divide the rays among the two densities.
  if (sky_is_black_ || rays == 0) return;
  const unsigned map_rays = sky_density_ ? rays / 2 : 0;
  const unsigned cosine_rays = rays - map_rays;
  const auto by_cosine = static_cast<float>(cosine_rays);
  const auto by_map = static_cast<float>(map_rays);
  const Basis frame(at.normal);
  // Add rays by the cosine.
  const SquarePoints hemisphere = light_points(at.seed, LightKind::sky);
  for (std::uint32_t i = 0; i < cosine_rays; ++i) {
    const glm::vec3 direction = frame.to_world(cosine_direction(hemisphere.square(i)));
    const float density = map_rays > 0 ? sky_density_->density(direction) : 0;
    add_sky_ray(at, direction, by_cosine, by_map, density, take);
  }
  // Add rays by the brightness of the map.
  const SquarePoints map = light_points(at.seed, LightKind::sky_map);
  for (std::uint32_t i = 0; i < map_rays; ++i) {
    const SkyDensity::Sample sample = sky_density_->sample(map.square(i));
    add_sky_ray(at, sample.direction, by_cosine, by_map, sample.density, take);
  }
}

glm::vec3 DirectLight::from_sky(const Place& at, unsigned rays) const {
  OpenRays open(scene_, at);
  draw_sky(at, rays,
           [&](const glm::vec3& direction, const glm::vec3& light) { open.add(direction, light); });
  return open.sum();
}

std::optional<DirectLight::Shaded> DirectLight::shaded_by(
    const RayScene& others, const glm::dvec3& position, const glm::dvec3& origin,
    const glm::vec3& normal, const LightSampling& sampling, std::uint64_t seed) const {
  const Place at{position, origin, glm::normalize(normal), seed};
  // Draw all rays, those to the sky behind the others
  thread_local std::vector<LightRay> rays;
  rays_.draw(at.position, at.normal, sampling, at.seed, 0, rays);
  const std::size_t lamps = rays.size();
  draw_sky(at, sampling.sky_rays, [&](const glm::vec3& direction, const glm::vec3& light) {
    rays.push_back({.direction = direction, .irradiance = light});
  });
  // Find those that meet the others
  thread_local std::vector<bool> meets;
  meets.assign(rays.size(), false);
  bool any = false;
  for (std::size_t i = 0; i < lamps; ++i) any |= meets[i] = is_hidden(others, at, rays[i]);
  std::array<glm::vec3, RayScene::kRaysAtOnce> directions{};
  const auto trace_sky = [&](const RayScene& scene, const auto& note) {
    for (std::size_t from = lamps; from < rays.size(); from += directions.size()) {
      const std::size_t count = std::min(directions.size(), rays.size() - from);
      for (std::size_t i = 0; i < count; ++i) directions[i] = rays[from + i].direction;
      const std::uint32_t hidden =
          scene.occluded(at.origin, std::span(directions).first(count), 0, kFar);
      for (std::size_t i = 0; i < count; ++i) note(from + i, (hidden >> i & 1U) != 0);
    }
  };
  trace_sky(others, [&](std::size_t ray, bool hidden) { any |= meets[ray] = hidden; });
  if (!any) return std::nullopt;
  // Add up what the own surfaces let through
  Shaded light;
  const auto add = [&](std::size_t ray, bool hidden) {
    if (hidden) return;
    light.alone += rays[ray].irradiance;
    if (!meets[ray]) light.beside += rays[ray].irradiance;
  };
  for (std::size_t i = 0; i < lamps; ++i) add(i, is_hidden(scene_, at, rays[i]));
  trace_sky(scene_, add);
  if (!is_finite(light.alone)) return std::nullopt;
  return light;
}

DirectLight::Result DirectLight::irradiance(const glm::dvec3& position, const glm::vec3& normal,
                                            const LightSampling& sampling,
                                            std::uint64_t seed) const {
  const std::optional<Place> at = place_at(scene_, position, normal, seed);
  return at ? irradiance(*at, sampling) : Result{};
}

DirectLight::Result DirectLight::irradiance(const glm::dvec3& position, const glm::dvec3& origin,
                                            const glm::vec3& normal, const LightSampling& sampling,
                                            std::uint64_t seed) const {
  return irradiance({position, origin, glm::normalize(normal), seed}, sampling);
}

DirectLight::Result DirectLight::irradiance(const Place& at, const LightSampling& sampling) const {
  // Add up the lights. A result that overflows counts as black.
  Result result;
  result.local = from_lights(at, sampling).arrives;
  result.sky = from_sky(at, sampling.sky_rays);
  if (!is_finite(result.local)) result.local = glm::vec3(0);
  if (!is_finite(result.sky)) result.sky = glm::vec3(0);
  return result;
}

float DirectLight::shadow(const glm::dvec3& position, const glm::vec3& normal, unsigned sun_rays,
                          std::uint64_t seed) const {
  const std::optional<Place> at = place_at(scene_, position, normal, seed);
  if (!at) return 1;
  const Sums sums = from_lights(*at, {.sun_rays = sun_rays, .area_rays = 0, .sky_rays = 0});
  return hidden_share(sums.arrives, sums.open);
}

}  // namespace ptc
