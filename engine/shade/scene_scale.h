// The unit of length that shading computes in, so that the unit of the scene does not matter.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/vec3.hpp>

#include "format/morton.h"

namespace ptc {

/// Lengths in edges of the scene's frame.
///
/// Shading multiplies up to four lengths, which leave the range of floats when they are radii above
/// 4e9 in scene units. In edges of the frame they do not, whatever the scene's unit is; what is
/// beyond all measure counts as a bound: a disc of 2^28 edges is a plane for whoever stands among
/// the points, and from 2^36 edges away nothing of them can be seen. The edge is a power of two, so
/// scaling rounds nothing, and the results of other scenes are the same bits in any unit.
class SceneScale {
 public:
  static constexpr float kMaxRadius = 0x1p28F;     ///< edges
  static constexpr double kMaxDistance = 0x1p36;   ///< edges, from the frame's origin, each axis
  static constexpr double kLatticeUnit = 0x1p-42;  ///< edges
  /// Radii that a receiver is lifted by are at most so many edges: receivers stay near the scene,
  /// since floats are exact relative to the cell of receivers that share what they see.
  static constexpr double kMaxLiftedRadius = 0x1p12;

  explicit SceneScale(const Frame& frame) noexcept
      : per_unit_(1 / frame.edge),
        lengths_(factors(-std::ilogb(frame.edge))),
        areas_(factors(-2 * std::ilogb(frame.edge))) {}

  /// Two powers of two that make edges of a length, or of an area, in scene units: one float may
  /// not hold their product. What is below 2^-100 edges may come out as another number below it.
  using Factors = std::array<float, 2>;
  [[nodiscard]] const Factors& length_factors() const noexcept { return lengths_; }
  [[nodiscard]] const Factors& area_factors() const noexcept { return areas_; }

  /// A length in edges from one in scene units.
  [[nodiscard]] double length(double scene_units) const noexcept { return scene_units * per_unit_; }
  /// The inverse.
  [[nodiscard]] double scene_units(double length) const noexcept { return length / per_unit_; }
  /// A radius in edges from one in scene units.
  [[nodiscard]] float radius(float scene_units) const noexcept {
    return std::min(scene_units * lengths_[0] * lengths_[1], kMaxRadius);
  }
  /// The way from a place to another, both in scene units.
  [[nodiscard]] glm::vec3 way(const glm::dvec3& from, const glm::dvec3& to) const noexcept {
    const auto along = [&](int k) {
      return static_cast<float>(std::clamp(length(to[k] - from[k]), -kMaxDistance, kMaxDistance));
    };
    return {along(0), along(1), along(2)};
  }

 private:
  static Factors factors(int exponent) noexcept {
    const int first = std::clamp(exponent, -126, 127);
    const int second = std::clamp(exponent - first, -126, 127);
    return {std::ldexp(1.0F, first), std::ldexp(1.0F, second)};
  }

  double per_unit_;
  Factors lengths_, areas_;
};

}  // namespace ptc
