// The spacing in the view of a camera: the distance to the camera times the angle of the pixels
// that may lie between two surfels. A ball counts as in view unless it lies wholly behind the
// camera or beyond one side of the view's pyramid.
#include "engine/scene/sampling/spacing_field.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace ptc {
namespace {

// The view is enlarged so that what lies at its border is surrounded by surfels as fine as itself.
constexpr double kEnlarge = 1.1;

}  // namespace

SpacingField::SpacingField(const SamplingOptions& options, const SpacingMap* map)
    : map_(map),
      spacing_(options.spacing),
      finest_(options.spacing * static_cast<double>(options.finest)) {
  if (!options.camera) return;
  const Camera& camera = *options.camera;
  angle_ =
      static_cast<double>(camera.pixel_angle()) * static_cast<double>(options.pixels_per_surfel);
  eye_ = camera.position;
  axes_ = axes_of(camera);
  half_height_ = kEnlarge * std::tan(0.5 * static_cast<double>(camera.vertical_fov));
  half_width_ = half_height_ * camera.width / camera.height;
}

bool SpacingField::is_in_view(const glm::dvec3& centre, double radius) const {
  const glm::dvec3 offset = centre - eye_;
  const double ahead = glm::dot(offset, axes_.forward);
  if (ahead < -radius) return false;
  // Compare the distance from a side plane of the view's pyramid; the plane's normal (1, half) has
  // the length hypot(1, half).
  const auto within = [&](double aside, double half) {
    return std::abs(aside) - ahead * half <= radius * std::hypot(1.0, half);
  };
  return within(glm::dot(offset, axes_.right), half_width_) &&
         within(glm::dot(offset, axes_.up), half_height_);
}

double SpacingField::at(const glm::dvec3& centre, double radius) const {
  const double spacing = map_ ? map_->at(centre, radius) : spacing_;
  if (angle_ == 0 || !is_in_view(centre, radius)) return spacing;
  const double distance = std::max(0.0, glm::distance(centre, eye_) - radius);
  return std::min(std::max(distance * angle_, finest_), spacing);
}

}  // namespace ptc
