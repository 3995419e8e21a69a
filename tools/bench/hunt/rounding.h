// Numbers of scenes that are drawn by chance: multiples of a decimal unit, so that their text is
// short.
#pragma once

#include <cmath>

#include <glm/vec3.hpp>

namespace ptc::bench {

/// Rounds to a multiple of one over `steps`, and never to a negative zero.
[[nodiscard]] inline double rounded(double value, double steps) {
  return std::round(value * steps) / steps + 0.0;
}

[[nodiscard]] inline glm::dvec3 rounded(const glm::dvec3& v, double steps) {
  return {rounded(v.x, steps), rounded(v.y, steps), rounded(v.z, steps)};
}

}  // namespace ptc::bench
