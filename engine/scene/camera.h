// A pinhole camera: where it stands, the rays through its pixels, and its JSON record.
#pragma once

#include <string>

#include <glm/vec3.hpp>

namespace ptc {

/// A pinhole camera. Its picture is a rectangle of square pixels, square to the view:
///
///     (0, 0) +-------------+
///            |             |             up
///            |      x      |              |
///            |   look_at   |              +--- right      forward goes into the page
///            +-------------+
///                     (width, height)
struct Camera {
  glm::dvec3 position{0, 0, 5};  ///< scene units
  glm::dvec3 look_at{0};         ///< scene units; the centre of the picture shows it
  /// The direction that points upwards in the picture, of any length except 0. It need not be
  /// square to the view; where it lies along the view, axes_of() chooses another.
  glm::vec3 up{0, 1, 0};
  float vertical_fov = 0.7f;  ///< angle between the picture's upper and lower edge, in (0, pi) rad
  unsigned width = 960;       ///< pixels in a row
  unsigned height = 540;      ///< pixels in a column

  /// Returns the unit direction through a point of the picture.
  /// @param x, y  pixels; (0, 0) is the top left corner, (width, height) the bottom right
  [[nodiscard]] glm::vec3 direction(float x, float y) const;
  /// Returns the angle between neighbouring pixels at the centre of the picture, radians.
  [[nodiscard]] float pixel_angle() const;
};

/// The orientation of a camera: three unit vectors, each square to the others, right-handed.
struct CameraAxes {
  glm::dvec3 right;
  glm::dvec3 up;
  glm::dvec3 forward;  ///< towards look_at; -z where look_at equals the position
};
/// Returns the axes of a camera. Where `up` lies along the view, +y takes its place, or -z when
/// the view is nearly vertical.
[[nodiscard]] CameraAxes axes_of(const Camera& camera);

/// Checks the numbers of a camera.
/// @param field  the member of the request that holds the camera, for the error
/// @throws RequestError when a number is not finite, the angle is not in (0, pi), `up` is zero, or
///         the picture has no pixels
void check_camera(const Camera& camera, const char* field);

/// Returns the JSON text of a camera, one member for each member of Camera.
/// @throws RequestError when a member is not finite
[[nodiscard]] std::string to_json(const Camera& camera);
/// Parses the JSON text of a camera. Members that are absent keep their defaults, and
/// camera_from_json(to_json(c)) equals c exactly.
/// @throws DataError when the text is not JSON, or a member is unknown, has the wrong type or is
///         out of range
[[nodiscard]] Camera camera_from_json(const std::string& text);

}  // namespace ptc
