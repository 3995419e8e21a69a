// Where a surface ends, and what lies inside a solid.
#include "engine/scene/sampling/surroundings.h"

#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/scene/step_off.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

constexpr float kRadius = 0.1F;
const glm::vec3 kUp(0, 1, 0);

// Says whether a place that is stepped off its surface is buried, or no place for rays at all.
bool is_hidden(const RayScene& scene, const glm::dvec3& position, const glm::vec3& normal,
               std::uint64_t seed) {
  const auto origin = step_off(scene, position, normal);
  return !origin || is_buried(scene, *origin, normal, seed);
}

}  // namespace

TEST_CASE("surroundings: a disc stays where the surface continues, flat or curved",
          "[scene][surroundings]") {
  const Mesh plane = ground(1);
  const RayScene scene(plane);
  for (const double x : {-0.85, 0.0, 0.3, 0.89}) {
    CHECK(move_inwards(scene, {x, 0, 0.1}, kUp, kRadius) == glm::vec3(0));
  }
  const Mesh ball = sphere(1, 40);
  const RayScene round(ball);
  CHECK(glm::length(move_inwards(round, {0, 1, 0}, kUp, 0.3F)) == 0);
}

TEST_CASE("surroundings: a disc past an edge moves until it extends as much as it leaves out",
          "[scene][surroundings]") {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    Mesh mesh = empty_mesh();
    add_box(mesh, glm::vec3(-1, -2, -1), glm::vec3(1, 0, 1), false);
    const glm::mat3 rotation = random.rotation();
    turn(mesh, rotation);
    const RayScene scene(mesh);
    for (const float distance : {0.25F, 0.5F, 0.65F, 0.8F}) {
      const glm::vec3 at = rotation * glm::vec3(1 - distance * kRadius, 0, 0.3F);
      const glm::vec3 moved = move_inwards(scene, glm::dvec3(at), rotation * kUp, kRadius);
      INFO(i << " at " << distance << " radii");
      CHECK(glm::distance(moved, rotation * glm::vec3(-(0.909F - distance) * kRadius, 0, 0)) <
            0.06F * kRadius);
    }
  }
}

TEST_CASE("surroundings: a corner moves a disc from both edges, a strip from neither",
          "[scene][surroundings]") {
  const Mesh plane = ground(1);
  const RayScene scene(plane);
  const glm::vec3 moved = move_inwards(scene, {0.95, 0, 0.95}, kUp, kRadius);
  CHECK(moved.x < -0.25F * kRadius);
  CHECK(glm::length(moved) < 1.1F * kRadius);
  CHECK(moved.x == Approx(moved.z).margin(0.05 * static_cast<double>(kRadius)));
  Mesh strip = empty_mesh();
  add_quad(strip, {-1, 0, 0.06F}, {2, 0, 0}, {0, 0, -0.12F});
  const RayScene narrow(strip);
  CHECK(glm::length(move_inwards(narrow, {0, 0, 0}, kUp, kRadius)) < 0.02F * kRadius);
}

TEST_CASE("surroundings: a disc stays where another surface hides the part past the edge",
          "[scene][surroundings]") {
  Mesh mesh = ground(1);
  add_quad(mesh, {1, 0, 1}, {0, 0, -2}, {0, 1, 0});
  const RayScene scene(mesh);
  CHECK(move_inwards(scene, {0.95, 0, 0}, kUp, kRadius) == glm::vec3(0));
  CHECK(move_inwards(scene, {-0.95, 0, 0}, kUp, kRadius).x > 0.3F * kRadius);
}

TEST_CASE("surroundings: a place is buried inside a solid and where solids touch, nowhere else",
          "[scene][surroundings]") {
  Mesh mesh = empty_mesh();
  add_box(mesh, {-2, -1, -2}, {2, 0, 2}, false);
  add_box(mesh, {-0.5F, 0, -0.5F}, {0.5F, 1, 0.5F}, false);  // stands on the first
  add_box(mesh, {0.4F, 0.25F, 0.4F}, {1, 0.5F, 1}, false);   // sunk into the second
  const RayScene scene(mesh);
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    CHECK(is_hidden(scene, {-0.3, 0, -0.3}, kUp, seed));
    CHECK(is_hidden(scene, {-0.3, 0, -0.3}, -kUp, seed));
    CHECK(is_hidden(scene, {0.45, 0.5, 0.45}, kUp, seed));
    CHECK(!is_hidden(scene, {0.7, 0.5, 0.7}, kUp, seed));
    CHECK(!is_hidden(scene, {0.7, 0, 0.7}, kUp, seed));  // under the third
    CHECK(!is_hidden(scene, {0, 1, 0}, kUp, seed));
  }
}

TEST_CASE("surroundings: a surface that shows its front or a reflecting back buries nothing",
          "[scene][surroundings]") {
  Mesh room = empty_mesh();
  add_box(room, glm::vec3(-1), glm::vec3(1), true);
  const RayScene inward(room);
  Mesh box = empty_mesh();
  add_box(box, glm::vec3(-1), glm::vec3(1), false);
  const RayScene outward(box);
  Mesh mirror = box;
  mirror.materials[0].double_sided = true;
  const RayScene reflecting(mirror);
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    CHECK(!is_hidden(inward, {0, -1, 0}, kUp, seed));
    CHECK(is_hidden(outward, {0, -1, 0}, kUp, seed));
  }
  CHECK(!is_hidden(reflecting, {0, -1, 0}, kUp, 1));
}

TEST_CASE("surroundings: the place under a surface that lies on another is buried",
          "[scene][surroundings]") {
  const Mesh plane = ground(1);
  const auto up = static_cast<float>(RayScene(plane).epsilon());
  Mesh mesh = plane;
  add_quad(mesh, {-0.5F, up, 0.5F}, {0, 0, -1}, {1, 0, 0});  // faces down
  const RayScene scene(mesh);
  CHECK(is_hidden(scene, {0, 0, 0}, kUp, 1));
  CHECK(!is_hidden(scene, {0.7, 0, 0}, kUp, 1));
}
