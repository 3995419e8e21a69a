#include "engine/scan/known_sides.h"

#include <cmath>

#include <glm/geometric.hpp>

namespace ptc {

KnownSides::KnownSides(const Frame& frame, const std::vector<glm::dvec3>& scanners,
                       const glm::dvec3& up, bool aerial)
    : aerial_(aerial) {
  const glm::dvec3 unit = glm::normalize(up);
  up_ = {static_cast<float>(unit.x), static_cast<float>(unit.y), static_cast<float>(unit.z)};
  for (const glm::dvec3& s : scanners) {
    scanners_.push_back({(s.x - frame.origin[0]) / frame.unit(),
                         (s.y - frame.origin[1]) / frame.unit(),
                         (s.z - frame.origin[2]) / frame.unit()});
  }
}

std::optional<std::array<float, 3>> KnownSides::towards(
    const Place& place, const LatticePosition& position) const noexcept {
  if (place.normal < scanners_.size()) {
    const LatticePosition& scanner = scanners_[place.normal];
    const double x = scanner[0] - position[0], y = scanner[1] - position[1],
                 z = scanner[2] - position[2];
    const double length = std::sqrt(x * x + y * y + z * z);
    if (!(length > 0) || !std::isfinite(length)) return {};
    return std::array{static_cast<float>(x / length), static_cast<float>(y / length),
                      static_cast<float>(z / length)};
  }
  if (aerial_) return up_;
  return {};
}

}  // namespace ptc
