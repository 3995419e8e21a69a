// Internal to the reader and the writer of RenderMan point clouds: a normal in two numbers of 16
// bits.
//
// A normal is an angle about z and its z, each over the full range of 16 bits:
//
//   phi = 2 pi a / 65535 - pi    z = 2 b / 65535 - 1    normal = (r sin phi, r cos phi, z)
//
// The greatest numbers of both stand for no normal.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <glm/vec3.hpp>

namespace ptc {

/// A normal as a file holds it.
struct PackedNormal {
  std::uint16_t phi = 65535;
  std::uint16_t z = 65535;

  bool operator==(const PackedNormal&) const = default;
};

/// Returns the two numbers of a normal; zero is the normal of a point without one.
[[nodiscard]] inline PackedNormal pack_normal(const glm::vec3& normal) {
  if (normal == glm::vec3(0)) return {};
  const glm::dvec3 n(normal);
  const double turn = std::atan2(n.x, n.y) / (2 * std::numbers::pi) + 0.5;
  const double height = (std::clamp(n.z, -1.0, 1.0) + 1) / 2;
  const auto phi = static_cast<std::uint16_t>(std::lround(65535 * turn));
  // A whole turn is none, and the greatest number stands for a missing normal.
  return {phi == PackedNormal{}.phi ? std::uint16_t{0} : phi,
          static_cast<std::uint16_t>(std::lround(65535 * height))};
}

/// Returns the normal that two numbers stand for; zero where there is none.
[[nodiscard]] inline glm::vec3 unpack_normal(const PackedNormal& packed) {
  if (packed == PackedNormal{}) return glm::vec3(0);
  const double phi = 2 * std::numbers::pi * packed.phi / 65535 - std::numbers::pi;
  const double z = 2.0 * packed.z / 65535 - 1;
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  return {static_cast<float>(r * std::sin(phi)), static_cast<float>(r * std::cos(phi)),
          static_cast<float>(z)};
}

}  // namespace ptc
