// The camera of a picture for which none was asked: the scene fills it.
#include "engine/pipeline/render/overview.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/pipeline/build/build_container.h"
#include "engine/store/reader.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Where points lie in a picture: 0 is its middle, and 1 its right or upper edge.
struct Seen {
  double left = 1e9, right = -1e9, bottom = 1e9, top = -1e9;
};

Seen seen_of(const std::vector<glm::dvec3>& points, const Camera& camera) {
  const CameraAxes axes = axes_of(camera);
  const double tall = std::tan(static_cast<double>(camera.vertical_fov) / 2);
  const double wide = tall * camera.width / camera.height;
  Seen seen;
  for (const glm::dvec3& p : points) {
    const glm::dvec3 to = p - camera.position;
    const double depth = glm::dot(to, axes.forward);
    REQUIRE(depth > 0);
    const double x = glm::dot(to, axes.right) / (depth * wide);
    const double y = glm::dot(to, axes.up) / (depth * tall);
    seen = {std::min(seen.left, x), std::max(seen.right, x), std::min(seen.bottom, y),
            std::max(seen.top, y)};
  }
  return seen;
}

/// Even points of an ellipsoid far from the origin.
std::vector<glm::dvec3> ellipsoid(const glm::dvec3& axes) {
  std::vector<glm::dvec3> points;
  for (int i = 0; i < 5000; ++i) {
    const double z = 1 - (2 * i + 1) / 5000.0, r = std::sqrt(1 - z * z), turn = 2.399963 * i;
    points.push_back(glm::dvec3(1e5, 20, -3e4) +
                     axes * glm::dvec3(r * std::cos(turn), r * std::sin(turn), z));
  }
  return points;
}

Camera overview_of(const std::filesystem::path& cloud, const std::vector<glm::dvec3>& points,
                   const glm::dvec3& up) {
  {
    std::ofstream out(cloud);
    out.precision(17);
    for (const glm::dvec3& p : points) out << p.x << ' ' << p.y << ' ' << p.z << '\n';
  }
  Progress silent;
  build_container({.inputs = {cloud}}, cloud.string() + ".ptcx", silent);
  const ContainerReader scene(cloud.string() + ".ptcx");
  return overview(scene, up, false, std::array{800U, 500U});
}

}  // namespace

TEST_CASE("overview: a scene fills the picture, and all of it is seen", "[integration]") {
  const TemporaryDirectory dir;
  const auto axes = GENERATE(glm::dvec3(1, 1, 1), glm::dvec3(9, 1, 1), glm::dvec3(0.1, 0.2, 3),
                             glm::dvec3(1, 0.1, 1));
  const auto up = GENERATE(glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1), glm::dvec3(1, 0, 0));
  const auto points = ellipsoid(axes);
  const Seen seen = seen_of(points, overview_of(dir / "cloud.xyz", points, up));
  CHECK(seen.left > -1);
  CHECK(seen.right < 1);
  CHECK(seen.bottom > -1);
  CHECK(seen.top < 1);
  CHECK(std::max(seen.right - seen.left, seen.top - seen.bottom) > 2 * 0.8);
  CHECK(seen.left + seen.right == Approx(0).margin(0.3));
  CHECK(seen.bottom + seen.top == Approx(0).margin(0.3));
}

TEST_CASE("overview: a point that strayed does not shrink the scene", "[integration]") {
  const TemporaryDirectory dir;
  auto points = ellipsoid(glm::dvec3(1));
  points.push_back(points.front() + glm::dvec3(90, 0, 0));
  const Camera camera = overview_of(dir / "cloud.xyz", points, glm::dvec3(0, 0, 1));
  points.pop_back();
  const Seen seen = seen_of(points, camera);
  CHECK(seen.top - seen.bottom > 2 * 0.7);
}
