// Receivers of pictures of meshes keep clear of walls that stand on their surface.
#include "engine/pipeline/render/clearance.h"

#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/ray_scene.h"

using namespace ptc;

namespace {

constexpr double kLift = 0.01, kKept = 0.023;  // 2.3 lifts are kept

void add_quad(Mesh& mesh, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
  mesh.material_of.resize(mesh.triangles.size(), 0);
  mesh.materials.resize(1);
}

/// A floor, and a wall along x = 0 that looks to +x.
Mesh room() {
  Mesh mesh;
  add_quad(mesh, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
  add_quad(mesh, {0, -1, 0}, {0, 2, 0}, {0, 0, 1});
  return mesh;
}

/// Moves a place of the floor. @param towards  direction from which it is seen
glm::dvec3 moved(const Mesh& mesh, const glm::dvec3& place,
                 const glm::vec3& towards = {-0.5F, 0.2F, -0.6F}) {
  const RayScene scene(mesh);
  return clear_of_walls(scene, place, {0, 0, 1}, glm::normalize(towards), kLift);
}

}  // namespace

TEST_CASE("clearance: what no wall is near stays where it is", "[render]") {
  const Mesh mesh = room();
  for (const double x : {0.03, 0.2, 0.7}) {
    const glm::dvec3 place(x, 0.1, 0);
    CHECK(moved(mesh, place) == place);
  }
}

TEST_CASE("clearance: a place near a wall moves along its surface, to one distance", "[render]") {
  const Mesh mesh = room();
  double last = 0;
  for (const double x : {0.0, 1e-9, 0.001, 0.01, 0.02, 0.0229, 0.024, 0.026}) {
    CAPTURE(x);
    const glm::dvec3 at = moved(mesh, {x, 0.1, 0});
    CHECK(at.x == Approx(std::max(x, kKept)).margin(1e-4));
    CHECK(at.y == Approx(0.1));
    CHECK(at.z == Approx(0).margin(1e-12));
    CHECK(at.x >= last - 1e-4);  // so that nothing jumps as a camera moves
    last = at.x;
  }
}

TEST_CASE("clearance: a place in a corner keeps from both walls", "[render]") {
  Mesh mesh = room();
  add_quad(mesh, {-1, 0, 0}, {0, 0, 1}, {2, 0, 0});  // along y = 0, looks to +y
  const glm::dvec3 at = moved(mesh, {0.001, 0.002, 0});
  CHECK(at.x == Approx(kKept).margin(1e-4));
  CHECK(at.y == Approx(kKept).margin(1e-4));
}

TEST_CASE("clearance: a place in a slot stands in its middle, and never behind a wall",
          "[render]") {
  for (const double width : {0.002, 0.01, 0.03, 0.045}) {
    Mesh mesh = room();
    add_quad(mesh, {static_cast<float>(width), -1, 0}, {0, 0, 0.02F}, {0, 2, 0});
    for (const double share : {0.01, 0.1, 0.4, 0.6, 0.99}) {
      CAPTURE(width, share);
      const glm::dvec3 at = moved(mesh, {share * width, 0.1, 0}, {0, 0, -1});
      CHECK(at.x > 0.1 * width);
      CHECK(at.x < 0.9 * width);
    }
  }
}

TEST_CASE("clearance: a wall that leans counts by its distance", "[render]") {
  Mesh mesh;
  add_quad(mesh, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
  add_quad(mesh, {0, -1, 0}, {0, 2, 0}, {1, 0, 1});  // leans over the floor by 45 degrees
  const glm::dvec3 at = moved(mesh, {-0.5, 0, 0});
  CHECK(at.x == -0.5);
  const glm::dvec3 below = moved(mesh, {0.02, 0, 0});
  CHECK(below.x > 0.02);
  CHECK(below.x <= 0.02 + kKept + 1e-9);
}

TEST_CASE("clearance: a convex edge moves nothing", "[render]") {
  Mesh mesh;
  add_quad(mesh, {-1, -1, 0}, {1, 0, 0}, {0, 2, 0});  // a top up to x = 0
  add_quad(mesh, {0, -1, 0}, {0, 0, -1}, {0, 2, 0});  // the side below it
  for (const double x : {-1e-9, -0.001, -0.01}) {
    const glm::dvec3 place(x, 0.1, 0);
    CHECK(moved(mesh, place) == place);
  }
}
