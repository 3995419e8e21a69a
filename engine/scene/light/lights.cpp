#include "engine/scene/light/lights.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "engine/base/error.h"

namespace ptc {
namespace {

bool is_light(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) && v.x >= 0 && v.y >= 0 &&
         v.z >= 0;
}

// Says whether a vector can be normalised: neither it nor its square leaves the range of float.
bool has_direction(const glm::vec3& v) {
  const glm::vec3 unit = glm::normalize(v);
  return std::abs(glm::dot(unit, unit) - 1) < 1e-3F;
}

// Checks what point lights and spot lights have in common.
void check_lamp(const glm::dvec3& position, const glm::vec3& intensity, const char* field,
                const std::string& what) {
  if (!is_light(intensity)) {
    throw RequestError(field, "the intensity of a " + what + " is negative or not finite");
  }
  const glm::dvec3 away = glm::abs(position);
  if (!(away.x <= kMaxLightDistance && away.y <= kMaxLightDistance &&
        away.z <= kMaxLightDistance)) {
    throw RequestError(field, "a coordinate of a " + what + " is not finite, or beyond 1e150");
  }
}

}  // namespace

glm::vec3 sun_direction(double azimuth_degrees, double elevation_degrees, const glm::vec3& up) {
  const double azimuth = glm::radians(azimuth_degrees);
  const double elevation = glm::radians(elevation_degrees);
  const double rise = std::sin(elevation), ahead = std::cos(azimuth) * std::cos(elevation),
               aside = std::sin(azimuth) * std::cos(elevation);
  if (up.z > 0.5F) return {aside, ahead, rise};
  if (up.x > 0.5F) return {rise, ahead, aside};
  return {aside, rise, ahead};
}

double spot_share(const SpotLight& spot, const glm::dvec3& place) noexcept {
  const glm::dvec3 offset = place - spot.position;
  const double distance = glm::length(offset);
  if (!(distance > 0)) return 0;
  // The length of a unit vector of floats is not quite 1, which matters to narrow cones
  const glm::dvec3 axis(spot.direction);
  const double cosine = glm::dot(axis, offset) / (distance * glm::length(axis));
  const double inner = std::cos(static_cast<double>(spot.inner_angle));
  const double outer = std::cos(static_cast<double>(spot.outer_angle));
  if (cosine >= inner) return 1;
  if (cosine <= outer) return 0;
  const double linear = (cosine - outer) / (inner - outer);
  return linear * linear;
}

bool has_lamps(const LightRig& rig) {
  const auto shines = [](const glm::vec3& light) { return light != glm::vec3(0); };
  return std::ranges::any_of(rig.suns, shines, &Sun::irradiance) ||
         std::ranges::any_of(rig.points, shines, &PointLight::intensity) ||
         std::ranges::any_of(rig.spots, shines, &SpotLight::intensity);
}

bool is_group_name(std::string_view text) noexcept {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyz0123456789_";
  constexpr std::size_t kMost =
      25;  // the name of a channel has at most 31, and begins with "light_"
  return !text.empty() && text.size() <= kMost && text != kRestGroup &&
         text.find_first_not_of(kLetters) == std::string_view::npos;
}

std::vector<std::string> light_groups(const LightRig& rig, bool emitters) {
  std::vector<std::string> groups;
  bool rest = emitters;
  const auto add = [&](const glm::vec3& light, const std::string& group) {
    if (light == glm::vec3(0)) return;
    rest |= group.empty();
    if (!group.empty() && std::ranges::find(groups, group) == groups.end()) groups.push_back(group);
  };
  for (const Sun& sun : rig.suns) add(sun.irradiance, sun.group);
  for (const PointLight& point : rig.points) add(point.intensity, point.group);
  for (const SpotLight& spot : rig.spots) add(spot.intensity, spot.group);
  add(rig.sky.radiance, rig.sky.group);
  if (rest) groups.emplace_back();
  return groups;
}

LightRig only_group(LightRig rig, const std::string& group) {
  const auto keep = [&](glm::vec3& light, const std::string& of) {
    if (of != group) light = glm::vec3(0);
  };
  for (Sun& sun : rig.suns) keep(sun.irradiance, sun.group);
  for (PointLight& point : rig.points) keep(point.intensity, point.group);
  for (SpotLight& spot : rig.spots) keep(spot.intensity, spot.group);
  keep(rig.sky.radiance, rig.sky.group);
  return rig;
}

void check_sky(const Sky& sky, const char* field) {
  require_request(has_direction(sky.up), field,
                  "the upward direction of the sky is zero or not finite");
  require_request(is_light(sky.radiance), field,
                  "the radiance of the sky is negative or not finite");
}

void check_lights(const LightRig& rig) {
  constexpr char kField[] = "lights";
  const auto check_group = [&](const std::string& group) {
    require_request(group.empty() || is_group_name(group), kField,
                    "the name of a light's group is not 1 to 25 letters from a to z, digits and "
                    "underscores, or is that of the rest");
  };
  for (const Sun& sun : rig.suns) check_group(sun.group);
  for (const PointLight& point : rig.points) check_group(point.group);
  for (const SpotLight& spot : rig.spots) check_group(spot.group);
  check_group(rig.sky.group);
  for (const Sun& sun : rig.suns) {
    require_request(has_direction(sun.to_sun), kField,
                    "the direction of a sun is zero or not finite");
    require_request(is_light(sun.irradiance), kField,
                    "the irradiance of a sun is negative or not finite");
    require_request(sun.angular_radius >= 0 && sun.angular_radius < 1.58F, kField,
                    "the radius of a sun is not between 0 and a quarter turn");
  }
  for (const PointLight& point : rig.points) {
    check_lamp(point.position, point.intensity, kField, "point light");
  }
  for (const SpotLight& spot : rig.spots) {
    check_lamp(spot.position, spot.intensity, kField, "spot light");
    require_request(has_direction(spot.direction), kField,
                    "the direction of a spot light is zero or not finite");
    require_request(spot.outer_angle > 0 && spot.outer_angle < 1.58F, kField,
                    "the outer cone of a spot light is not above 0 and up to a quarter turn");
    require_request(spot.inner_angle >= 0 && spot.inner_angle <= spot.outer_angle, kField,
                    "the inner cone of a spot light is not between 0 and its outer cone");
  }
  check_sky(rig.sky, kField);
}

LightRig default_rig(const glm::vec3& up) {
  LightRig rig;
  rig.suns.push_back({.to_sun = sun_direction(40, 50, up), .irradiance = glm::vec3(3)});
  rig.sky = {.radiance = 0.8F * glm::vec3(0.85F, 0.93F, 1.0F), .up = up};
  return rig;
}

LightRig rig_of(std::span<const MeshLight> lights) {
  LightRig rig;
  for (const MeshLight& light : lights) {
    const glm::vec3 intensity = light.intensity / static_cast<float>(kLumensPerWatt);
    switch (light.kind) {
      case MeshLight::Kind::sun:
        rig.suns.push_back(
            {.to_sun = -light.direction, .irradiance = intensity, .angular_radius = 0});
        break;
      case MeshLight::Kind::point:
        rig.points.push_back({.position = light.position, .intensity = intensity});
        break;
      case MeshLight::Kind::spot:
        rig.spots.push_back({.position = light.position,
                             .direction = light.direction,
                             .intensity = intensity,
                             .inner_angle = light.inner_angle,
                             .outer_angle = light.outer_angle});
        break;
    }
  }
  return rig;
}

LightRig cloud_rig(const glm::vec3& up) {
  LightRig rig;
  rig.sky = {.radiance = glm::vec3(1), .up = up};
  return rig;
}

}  // namespace ptc
