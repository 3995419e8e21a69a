// The geometry of the pinhole and its JSON record.
//
// The picture plane is put at distance 1 from the position. There the picture is
// 2 tan(vertical_fov / 2) high, so that one pixel measures 2 half_height() / height both ways.
#include "engine/scene/camera.h"

#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/base/numbers.h"
#include "engine/scene/json_fields.h"

namespace ptc {
namespace {

constexpr Range kFinite{-std::numeric_limits<float>::max(), std::numeric_limits<float>::max()};
constexpr Range kFiniteWide{-std::numeric_limits<double>::max(),
                            std::numeric_limits<double>::max()};
constexpr Range kFov{1e-4, 3.1415};
constexpr Range kPixels{1, 65536};

bool is_finite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Half the height of the picture on a plane at distance 1.
double half_height(const Camera& camera) {
  return std::tan(0.5 * static_cast<double>(camera.vertical_fov));
}

}  // namespace

CameraAxes axes_of(const Camera& camera) {
  const glm::dvec3 view = camera.look_at - camera.position;
  const double distance = glm::length(view);
  const glm::dvec3 forward = distance > 0 ? view / distance : glm::dvec3(0, 0, -1);
  glm::dvec3 right = glm::cross(forward, glm::dvec3(camera.up));
  // Negated, so that an `up` with a NaN in it is replaced as one along the view is.
  if (!(glm::length(right) > 1e-6 * glm::length(glm::dvec3(camera.up)))) {
    right =
        glm::cross(forward, std::abs(forward.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, -1));
  }
  right = glm::normalize(right);
  return {right, glm::cross(right, forward), forward};
}

glm::vec3 Camera::direction(float x, float y) const {
  const CameraAxes axes = axes_of(*this);
  const double pixel = 2 * half_height(*this) / height;
  const double across = (static_cast<double>(x) - 0.5 * width) * pixel;
  const double upward = (0.5 * height - static_cast<double>(y)) * pixel;
  return glm::vec3(glm::normalize(axes.forward + across * axes.right + upward * axes.up));
}

float Camera::pixel_angle() const {
  return static_cast<float>(std::atan(2 * half_height(*this) / height));
}

void check_camera(const Camera& camera, const char* field) {
  const auto require = [&](bool holds, const char* text) {
    if (!holds) throw RequestError(field, "the `" + std::string(field) + "` " + text);
  };
  const glm::dvec3 up(camera.up);
  require(is_finite(camera.position) && is_finite(camera.look_at),
          "stands or looks where a coordinate is not finite");
  require(is_finite(up) && up != glm::dvec3(0), "has an up direction of zero or not finite");
  require(camera.vertical_fov > 0 && camera.vertical_fov < kPi,
          "has an angle that is not above 0 and below pi");
  require(camera.width > 0 && camera.height > 0, "has no pixels");
}

std::string to_json(const Camera& camera) {
  check_camera(camera, "camera");
  return dump_json(Json{{"position", to_json_array(camera.position)},
                        {"look_at", to_json_array(camera.look_at)},
                        {"up", to_json_array(camera.up)},
                        {"vertical_fov", camera.vertical_fov},
                        {"width", camera.width},
                        {"height", camera.height}},
                   "camera");
}

Camera camera_from_json(const std::string& text) {
  const Json json = parse_json(text, "camera");
  JsonFields fields(json, "camera");
  Camera camera;
  fields.read("position", camera.position, kFiniteWide);
  fields.read("look_at", camera.look_at, kFiniteWide);
  fields.read("up", camera.up, kFinite);
  fields.read("vertical_fov", camera.vertical_fov, kFov);
  fields.read("width", camera.width, kPixels);
  fields.read("height", camera.height, kPixels);
  fields.finish();
  if (glm::dot(camera.up, camera.up) == 0) fields.fail("up must not be zero");
  return camera;
}

}  // namespace ptc
