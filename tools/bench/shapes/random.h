// Random numbers for scenes that are made in code.
#pragma once

#include <cstdint>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace ptc::bench {

/// A fixed sequence of random numbers: the same for the same seed.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  /// Returns a number in [0, 1).
  double unit();
  /// Returns a number in [low, high).
  double between(double low, double high) { return low + (high - low) * unit(); }
  /// Returns a point whose coordinates are all between `low` and `high`.
  glm::dvec3 in_box(double low, double high);
  /// Returns a unit vector, evenly distributed.
  glm::vec3 direction();
  /// Returns a rotation that takes +z to a random direction.
  glm::mat3 rotation();

 private:
  std::uint64_t state_;
};

}  // namespace ptc::bench
