// How far apart surfels should be, here and there.
#pragma once

#include <optional>

#include <glm/vec3.hpp>

#include "engine/scene/camera.h"
#include "engine/scene/sampling/sampler.h"

namespace ptc {

/// The wanted spacing of a region: the base spacing, finer in a camera's view.
class SpacingField {
 public:
  /// @param options  with a spacing that is resolved (positive)
  explicit SpacingField(const SamplingOptions& options);

  /// Spacing that suits all of a ball: the finest that any of its points asks for.
  [[nodiscard]] double at(const glm::dvec3& centre, double radius) const;
  /// False when it is the same everywhere.
  [[nodiscard]] bool varies() const noexcept { return angle_ != 0; }

 private:
  [[nodiscard]] bool is_in_view(const glm::dvec3& centre, double radius) const;

  double spacing_;
  double finest_;
  double angle_ = 0;  // between neighbours as the camera sees them; 0: no camera
  glm::dvec3 eye_{0};
  CameraAxes axes_{};
  double half_width_ = 0;  // of the view at distance 1, enlarged
  double half_height_ = 0;
};

}  // namespace ptc
