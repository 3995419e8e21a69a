// The surfel, which every source of points yields and every sink takes, and the box around surfels.
#pragma once

#include <glm/vec3.hpp>

namespace ptc {

/// The greatest magnitude of a coordinate that is accepted from a file. Any points within this
/// bound fit a cube that a container can store.
inline constexpr double kMaxCoordinate = 0x1p999;

/// Returns true when no coordinate is beyond kMaxCoordinate; a coordinate that is no number is not.
[[nodiscard]] bool fits_coordinates(const glm::dvec3& p) noexcept;

/// A disc of surface from which light leaves diffusely on the side of its normal.
struct Surfel {
  glm::dvec3 position{0};  ///< centre, scene units
  glm::vec3 normal{0};     ///< unit
  float radius = 0;  ///< scene units; the disc circumscribes its square cell, whose area is 2 r^2
  glm::vec3 radiance{0};  ///< of the light that it reflects, linear RGB, W / (m^2 sr)
  glm::vec3 albedo{0};    ///< diffuse reflectance, linear RGB in [0, 1]
  glm::vec3 emission{0};  ///< of the light of its own, linear RGB, W / (m^2 sr)

  /// Returns the radiance of all light that leaves the front.
  [[nodiscard]] glm::vec3 outgoing() const noexcept { return radiance + emission; }
};

/// An axis-aligned box, which is empty while low > high.
struct Bounds {
  glm::dvec3 low{1};   ///< scene units
  glm::dvec3 high{0};  ///< scene units

  /// Says whether nothing was added yet.
  [[nodiscard]] bool empty() const noexcept { return low.x > high.x; }
  /// Enlarges the box to hold a point.
  void add(const glm::dvec3& p) noexcept;
  /// Enlarges the box to hold another one; an empty one changes nothing.
  void add(const Bounds& other) noexcept;
  /// Says whether a point lies in the box or on its sides.
  [[nodiscard]] bool contains(const glm::dvec3& p) const noexcept;
};

}  // namespace ptc
