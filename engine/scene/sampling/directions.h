// Directions around an axis, from points of the unit square.
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/base/numbers.h"

namespace ptc {

/// A right-handed frame whose third axis is a given unit vector.
/// Source: Duff et al. 2017, Building an orthonormal basis, revisited.
struct Basis {
  glm::vec3 x;
  glm::vec3 y;
  glm::vec3 z;

  explicit Basis(const glm::vec3& axis) noexcept : z(axis) {
    const float sign = std::copysign(1.0f, axis.z);
    const float a = -1.0f / (sign + axis.z);
    const float b = axis.x * axis.y * a;
    x = {1.0f + sign * axis.x * axis.x * a, sign * b, -sign * axis.x};
    y = {b, sign + axis.y * axis.y * a, -axis.y};
  }

  [[nodiscard]] glm::vec3 to_world(const glm::vec3& v) const noexcept {
    return x * v.x + y * v.y + z * v.z;
  }
};

/// A unit vector about +z whose distance from the axis, squared, is uniform in [0, widest^2):
/// cosine-distributed over the hemisphere when `widest` is 1, over a cap of that sine below.
[[nodiscard]] inline glm::vec3 cosine_direction(const glm::vec2& square,
                                                float widest = 1) noexcept {
  const float r = widest * std::sqrt(square.x);
  const float turn = 2 * kPi * square.y;
  return {r * std::cos(turn), r * std::sin(turn), std::sqrt(std::max(0.0f, 1 - r * r))};
}

}  // namespace ptc
