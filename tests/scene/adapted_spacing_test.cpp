// Spacings that follow the surface and its light.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/scene/sampling/spacing_map.h"
#include "tests/scene/coverage.h"
#include "tests/scene/meshes.h"
#include "tools/bench/shapes/random.h"

using namespace ptc;
using ptc::bench::Random;

namespace {

std::vector<Surfel> sample(const Mesh& mesh, const LightRig& rig, bool adapts,
                           unsigned threads = 2) {
  SamplingOptions options;
  options.count = 20'000;
  options.adapts = adapts;
  const RayScene scene(mesh);
  const DirectLight light(scene, rig);
  const ThreadPool executor(threads);
  return drain(*sample_mesh(light, scene, options, executor));
}

/// The median radius of the surfels that `is_asked` asks for.
template <typename IsAsked>
double radius_of(const std::vector<Surfel>& surfels, const IsAsked& is_asked) {
  std::vector<double> radii;
  for (const Surfel& s : surfels) {
    if (is_asked(s)) radii.push_back(static_cast<double>(s.radius));
  }
  REQUIRE(radii.size() > 20);
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  return *middle;
}

/// A ball of radius 0.5 above a ground of 8 x 8.
Mesh ball_on_ground() {
  Mesh mesh = empty_mesh();
  add_quad(mesh, {-4, 0, -4}, {0, 0, 8}, {8, 0, 0});
  constexpr int kSteps = 48;
  const auto at = [](int i, int j) {
    constexpr double kTurn = std::numbers::pi / kSteps;
    const double up = kTurn * j, around = 2 * kTurn * i;
    return glm::vec3(0.5 * std::sin(up) * std::cos(around), 0.7 - 0.5 * std::cos(up),
                     -0.5 * std::sin(up) * std::sin(around));
  };
  for (int j = 0; j < kSteps; ++j) {
    for (int i = 0; i < kSteps; ++i) {
      if (j > 0) add_triangle(mesh, at(i, j), at(i + 1, j), at(i, j + 1));
      if (j + 1 < kSteps) add_triangle(mesh, at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  return mesh;
}

}  // namespace

TEST_CASE("spacing map: a ball gets the finest spacing near it, whatever its size",
          "[scene][sampler]") {
  Random random(3);
  std::vector<SpacingMap::Wish> wishes;
  for (int i = 0; i < 400; ++i) wishes.push_back({random.in_box(-10, 10), random.between(0.01, 1)});
  constexpr double kCell = 0.5;
  SpacingMap map(wishes, kCell);
  for (int i = 0; i < 2000; ++i) {
    const glm::dvec3 centre = random.in_box(-12, 12);
    const double radius = i % 4 == 0 ? 0 : std::exp2(random.between(-6, 5));
    const double found = map.at(centre, radius);
    // Every place in the ball counts, and none beyond the cells that the ball touches: those of the
    // level whose cells are no narrower than the ball
    const double reach = radius + kCell / 2, width = std::max(kCell, 4 * reach);
    double inside = 1e9, around = 1e9;
    for (const SpacingMap::Wish& wish : wishes) {
      const double distance = glm::distance(wish.place, centre);
      if (distance <= reach) inside = std::min(inside, wish.spacing);
      if (distance <= reach + 2 * width) around = std::min(around, wish.spacing);
    }
    CHECK(found <= inside);
    if (inside < 1e9) CHECK(found >= around);
  }
  const double before = map.at({0, 0, 0}, 3);
  map.scale(2);
  CHECK(map.at({0, 0, 0}, 3) == Approx(2 * before));
  CHECK(map.at({1e6, 0, 0}, 0) > 0);  // of the nearest, where there are none
  CHECK(map.at({1e6, 0, 0}, 0) <= 2);
}

TEST_CASE("adapted spacing: surfels are close where the surface turns, and as many as wanted",
          "[scene][sampler]") {
  const Mesh mesh = ball_on_ground();
  LightRig rig;
  rig.sky.radiance = glm::vec3(1);
  const auto surfels = sample(mesh, rig, true);
  CHECK(static_cast<double>(surfels.size()) == Approx(20'000).epsilon(0.05));
  CHECK(covered_area(surfels) == Approx(sampled_area(mesh)).epsilon(1e-6));
  const double on_ball = radius_of(surfels, [](const Surfel& s) { return s.position.y > 0.1; });
  const double far = radius_of(surfels, [](const Surfel& s) {
    return s.position.y == 0 && std::max(std::abs(s.position.x), std::abs(s.position.z)) > 2;
  });
  CHECK(far > 1.8 * on_ball);
  // What lies between is covered, too
  const auto even = sample(mesh, rig, false);
  const double spacing = std::sqrt(sampled_area(mesh) / 20'000);
  const Coverage with = measure_coverage(mesh, surfels, 4 * spacing, 40'000),
                 without = measure_coverage(mesh, even, spacing, 40'000);
  INFO("uncovered " << with.uncovered << ", evenly " << without.uncovered);
  CHECK(with.uncovered < without.uncovered + 0.004);
}

TEST_CASE("adapted spacing: surfels are close along the border of a shadow", "[scene][sampler]") {
  // A roof shades a stripe of the ground
  Mesh mesh = empty_mesh();
  add_quad(mesh, {-4, 0, -4}, {0, 0, 8}, {8, 0, 0});
  add_quad(mesh, {-0.5F, 1, -5}, {0, 0, 10}, {1, 0, 0});
  LightRig rig;
  rig.suns.push_back({.to_sun = {0, 1, 0}, .irradiance = glm::vec3(3)});
  const auto surfels = sample(mesh, rig, true);
  const auto on_ground = [](const Surfel& s, double x, double within) {
    return s.position.y == 0 && std::abs(std::abs(s.position.x) - x) < within;
  };
  const double border =
      radius_of(surfels, [&](const Surfel& s) { return on_ground(s, 0.5, 0.03); });
  const double lit = radius_of(surfels, [&](const Surfel& s) { return on_ground(s, 2.5, 1); });
  CHECK(lit > 2 * border);
}

TEST_CASE(
    "adapted spacing: it is even where nothing turns or changes, and the same for all threads",
    "[scene][sampler]") {
  Mesh flat = empty_mesh();
  add_quad(flat, {-4, 0, -4}, {0, 0, 8}, {8, 0, 0});
  LightRig rig;
  rig.sky.radiance = glm::vec3(1);
  const auto surfels = sample(flat, rig, true), even = sample(flat, rig, false);
  CHECK(static_cast<double>(surfels.size()) ==
        Approx(static_cast<double>(even.size())).epsilon(0.02));
  const auto all = [](const Surfel&) { return true; };
  CHECK(radius_of(surfels, all) == Approx(radius_of(even, all)).epsilon(0.02));

  const Mesh mesh = ball_on_ground();
  const auto one = sample(mesh, rig, true, 1), three = sample(mesh, rig, true, 3);
  REQUIRE(one.size() == three.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    CHECK(one[i].position == three[i].position);
    CHECK(one[i].radius == three[i].radius);
    CHECK(one[i].radiance == three[i].radiance);
  }
}
