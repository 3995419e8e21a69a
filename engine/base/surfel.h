// What every source yields and every sink takes.
#pragma once

#include <glm/vec3.hpp>

namespace ptc {

/// Greatest coordinate of what files give: around whatever lies between such places there is a cube
/// that a container takes.
inline constexpr double kMaxCoordinate = 0x1p999;

/// A disc of surface: light leaves it diffusely on the side of its normal.
struct Surfel {
  glm::dvec3 position{0};  ///< scene units
  glm::vec3 normal{0};     ///< unit
  float radius = 0;  ///< scene units; circumscribes the square cell it stands for: area = 2 r^2
  glm::vec3 radiance{0};  ///< outgoing, linear RGB, W / (m^2 sr)
  glm::vec3 albedo{0};    ///< diffuse reflectance, linear RGB in [0, 1]
};

/// Axis-aligned box; empty while low > high.
struct Bounds {
  glm::dvec3 low{1};
  glm::dvec3 high{0};

  [[nodiscard]] bool empty() const noexcept { return low.x > high.x; }
  void add(const glm::dvec3& p) noexcept;
  void add(const Bounds& other) noexcept;
};

}  // namespace ptc
