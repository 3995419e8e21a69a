#include "engine/scene/light/lights.h"

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

}  // namespace

glm::vec3 sun_direction(double azimuth_degrees, double elevation_degrees) {
  const double azimuth = glm::radians(azimuth_degrees);
  const double elevation = glm::radians(elevation_degrees);
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
          std::cos(azimuth) * std::cos(elevation)};
}

void check_sky(const Sky& sky, const char* field) {
  require_request(has_direction(sky.up), field,
                  "the upward direction of the sky is zero or not finite");
  require_request(is_light(sky.radiance), field,
                  "the radiance of the sky is negative or not finite");
  if (const Image* map = sky.map.get()) {
    require_request(map->pixels.size() == std::size_t{map->width} * map->height, field,
                    "the picture of the sky has another number of pixels than its size says");
  }
}

void check_lights(const LightRig& rig) {
  constexpr char kField[] = "lights";
  for (const Sun& sun : rig.suns) {
    require_request(has_direction(sun.to_sun), kField,
                    "the direction of a sun is zero or not finite");
    require_request(is_light(sun.irradiance), kField,
                    "the irradiance of a sun is negative or not finite");
    require_request(sun.angular_radius >= 0 && sun.angular_radius < 1.58F, kField,
                    "the radius of a sun is not between 0 and a quarter turn");
  }
  for (const PointLight& point : rig.points) {
    require_request(is_light(point.intensity), kField,
                    "the intensity of a point light is negative or not finite");
    const glm::dvec3 away = glm::abs(point.position);
    require_request(
        away.x <= kMaxLightDistance && away.y <= kMaxLightDistance && away.z <= kMaxLightDistance,
        kField, "a coordinate of a point light is not finite, or beyond 1e150");
  }
  check_sky(rig.sky, kField);
}

LightRig default_rig() {
  LightRig rig;
  rig.suns.push_back({.to_sun = sun_direction(40, 50), .irradiance = glm::vec3(3)});
  rig.sky.radiance = 0.8F * glm::vec3(0.85F, 0.93F, 1.0F);
  return rig;
}

LightRig cloud_rig(const glm::vec3& up) {
  LightRig rig;
  rig.sky = {.radiance = glm::vec3(1), .up = up};
  return rig;
}

}  // namespace ptc
