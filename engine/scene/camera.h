// A pinhole camera.
#pragma once

#include <string>

#include <glm/vec3.hpp>

namespace ptc {

struct Camera {
  glm::dvec3 position{0, 0, 5};
  glm::dvec3 look_at{0};
  glm::vec3 up{0, 1, 0};      ///< need not be square to the view; along it, another is chosen
  float vertical_fov = 0.7f;  ///< radians, in (0, pi)
  unsigned width = 960;       ///< pixels, square
  unsigned height = 540;

  /// Unit direction through a point of the picture; (0, 0) is the top left corner, (width, height)
  /// the bottom right.
  [[nodiscard]] glm::vec3 direction(float x, float y) const;
  /// Angle between neighbouring pixels at the centre, radians.
  [[nodiscard]] float pixel_angle() const;
};

/// Where a camera looks: right-handed, unit.
struct CameraAxes {
  glm::dvec3 right;
  glm::dvec3 up;
  glm::dvec3 forward;  ///< towards look_at; -z when that is the position
};
[[nodiscard]] CameraAxes axes_of(const Camera& camera);

/// @throws RequestError when a member is not finite
[[nodiscard]] std::string to_json(const Camera& camera);
/// Members that are absent keep their defaults. camera_from_json(to_json(c)) equals c exactly.
/// @throws DataError when it is no JSON, a member is unknown or of the wrong type, or out of range
[[nodiscard]] Camera camera_from_json(const std::string& text);

}  // namespace ptc
