// Bounds the height of a receiver in double before it becomes float.
#include "engine/shade/lift.h"

#include <algorithm>
#include <limits>

#include "engine/shade/scene_scale.h"

namespace ptc {

float lift_height(float radius, float lift, const Frame& frame) noexcept {
  constexpr double kMax = std::numeric_limits<float>::max();
  const double edges = std::min(SceneScale::kMaxLiftedRadius * frame.edge, kMax);
  return std::min(lift * std::min(radius, static_cast<float>(edges)), static_cast<float>(kMax));
}

Receiver lifted(const Surfel& surfel, float lift, const Frame& frame) noexcept {
  const auto height = static_cast<double>(lift_height(surfel.radius, lift, frame));
  return {surfel.position + glm::dvec3(surfel.normal) * height, surfel.normal};
}

}  // namespace ptc
