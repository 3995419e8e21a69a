// Turns points of the unit square into directions around an axis.
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/base/numbers.h"

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

/// Returns a unit vector about +z whose density is in proportion to its cosine to +z.
///
///            z                A point uniform in the disc of radius `widest` is lifted onto the
///            |  . - .         unit sphere (Malley's method): the area element of the sphere times
///            |/       \       its cosine is the area element of the disc.
///     -------+----x----+--
///                widest
///
/// @param square  a point of the unit square: the squared distance from the axis, and the turn
/// @param widest  sine of the cap's half angle, in [0, 1]; 1 covers the hemisphere
[[nodiscard]] inline glm::vec3 cosine_direction(const glm::vec2& square,
                                                float widest = 1) noexcept {
  const float r = widest * std::sqrt(square.x);
  const float turn = 2 * kPi * square.y;
  return {r * std::cos(turn), r * std::sin(turn), std::sqrt(std::max(0.0f, 1 - r * r))};
}

}  // namespace ptc
