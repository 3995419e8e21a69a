// Turns points of the unit square into directions around an axis.
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/base/basis.h"  // IWYU pragma: export
#include "engine/base/numbers.h"

namespace ptc {

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
