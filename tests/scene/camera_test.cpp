// The pinhole camera and its record.
#include "engine/scene/camera.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

void check_equal(const glm::vec3& a, const glm::vec3& b) {
  CHECK(glm::distance(a, b) < 1e-6f);
}

}  // namespace

TEST_CASE("camera: the middle of the picture looks at the target, upright and not mirrored",
          "[scene][camera]") {
  Camera camera;
  camera.position = {0, 0, 5};
  camera.look_at = {0, 0, 0};
  camera.vertical_fov = 1.5707964f;
  camera.width = 200;
  camera.height = 100;
  check_equal(camera.direction(100, 50), {0, 0, -1});
  check_equal(camera.direction(100, 0), glm::normalize(glm::vec3(0, 1, -1)));
  check_equal(camera.direction(100, 100), glm::normalize(glm::vec3(0, -1, -1)));
  check_equal(camera.direction(0, 50), glm::normalize(glm::vec3(-2, 0, -1)));
  check_equal(camera.direction(200, 50), glm::normalize(glm::vec3(2, 0, -1)));
  check_equal(camera.direction(0, 0), glm::normalize(glm::vec3(-2, 1, -1)));
}

TEST_CASE("camera: the pixel angle is the angle between rays through neighbouring pixels",
          "[scene][camera]") {
  Camera camera;
  camera.height = 540;
  const float cosine = glm::dot(camera.direction(480, 270), camera.direction(480, 271));
  const float sine =
      glm::length(glm::cross(camera.direction(480, 270), camera.direction(480, 271)));
  CHECK(camera.pixel_angle() == Approx(std::atan2(sine, cosine)).epsilon(1e-3));
}

TEST_CASE("camera: directions are unit vectors wherever the camera looks", "[scene][camera]") {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    Camera camera;
    camera.position = random.in_box(-1e7, 1e7);
    camera.look_at = i == 0 ? camera.position : camera.position + random.in_box(-1, 1);
    camera.up = i % 2 == 0 ? glm::vec3(camera.look_at - camera.position) : glm::vec3(0, 1, 0);
    if (i == 0) camera.up = {0, 0, 1};
    CHECK(glm::length(camera.direction(0, 0)) == Approx(1).epsilon(1e-5));
    CHECK(glm::length(camera.direction(960, 270)) == Approx(1).epsilon(1e-5));
  }
}

TEST_CASE("camera: a camera written as JSON is read back exactly", "[scene][camera]") {
  Random random(2);
  for (int i = 0; i < 200; ++i) {
    Camera camera;
    camera.position = random.in_box(-1e8, 1e8);
    camera.look_at = random.in_box(-1, 1);
    camera.up = random.direction() * static_cast<float>(random.between(1e-6, 1e6));
    camera.vertical_fov = static_cast<float>(random.between(0.01, 3));
    camera.width = static_cast<unsigned>(random.between(1, 65536));
    camera.height = static_cast<unsigned>(random.between(1, 65536));
    const Camera back = camera_from_json(to_json(camera));
    CHECK(back.position == camera.position);
    CHECK(back.look_at == camera.look_at);
    CHECK(back.up == camera.up);
    CHECK(back.vertical_fov == camera.vertical_fov);
    CHECK(back.width == camera.width);
    CHECK(back.height == camera.height);
  }
}

TEST_CASE("camera: absent members keep their defaults", "[scene][camera]") {
  const Camera camera = camera_from_json("{\"width\": 17}");
  CHECK(camera.width == 17);
  CHECK(camera.height == Camera{}.height);
  CHECK(camera.position == Camera{}.position);
}

TEST_CASE("camera: every proper prefix of its JSON is refused", "[scene][camera]") {
  const std::string whole = to_json(Camera{});
  for (std::size_t n = 0; n < whole.size(); ++n) {
    CHECK_THROWS_AS(camera_from_json(whole.substr(0, n)), DataError);
  }
}

TEST_CASE("camera: JSON that makes no camera is refused with the member's name",
          "[scene][camera]") {
  const auto refuses = [](const std::string& text, const std::string& name) {
    CHECK_THROWS_WITH(camera_from_json(text), Catch::Contains("camera") && Catch::Contains(name));
    CHECK_THROWS_AS(camera_from_json(text), DataError);
  };
  refuses("[]", "object");
  refuses("{\"positon\": [0, 0, 0]}", "positon");
  refuses("{\"position\": [0, 0]}", "position");
  refuses("{\"position\": [0, 0, \"x\"]}", "position");
  refuses("{\"position\": 3}", "position");
  refuses("{\"position\": [0, 0, null]}", "position");
  refuses("{\"up\": [0, 0, 0]}", "up");
  refuses("{\"up\": [1e39, 0, 0]}", "up");
  refuses("{\"vertical_fov\": 0}", "vertical_fov");
  refuses("{\"vertical_fov\": 3.2}", "vertical_fov");
  refuses("{\"vertical_fov\": true}", "vertical_fov");
  refuses("{\"width\": 0}", "width");
  refuses("{\"width\": -4}", "width");
  refuses("{\"width\": 1.5}", "width");
  refuses("{\"height\": 65537}", "height");
  refuses("{\"height\": 1e400}", "JSON");
}

TEST_CASE("camera: a camera with non-finite numbers is not written", "[scene][camera]") {
  Camera camera;
  camera.position.y = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(to_json(camera), RequestError);
}

TEST_CASE("camera: one that shows nothing is refused", "[scene][camera]") {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  const auto refuses = [](auto&& spoil) {
    Camera camera;
    spoil(camera);
    CHECK_THROWS_AS(check_camera(camera, "camera"), RequestError);
  };
  CHECK_NOTHROW(check_camera(Camera{}, "camera"));
  refuses([](Camera& c) { c.position.x = kNaN; });
  refuses([](Camera& c) { c.look_at.z = kNaN; });
  refuses([](Camera& c) { c.up = glm::vec3(0); });
  refuses([](Camera& c) { c.up.x = kNaN; });
  refuses([](Camera& c) { c.vertical_fov = 0; });
  refuses([](Camera& c) { c.vertical_fov = 7; });
  refuses([](Camera& c) { c.width = 0; });
}
