// The bound on coordinates, and boxes that grow by points and by other boxes.
#include "engine/base/surfel.h"

#include <cmath>

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

namespace ptc {

bool fits_coordinates(const glm::dvec3& p) noexcept {
  return std::abs(p.x) <= kMaxCoordinate && std::abs(p.y) <= kMaxCoordinate &&
         std::abs(p.z) <= kMaxCoordinate;
}

void Bounds::add(const glm::dvec3& p) noexcept {
  add(Bounds{p, p});
}

bool Bounds::contains(const glm::dvec3& p) const noexcept {
  return glm::all(glm::lessThanEqual(low, p)) && glm::all(glm::lessThanEqual(p, high));
}

void Bounds::add(const Bounds& other) noexcept {
  if (other.empty()) return;
  if (empty()) {
    *this = other;
    return;
  }
  low = glm::min(low, other.low);
  high = glm::max(high, other.high);
}

}  // namespace ptc
