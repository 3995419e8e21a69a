// Surfels of meshes that stand in many places.
#include "engine/scene/sampling/placed_sampler.h"

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/ray_scene.h"
#include "tests/scene/coverage.h"
#include "tests/scene/meshes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

Placement place_of(const glm::dvec3& at, double turn, const glm::dvec3& scale) {
  const glm::dmat3 m = glm::mat3_cast(glm::angleAxis(turn, glm::normalize(glm::dvec3(1, 2, 0.5))));
  return {m[0] * scale.x, m[1] * scale.y, m[2] * scale.z, at};
}

struct Sampled {
  SurfaceSurvey found;
  std::vector<Surfel> surfels;
};

Sampled sample(const Mesh& mesh, const std::vector<Placement>& places,
               const SamplingOptions& options, unsigned threads = 2, bool lamps = false) {
  const test::TemporaryDirectory dir;
  MeshParts parts;
  parts.add({std::make_shared<const Mesh>(mesh), nullptr, places});
  const SurfaceSurvey found = survey(parts, 1000, lamps);
  const ThreadPool executor(threads);
  const StreamingRoom room{.memory_bytes = StreamingRoom::kLeastBytes, .temp_dirs = {dir.path()}};
  return {found, drain(*sample_placed(parts, found, options, room, executor))};
}

/// The mesh in all places, copied.
Mesh copied(const Mesh& mesh, const std::vector<Placement>& places) {
  Mesh all;
  for (const Placement& place : places) {
    Mesh one = mesh;
    place_mesh(one, place);
    append_mesh(all, one, glm::dmat4(1));
  }
  return all;
}

}  // namespace

TEST_CASE("placed sampler: surfels cover each place as those of copies would", "[scene][placed]") {
  // Balls of several sizes, one flattened, one sheared by a turn of its axes, one mirrored
  const Mesh ball = sphere(1, 24);
  const std::vector<Placement> places{
      place_of({0, 0, 0}, 0.3, glm::dvec3(1)),    place_of({9, 0, 0}, 2, glm::dvec3(2)),
      place_of({0, 9, 0}, 1, {1, 0.3, 1}),        place_of({0, 0, 9}, 1, {2, 0.3, 0.7}),
      place_of({9, 9, 0}, 0.3, glm::dvec3(-1.5)), place_of({-9, 0, 0}, 0, {1.02, 1, 1})};
  const Mesh copies = copied(ball, places);
  SamplingOptions options;
  options.count = 20'000;
  const Sampled placed = sample(ball, places, options);
  CHECK(placed.found.groups.size() == 3);  // the ball itself, and two other shapes
  CHECK(placed.found.area == Approx(one_sided_area(copies)).epsilon(0.005));
  CHECK(static_cast<double>(placed.surfels.size()) == Approx(20'000).epsilon(0.02));
  CHECK(covered_area(placed.surfels) == Approx(one_sided_area(copies)).epsilon(0.005));
  const double spacing = std::sqrt(one_sided_area(copies) / 20'000);
  const Coverage coverage = measure_coverage(copies, placed.surfels, spacing, 5000);
  const RayScene scene(copies);
  const DirectLight light(scene, {});
  const ThreadPool executor(2);
  const Coverage usual =
      measure_coverage(copies, drain(*sample_mesh(light, scene, options, executor)), spacing, 5000);
  CHECK(coverage.uncovered < usual.uncovered + 0.002);
  CHECK(coverage.nearest_mean == Approx(usual.nearest_mean).epsilon(0.03));
  CHECK(coverage.nearest_deviation < 1.15 * usual.nearest_deviation);
  CHECK(coverage.largest_hole < 1.1 * usual.largest_hole);
  CAPTURE(usual.uncovered, usual.nearest_mean, usual.nearest_deviation, usual.largest_hole);
  CAPTURE(coverage.uncovered, coverage.nearest_mean, coverage.nearest_deviation,
          coverage.largest_hole);
  CHECK(placed.found.placed_by_area.size() >= 1000);
  for (const Surfel& surfel : placed.surfels) {
    REQUIRE(glm::length(glm::dvec3(surfel.normal)) == Approx(1).epsilon(1e-5));
    glm::dvec3 centre(0);
    double nearest = 1e9;
    for (const Placement& place : places) {
      const double distance = glm::distance(surfel.position, place[3]);
      if (distance < nearest) centre = place[3];
      nearest = std::min(nearest, distance);
    }
    REQUIRE(glm::dot(glm::dvec3(surfel.normal), surfel.position - centre) > 0);  // outwards
  }
}

TEST_CASE("placed sampler: surfels do not depend on threads, and the least is one for each place",
          "[scene][placed]") {
  std::vector<Placement> places;
  for (int i = 0; i < 300; ++i) places.push_back(place_of({3 * i, 0, 0}, i, glm::dvec3(1)));
  SamplingOptions options;
  options.count = 5000;
  const Sampled one = sample(sphere(1, 8), places, options, 1);
  const Sampled four = sample(sphere(1, 8), places, options, 4);
  REQUIRE(one.surfels.size() == four.surfels.size());
  bool same = true;
  for (std::size_t i = 0; i < one.surfels.size(); ++i) {
    same &= one.surfels[i].position == four.surfels[i].position &&
            one.surfels[i].radius == four.surfels[i].radius;
  }
  CHECK(same);
  options.count = 10;
  CHECK(sample(sphere(1, 8), places, options).surfels.size() == 300);
}

TEST_CASE("placed sampler: a camera asks for more surfels where it is near", "[scene][placed]") {
  const std::vector<Placement> places{place_of({0, 0, 0}, 0, glm::dvec3(1)),
                                      place_of({0, 0, -600}, 0, glm::dvec3(1))};
  SamplingOptions options;
  options.spacing = 0.5;
  options.camera = Camera{.position = {0, 0, 4}, .look_at = {0, 0, 0}};
  std::size_t near = 0, far = 0;
  for (const Surfel& surfel : sample(sphere(1, 24), places, options).surfels)
    ++(surfel.position.z > -30 ? near : far);
  CHECK(near > 20 * far);
  CHECK(far > 0);
}

TEST_CASE("placed sampler: what is closed has one side, unless lamps may be inside",
          "[scene][placed]") {
  Mesh box = empty_mesh();
  add_box(box, glm::vec3(-1), glm::vec3(1), false);
  box.materials[0].double_sided = true;
  const std::vector<Placement> places{place_of({0, 0, 0}, 0, glm::dvec3(1)),
                                      place_of({9, 0, 0}, 1, {1, 2, 1})};
  SamplingOptions options;
  options.count = 4000;
  const double area = one_sided_area(copied(box, places));
  CHECK(covered_area(sample(box, places, options).surfels) == Approx(area).epsilon(0.01));
  CHECK(covered_area(sample(box, places, options, 2, true).surfels) ==
        Approx(2 * area).epsilon(0.01));
}
