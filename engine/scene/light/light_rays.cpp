// Each kind of light has the estimator that suits it:
//
//     sun        directions uniform over its projected disc; each stands for an equal share
//     point      one ray; intensity times cosine over distance squared
//     spot       as a point light, times the share of its intensity in that direction
//     emitters   places chosen by what each emitter may give (area_lights.h)
#include "engine/scene/light/light_rays.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/base/numbers.h"
#include "engine/scene/sampling/directions.h"

namespace ptc {

LightRig normalised(LightRig rig) {
  check_lights(rig);
  for (Sun& sun : rig.suns) sun.to_sun = glm::normalize(sun.to_sun);
  for (SpotLight& spot : rig.spots) spot.direction = glm::normalize(spot.direction);
  rig.sky.up = glm::normalize(rig.sky.up);
  return rig;
}

LightRays::LightRays(LightRig rig, std::vector<Emitter> emitters, const glm::dvec3& origin,
                     double closest)
    : rig_(std::move(rig)), area_(std::move(emitters)), origin_(origin), closest_(closest) {}

bool LightRays::empty() const noexcept {
  return area_.empty() && !has_lamps(rig_);
}

// The disc of the sun has one radiance, so directions are drawn with a density in proportion to the
// cosine to its middle. That is the measure of "irradiance on a surface that faces the sun", so
// each ray stands for the same share of it, and its irradiance on the receiver is that share times
// the cosine at the receiver over the cosine to the middle.
void LightRays::add_sun(const Sun& sun, const glm::vec3& normal, const SquarePoints& points,
                        unsigned rays, std::uint32_t turn, std::vector<LightRay>& out) const {
  const float widest = std::sin(std::min(sun.angular_radius, 0.5f * kPi));
  if (rays == 0 || sun.irradiance == glm::vec3(0)) return;
  if (glm::dot(normal, sun.to_sun) <= -widest) return;
  if (widest == 0) rays = 1;
  const Basis frame(sun.to_sun);
  for (std::uint32_t i = 0; i < rays; ++i) {
    const glm::vec3 local =
        widest > 0 ? cosine_direction(points.square(turn * rays + i), widest) : glm::vec3(0, 0, 1);
    const glm::vec3 direction = frame.to_world(local);
    const float cosine = glm::dot(normal, direction);
    if (cosine <= 0 || local.z <= 0) continue;
    out.push_back({.direction = direction,
                   .irradiance = sun.irradiance * (cosine / (local.z * static_cast<float>(rays)))});
  }
}

// Measures distances and angles at the surface; only the shadow ray begins off it.
void LightRays::add_point(const PointLight& point, const glm::dvec3& position,
                          const glm::vec3& normal, std::vector<LightRay>& out) const {
  const glm::dvec3 offset = point.position - position;
  const double distance = glm::length(offset);
  if (!(distance > closest_) || point.intensity == glm::vec3(0)) return;
  const double cosine = glm::dot(glm::dvec3(normal), offset) / distance;
  if (cosine <= 0) return;
  out.push_back(
      {.ends = true,
       .end = point.position,
       .irradiance = point.intensity * static_cast<float>(cosine / (distance * distance))});
}

void LightRays::draw(const glm::dvec3& position, const glm::vec3& normal,
                     const LightSampling& sampling, std::uint64_t seed, std::uint32_t turn,
                     std::vector<LightRay>& out) const {
  out.clear();
  for (std::size_t i = 0; i < rig_.suns.size(); ++i) {
    add_sun(rig_.suns[i], normal, light_points(seed, LightKind::first_sun, i), sampling.sun_rays,
            turn, out);
  }
  for (const PointLight& point : rig_.points) add_point(point, position, normal, out);
  for (const SpotLight& spot : rig_.spots) {
    const auto share = static_cast<float>(spot_share(spot, position));
    if (share == 0) continue;
    add_point({.position = spot.position, .intensity = share * spot.intensity}, position, normal,
              out);
  }
  if (area_.empty() || sampling.area_rays == 0) return;
  thread_local std::vector<EmitterSample> samples;
  area_.sample(glm::vec3(position - origin_), normal, sampling.area_rays,
               splitmix64(seed) + static_cast<std::uint64_t>(LightKind::area),
               turn * sampling.area_rays, samples);
  for (const EmitterSample& sample : samples) {
    out.push_back({.ends = true,
                   .end = origin_ + glm::dvec3(sample.position),
                   .end_normal = sample.normal,
                   .irradiance = sample.irradiance});
  }
}

float hidden_share(const glm::vec3& arrives, const glm::vec3& open) noexcept {
  const auto luminance = [](const glm::vec3& light) {
    return 0.2126F * light.r + 0.7152F * light.g + 0.0722F * light.b;
  };
  const float all = luminance(open);
  return all > 0 ? std::clamp(1 - luminance(arrives) / all, 0.0F, 1.0F) : 1.0F;
}

}  // namespace ptc
