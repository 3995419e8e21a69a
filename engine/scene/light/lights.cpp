#include "engine/scene/light/lights.h"

#include <cmath>

#include <glm/trigonometric.hpp>

namespace ptc {

glm::vec3 sun_direction(double azimuth_degrees, double elevation_degrees) {
  const double azimuth = glm::radians(azimuth_degrees);
  const double elevation = glm::radians(elevation_degrees);
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
          std::cos(azimuth) * std::cos(elevation)};
}

LightRig default_rig() {
  LightRig rig;
  rig.suns.push_back({.to_sun = sun_direction(40, 50), .irradiance = glm::vec3(3)});
  rig.sky.radiance = 0.8F * glm::vec3(0.85F, 0.93F, 1.0F);
  return rig;
}

}  // namespace ptc
