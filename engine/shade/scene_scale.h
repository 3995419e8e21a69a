// The unit of length that shading computes in, so that the unit of the scene does not matter.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/vec3.hpp>

#include "format/morton.h"

namespace ptc {

/// Converts lengths between scene units and edges of the scene's frame, the unit that shading
/// computes in.
///
/// Shading multiplies up to four lengths. In scene units such products leave the range of floats
/// when they are of radii above 4e9; in edges of the frame they do not, whatever the scene's unit
/// is. Lengths beyond all measure are clamped: a disc of 2^28 edges is a plane to a receiver among
/// the points, and a receiver 2^36 edges away sees nothing of them.
///
///     2^-42          1                2^12            2^28            2^36   edges
///     lattice unit   edge of frame    lifted radius   radius          distance
///
/// The edge is a power of two, so scaling rounds nothing, and a scene has the same results, bit for
/// bit, in any unit of length.
class SceneScale {
 public:
  static constexpr float kMaxRadius = 0x1p28F;     ///< maximum radius of a disc, edges
  static constexpr double kMaxDistance = 0x1p36;   ///< maximum distance on each axis, edges
  static constexpr double kLatticeUnit = 0x1p-42;  ///< unit of lattice coordinates, edges
  /// Maximum radius that a receiver is lifted by, edges. It keeps receivers near the scene, because
  /// floats are exact relative to the cell of receivers that share what they see.
  static constexpr double kMaxLiftedRadius = 0x1p12;

  /// Takes the unit from a frame, whose edge is a power of two.
  explicit SceneScale(const Frame& frame) noexcept
      : per_unit_(1 / frame.edge),
        lengths_(factors(-std::ilogb(frame.edge))),
        areas_(factors(-2 * std::ilogb(frame.edge))) {}

  /// Two powers of two whose product converts a float from scene units to edges. There are two,
  /// because one float may not hold the product. A result below 2^-100 may be off, but stays below
  /// 2^-100.
  using Factors = std::array<float, 2>;
  /// Returns the factors for lengths.
  [[nodiscard]] const Factors& length_factors() const noexcept { return lengths_; }
  /// Returns the factors for areas.
  [[nodiscard]] const Factors& area_factors() const noexcept { return areas_; }

  /// Converts a length from scene units to edges.
  [[nodiscard]] double length(double scene_units) const noexcept { return scene_units * per_unit_; }
  /// Converts a length from edges to scene units.
  [[nodiscard]] double scene_units(double length) const noexcept { return length / per_unit_; }
  /// Converts a radius from scene units to edges, at most kMaxRadius.
  [[nodiscard]] float radius(float scene_units) const noexcept {
    return std::min(scene_units * lengths_[0] * lengths_[1], kMaxRadius);
  }
  /// Returns the vector between two places, edges, each axis clamped to kMaxDistance.
  /// @param from, to  scene units
  [[nodiscard]] glm::vec3 way(const glm::dvec3& from, const glm::dvec3& to) const noexcept {
    const auto along = [&](int k) {
      return static_cast<float>(std::clamp(length(to[k] - from[k]), -kMaxDistance, kMaxDistance));
    };
    return {along(0), along(1), along(2)};
  }

 private:
  /// Splits 2^exponent into two normal floats.
  static Factors factors(int exponent) noexcept {
    const int first = std::clamp(exponent, -126, 127);
    const int second = std::clamp(exponent - first, -126, 127);
    return {std::ldexp(1.0F, first), std::ldexp(1.0F, second)};
  }

  double per_unit_;  ///< edges in a scene unit
  Factors lengths_, areas_;
};

}  // namespace ptc
