// Finer surfels where a camera looks close.
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/scene/sampling/spacing_field.h"
#include "tests/scene/coverage.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

// A camera that looks down at the ground from a height.
Camera overhead(double height) {
  Camera camera;
  camera.position = {0, height, 0};
  camera.look_at = {0, 0, 0};
  camera.up = {0, 0, -1};
  camera.vertical_fov = 0.8f;
  camera.width = 200;
  camera.height = 100;
  return camera;
}

std::vector<Surfel> sample_view(const Mesh& mesh, const SamplingOptions& options) {
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  const ThreadPool executor(2);
  return drain(*sample_mesh(light, scene, options, executor));
}

}  // namespace

TEST_CASE("spacing field: it is distance times pixel angle in view, and the spacing elsewhere",
          "[scene][sampler]") {
  SamplingOptions options;
  options.spacing = 0.5;
  options.camera = overhead(10);
  options.pixels_per_surfel = 2;
  options.finest = 0.1f;
  const SpacingField field(options);
  const double angle = 2 * static_cast<double>(options.camera->pixel_angle());
  CHECK(field.at({0, 0, 0}, 0) == Approx(10 * angle));
  CHECK(field.at({0, 8, 0}, 0) == Approx(0.05));  // not finer than the finest
  CHECK(field.at({0, 7, 0}, 0) == Approx(3 * angle).margin(1e-9));
  CHECK(field.at({0, -90, 0}, 0) == 0.5);              // not wider than the spacing
  CHECK(field.at({0, 12, 0}, 0) == 0.5);               // behind the camera
  CHECK(field.at({0, 0, 6}, 0) == 0.5);                // outside the view
  CHECK(field.at({0, 0, 4.5}, 0) < 0.5);               // just outside, where the view is enlarged
  CHECK(field.at({9, 0, 0}, 0) < 0.5);                 // the picture is wider than high
  CHECK(field.at({0, 0, 6}, 3) < 0.5);                 // a ball that reaches into it
  CHECK(field.at({0, 0, 0}, 1) == Approx(9 * angle));  // by its nearest point
}

TEST_CASE("spacing field: a ball gets the finest spacing that any of its points needs",
          "[scene][sampler]") {
  SamplingOptions options;
  options.spacing = 0.5;
  options.camera = overhead(10);
  const SpacingField field(options);
  Random random(1);
  for (int i = 0; i < 3000; ++i) {
    const glm::dvec3 centre = random.in_box(-12, 12);
    const double radius = random.between(0, 5);
    const glm::dvec3 inside = centre + random.unit() * radius * glm::dvec3(random.direction());
    CHECK(field.at(centre, radius) <= field.at(inside, 0) * (1 + 1e-9));
  }
}

TEST_CASE("sampler: near a camera surfels are as close as its pixels and cover as well",
          "[scene][sampler]") {
  const Mesh mesh = ground(10);
  SamplingOptions options;
  options.spacing = 0.25;
  options.camera = overhead(8);  // pixels of 0.068 on the ground below
  options.pixels_per_surfel = 1;
  const auto surfels = sample_view(mesh, options);
  const double fine = 8 * static_cast<double>(options.camera->pixel_angle());
  int in_view = 0;
  for (const Surfel& s : surfels) {
    const glm::dvec3 p = glm::abs(s.position);
    if (p.x < 2 && p.z < 2) {
      ++in_view;
      CHECK(static_cast<double>(s.radius) < 1.4 * 1.1 * fine * std::sqrt(0.5));
    }
    if (p.z > 7) CHECK(static_cast<double>(s.radius) > 0.6 * 0.25 * std::sqrt(0.5));
  }
  // There are a little fewer, because the distance grows towards the border of the 4 x 4 square.
  CHECK(in_view == Approx(16 / (fine * fine)).epsilon(0.12));
  CHECK(covered_area(surfels) == Approx(400).epsilon(1e-6));
  const Coverage c = measure_coverage(mesh, surfels, 0.25, 40000);
  INFO("hole " << c.largest_hole << ", uncovered " << c.uncovered);
  CHECK(c.uncovered < 0.01);
}

TEST_CASE("sampler: a camera that sees nothing changes nothing", "[scene][sampler]") {
  const Mesh mesh = ground(1);
  SamplingOptions options;
  options.count = 1000;
  const auto without = sample_view(mesh, options);
  options.camera = overhead(5);
  options.camera->look_at = {0, 50, 0};
  options.camera->up = {1, 0, 0};
  const auto with = sample_view(mesh, options);
  REQUIRE(with.size() == without.size());
  for (std::size_t i = 0; i < with.size(); ++i) CHECK(with[i].position == without[i].position);
}

TEST_CASE("sampler: a camera on the surface makes nothing finer than the finest spacing",
          "[scene][sampler]") {
  const Mesh mesh = ground(1);
  SamplingOptions options;
  options.spacing = 0.1;
  options.finest = 0.25f;
  options.camera = overhead(5);
  options.camera->position = {0, 0, 0};
  options.camera->look_at = {1, 0, 0};
  options.camera->up = {0, 1, 0};
  const auto surfels = sample_view(mesh, options);
  CHECK(surfels.size() > 400);
  CHECK(surfels.size() < 6400);
  CHECK(covered_area(surfels) == Approx(4).epsilon(1e-6));
}
