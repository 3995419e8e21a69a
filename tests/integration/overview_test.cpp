// The camera of a picture for which none was asked: the scene fills it.
#include "engine/pipeline/render/overview.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/image/image.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/render/render_picture.h"
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
  return overview(scene, up, {}, std::array{800U, 500U});
}

/// An octahedron of a green that nothing else has, its corners at the ends of three axes.
Mesh octahedron(const glm::vec3& axes) {
  Mesh mesh;
  mesh.origin = {1e5, 20, -3e4};
  for (const float side : {-1.0F, 1.0F}) {
    for (int k = 0; k < 3; ++k) {
      glm::vec3 corner(0);
      corner[k] = side * axes[k];
      mesh.positions.push_back(corner);
    }
  }
  mesh.triangles = {{3, 4, 5}, {4, 0, 5}, {0, 1, 5}, {1, 3, 5},
                    {4, 3, 2}, {0, 4, 2}, {1, 0, 2}, {3, 1, 2}};
  mesh.material_of.assign(mesh.triangles.size(), 0);
  mesh.materials.push_back({.albedo = {0, 1, 0}});
  return mesh;
}

/// A picture of a mesh on a backdrop by the default camera, in the colours of its surfaces.
Image picture_on_backdrop(const Mesh& mesh, const std::filesystem::path& dir) {
  Progress silent;
  BuildRequest build{.mesh = std::make_shared<const Mesh>(mesh), .backdrop = true};
  build.sampling.count = 20'000;
  build_container(build, dir / "scene.ptcx", silent);
  RenderRequest render{{.scene = dir / "scene.ptcx"}};
  render.mesh = build.mesh;
  render.backdrop = true;
  render.samples = 1;
  render.size = {{160, 100}};
  render_picture(render, std::array{PictureTarget{dir / "albedo.png", "albedo"}}, silent);
  return read_image(dir / "albedo.png");
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

TEST_CASE("overview: what stands on a backdrop fills the picture, and all of it is seen",
          "[integration]") {
  const TemporaryDirectory dir;
  const auto axes = GENERATE(glm::vec3(1, 0.7F, 0.4F), glm::vec3(0.2F, 1, 0.3F),
                             glm::vec3(0.3F, 0.2F, 1), glm::vec3(1, 0.05F, 1));
  CAPTURE(axes.x, axes.y, axes.z);
  const Image picture = picture_on_backdrop(octahedron(axes), dir.path());
  unsigned left = picture.width, right = 0, top = picture.height, bottom = 0;
  for (unsigned y = 0; y < picture.height; ++y) {
    for (unsigned x = 0; x < picture.width; ++x) {
      const glm::vec3& colour = picture.at(x, y);
      if (colour.g < 0.9F || colour.r > 0.1F) continue;  // ground, wall or sky
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  }
  REQUIRE(left <= right);
  CHECK(left > 0);
  CHECK(right < picture.width - 1);
  CHECK(top > 0);
  CHECK(bottom < picture.height - 1);
  CHECK((right - left > picture.width * 0.75 || bottom - top > picture.height * 0.75));
}

TEST_CASE("overview: the box before a backdrop is that of the mesh", "[integration]") {
  Mesh mesh = octahedron({1, 0.7F, 0.4F});
  const Bounds bounds = mesh.bounds();
  Progress silent;
  for (const bool smooth :
       {false, true}) {  // the backdrop of a mesh with normals has more vertices
    if (smooth) mesh.normals.assign(mesh.positions.size(), {0, 0, 1});
    const Bounds box =
        bounds_before_backdrop(load_meshes({}, &mesh, {.backdrop = true}, {}, silent).mesh);
    CHECK(box.low == bounds.low);
    CHECK(box.high == bounds.high);
  }
}

TEST_CASE("overview: the camera of a mesh file keeps its horizontal angle in every shape",
          "[integration]") {
  const TemporaryDirectory dir;
  static_cast<void>(overview_of(dir / "cloud.xyz", ellipsoid(glm::dvec3(1)), {0, 1, 0}));
  const ContainerReader scene(dir / "cloud.xyz.ptcx");
  const MeshCamera from{.position = {1, 2, 3}, .horizontal_fov = 0.9F};
  for (const auto& size :
       {std::array{400U, 300U}, std::array{100U, 300U}, std::array{960U, 540U}}) {
    const Camera camera = default_camera(scene, {&from, 1}, {}, size);
    CHECK(camera.width == size[0]);
    CHECK(camera.height == size[1]);
    const float wide = std::tan(camera.vertical_fov / 2) * static_cast<float>(size[0]) /
                       static_cast<float>(size[1]);
    CHECK(wide == Approx(std::tan(0.45F)));
  }
  CHECK(default_camera(scene, {&from, 1}, {}, {}).vertical_fov ==
        default_camera(scene, {&from, 1}, {}, std::array{960U, 540U}).vertical_fov);
}
