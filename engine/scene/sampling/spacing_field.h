// The wanted distance between surfels at each place of a scene.
#pragma once

#include <optional>

#include <glm/vec3.hpp>

#include "engine/scene/camera.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/scene/sampling/spacing_map.h"

namespace ptc {

/// The wanted spacing of surfels: the base spacing everywhere, or that of a map, finer in a
/// camera's view.
///
///     spacing ^            __________   outside the view, and far from the camera
///             |          /
///             |        /                in the view: distance times angle
///             |  ____/                  near the camera: the finest spacing
///             +-------------------> distance from the camera
class SpacingField {
 public:
  /// Takes the spacing and the camera of the options.
  /// @param options  has a spacing above 0
  /// @param map      takes the place of the base spacing, and must outlive this; null: none
  explicit SpacingField(const SamplingOptions& options, const SpacingMap* map = nullptr);

  /// Returns the spacing that suits all of a ball, scene units: the finest that any of its points
  /// asks for.
  [[nodiscard]] double at(const glm::dvec3& centre, double radius) const;
  /// Reports whether the spacing depends on the place.
  [[nodiscard]] bool varies() const noexcept { return angle_ != 0 || map_; }

 private:
  /// Reports whether any part of a ball may lie in the enlarged view.
  [[nodiscard]] bool is_in_view(const glm::dvec3& centre, double radius) const;

  const SpacingMap* map_;
  double spacing_;     ///< base spacing, scene units
  double finest_;      ///< minimum spacing, scene units
  double angle_ = 0;   ///< between neighbours as the camera sees them, radians; 0: no camera
  glm::dvec3 eye_{0};  ///< position of the camera
  CameraAxes axes_{};
  double half_width_ = 0;   ///< half the width of the enlarged view at distance 1
  double half_height_ = 0;  ///< half the height of the enlarged view at distance 1
};

}  // namespace ptc
