#include "tools/bench/shapes/random.h"

#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/base/low_discrepancy.h"
#include "engine/base/numbers.h"

namespace ptc::bench {

double Random::unit() {
  state_ = splitmix64(state_);
  return static_cast<double>(state_ >> 11) * 0x1p-53;
}

glm::dvec3 Random::in_box(double low, double high) {
  const double x = between(low, high);
  const double y = between(low, high);
  return {x, y, between(low, high)};
}

glm::vec3 Random::direction() {
  for (;;) {
    const glm::dvec3 p = in_box(-1, 1);
    const double length = glm::length(p);
    if (length > 0.01 && length < 1) return glm::vec3(p / length);
  }
}

glm::mat3 Random::rotation() {
  const Basis basis(direction());
  return {basis.x, basis.y, basis.z};
}

}  // namespace ptc::bench
