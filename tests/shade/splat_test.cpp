// The shapes that clusters are drawn as, compared with the surfels in them.
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/shade/reference/brute_force.h"
#include "tests/shade/gather_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr double kSpacing = 0.05;

/// A box with an even number of surfels along each side, facing outwards.
std::vector<Surfel> box(const glm::dvec3& size) {
  std::vector<Surfel> surfels;
  const glm::dvec3 x(size.x, 0, 0), y(0, size.y, 0), z(0, 0, size.z), low = size * -0.5;
  add_rectangle(surfels, low, y, x, kSpacing, glm::vec3(1));
  add_rectangle(surfels, low + z, x, y, kSpacing, glm::vec3(1));
  add_rectangle(surfels, low, z, y, kSpacing, glm::vec3(1));
  add_rectangle(surfels, low + x, y, z, kSpacing, glm::vec3(1));
  add_rectangle(surfels, low, x, z, kSpacing, glm::vec3(1));
  add_rectangle(surfels, low + y, z, x, kSpacing, glm::vec3(1));
  return surfels;
}

std::vector<Surfel> stack_of_sheets(int sheets) {
  std::vector<Surfel> surfels;
  for (int i = 0; i < sheets; ++i) {
    add_rectangle(surfels, {-1, -1, 0.1 * i}, {2, 0, 0}, {0, 2, 0}, kSpacing, glm::vec3(1));
  }
  return surfels;
}

std::vector<Surfel> ball() {
  std::vector<Surfel> surfels;
  add_sphere(surfels, {0, 0, 0}, 0.6, kSpacing, glm::vec3(1));
  return surfels;
}

/// A bowl that is open above, white outside and black inside.
std::vector<Surfel> bowl() {
  std::vector<Surfel> surfels = ball();
  std::erase_if(surfels, [](const Surfel& s) { return s.position.z > 0; });
  return surfels;
}

struct Covered {
  double rms, bias;  // errors of the covered solid angle, over its mean
  double light;      // bias of the mean radiance of the covered directions, over its mean
};

/// Compares what receivers all around the surfels see with rays. They open no cluster but the
/// largest.
Covered seen_as_clusters(const std::vector<Surfel>& surfels) {
  Scene scene(surfels);
  constexpr int kDirections = 200;
  for (int i = 0; i < kDirections; ++i) {
    const double z = (2.0 * i + 1) / kDirections - 1, turn = 2.39996 * i;
    const glm::dvec3 to(std::sqrt(1 - z * z) * std::cos(turn),
                        std::sqrt(1 - z * z) * std::sin(turn), z);
    scene.receivers.push_back({to * 6.0, glm::vec3(-to)});
  }
  ShadeOptions options;
  options.gather.solid_angle = 0.2F;
  options.gather.resolution = 64;
  const ThreadPool executor(1);
  Shader shader(*scene.container, options, executor);
  std::vector<Shading> results(scene.receivers.size());
  Progress silent;
  shader.shade(scene.receivers, results, silent);
  CHECK(shader.counts().surfels == 0);
  std::vector<Shading> exact(results.size());
  shade_brute_force(surfels, scene.receivers, exact, DirectionGrid(64, {}), Sides::both, executor);
  double square = 0, sum = 0, mean = 0, light = 0, exact_light = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    const double error =
        static_cast<double>(results[i].occlusion) - static_cast<double>(exact[i].occlusion);
    square += error * error;
    sum += error;
    mean += static_cast<double>(exact[i].occlusion);
    light += static_cast<double>(results[i].irradiance.g);
    exact_light += static_cast<double>(exact[i].irradiance.g);
  }
  const auto n = static_cast<double>(exact.size());
  return {std::sqrt(square / n) / (mean / n), sum / mean,
          light / (mean + sum) / (exact_light / mean) - 1};
}

}  // namespace

TEST_CASE("splats: clusters cover little more than their surfels and are as bright",
          "[shade][gather]") {
  struct Shape {
    const char* name;
    std::vector<Surfel> surfels;
    double rms, bias, light;
  };
  // A disc extends past the edges of a lone sheet, and an ellipsoid of revolution ignores that a
  // shape is long.
  const std::vector<Shape> shapes{
      {"a cube", box({1, 1, 1}), 0.30, 0.27, 0.15},
      {"a ball", ball(), 0.48, 0.46, 0.06},
      {"a tower", box({0.6, 0.6, 2}), 0.70, 0.63, 0.04},
      {"a bowl", bowl(), 0.36, 0.34, 0.18},  // its black inside is seen
      {"a wall of two sides", box({2, 2, 0.1}), 0.46, 0.08, 0.03},
      {"a sheet", stack_of_sheets(1), 0.33, 0.30, 0.02},
      {"six sheets that face one way", stack_of_sheets(6), 0.27, 0.04, 0.02}};
  for (const Shape& shape : shapes) {
    const Covered covered = seen_as_clusters(shape.surfels);
    CAPTURE(shape.name, covered.rms, covered.bias, covered.light);
    CHECK(covered.rms < shape.rms);
    CHECK(std::abs(covered.bias) < shape.bias);
    CHECK(std::abs(covered.light) < shape.light);
  }
}
