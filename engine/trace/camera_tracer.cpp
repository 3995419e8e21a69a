#include "engine/trace/camera_tracer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

namespace ptc {
namespace {

/// Returns the pyramid around rays from one place, relative to that place.
Shaft pyramid_around(std::span<const glm::vec3> directions, const glm::mat3& axes) {
  constexpr float kRound = 4e-6F;  // what rounding may take from a slope
  constexpr float kFar = std::numeric_limits<float>::max();
  Shaft shaft{.axes = {axes[0], axes[1], axes[2]},
              .low = {},
              .high = {},
              .slope_low = {kFar, kFar},
              .slope_high = {-kFar, -kFar},
              .depth = kFar};
  for (const glm::vec3& direction : directions) {
    for (int k = 0; k < 2; ++k) {
      const float slope = glm::dot(direction, axes[k]), slack = kRound * (1 + std::abs(slope));
      shaft.slope_low[k] = std::min(shaft.slope_low[k], slope - slack);
      shaft.slope_high[k] = std::max(shaft.slope_high[k], slope + slack);
    }
  }
  return shaft;
}

}  // namespace

CameraTracer::CameraTracer(const SceneView& view, PageCache& cache, const glm::dvec3& eye,
                           const glm::mat3& axes)
    : tree_(view, cache, 0, 1), place_(tree_.place(eye)), axes_(axes) {}

void CameraTracer::meet(std::span<const glm::vec3> directions, std::span<RayHit> hits) {
  if (directions.empty()) return;
  const Shaft shaft = pyramid_around(directions, axes_);
  const float spread =
      std::max(shaft.slope_high[0] - shaft.slope_low[0], shaft.slope_high[1] - shaft.slope_low[1]);
  list_.list_along(tree_, place_, shaft, spread);
  for (std::size_t at = 0; at < directions.size(); at += kFew) {
    const std::size_t few = std::min(kFew, directions.size() - at);
    narrow_boxes(list_.boxes(), directions.subspan(at, few), few_);
    trace_rays(tree_, place_, few_, list_.words(), directions.subspan(at, few), RaysFor::nearest,
               hits.subspan(at, few));
  }
}

}  // namespace ptc
