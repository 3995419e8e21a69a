// Boxes that grow by points and by other boxes.
#include "engine/base/surfel.h"

#include <glm/common.hpp>

namespace ptc {

void Bounds::add(const glm::dvec3& p) noexcept {
  add(Bounds{p, p});
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
