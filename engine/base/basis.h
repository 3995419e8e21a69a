// A frame around an axis.
#pragma once

#include <cmath>

#include <glm/vec3.hpp>

namespace ptc {

/// A right-handed frame whose third axis is a given unit vector.
///
/// The frame is the one that the shortest rotation from +z to the axis gives, or from -z where the
/// axis points downwards: so the division below never comes near zero.
/// Source: Duff et al. 2017, Building an orthonormal basis, revisited.
struct Basis {
  glm::vec3 x;  ///< unit, square to the axis
  glm::vec3 y;  ///< unit, square to the axis and to x
  glm::vec3 z;  ///< the axis

  /// Builds the frame. @param axis  unit
  explicit Basis(const glm::vec3& axis) noexcept : z(axis) {
    const float sign = std::copysign(1.0f, axis.z);
    const float a = -1.0f / (sign + axis.z);
    const float b = axis.x * axis.y * a;
    x = {1.0f + sign * axis.x * axis.x * a, sign * b, -sign * axis.x};
    y = {b, sign + axis.y * axis.y * a, -axis.y};
  }

  /// Returns a vector of this frame in the axes that x, y and z are given in.
  [[nodiscard]] glm::vec3 to_world(const glm::vec3& v) const noexcept {
    return x * v.x + y * v.y + z * v.z;
  }
};

}  // namespace ptc
