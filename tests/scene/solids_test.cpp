// Which double-sided surfaces count as one-sided, since they enclose nothing.
#include "engine/scene/sampling/solids.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

Mesh double_sided_mesh() {
  Mesh mesh = empty_mesh();
  mesh.materials[0].double_sided = true;
  return mesh;
}

/// Closes the solids of a mesh, and returns the number of triangles that are double-sided then.
std::size_t double_sided(Mesh mesh, const LightRig& lights = {}) {
  const Solids solids = find_solids(mesh);
  const RayScene scene(mesh);
  close_solids(mesh, solids, scene, lights);
  return static_cast<std::size_t>(
      std::count_if(mesh.material_of.begin(), mesh.material_of.end(),
                    [&](std::uint16_t m) { return mesh.materials[m].double_sided; }));
}

constexpr std::size_t kBox = 12;  // triangles

}  // namespace

TEST_CASE("solids: a closed surface that looks outwards has one side, wherever it lies",
          "[scene][solids]") {
  for (const double far : {0.0, 1e7}) {
    Mesh mesh = double_sided_mesh();
    mesh.origin = glm::dvec3(far);
    add_box(mesh, {-1, -1, -1}, {1, 1, 1}, false);
    turn(mesh, Random(3).rotation());
    CHECK(double_sided(mesh) == 0);
  }
  Mesh ball = sphere(1, 40);
  for (glm::vec3& p : ball.positions) {
    if (std::abs(p.y) > 0.9999F) p = {0, std::copysign(1.0F, p.y), 0};  // the poles are rounded
  }
  ball.materials[0].double_sided = true;
  CHECK(double_sided(ball) == 0);
}

TEST_CASE("solids: what is open, or looks inwards, keeps both sides", "[scene][solids]") {
  Mesh inward = double_sided_mesh();
  add_box(inward, {-1, -1, -1}, {1, 1, 1}, true);
  CHECK(double_sided(inward) == kBox);
  Mesh open = double_sided_mesh();
  add_box(open, {-1, -1, -1}, {1, 1, 1}, false);
  open.triangles.pop_back();
  open.material_of.pop_back();
  CHECK(double_sided(open) == kBox - 1);
  Mesh flipped = double_sided_mesh();  // one triangle looks the other way
  add_box(flipped, {-1, -1, -1}, {1, 1, 1}, false);
  std::swap(flipped.triangles[0][0], flipped.triangles[0][1]);
  CHECK(double_sided(flipped) == kBox);
  Mesh sheet = double_sided_mesh();
  add_quad(sheet, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  CHECK(double_sided(sheet) == 2);
}

TEST_CASE("solids: each surface of a mesh is looked at by itself", "[scene][solids]") {
  Mesh mesh = double_sided_mesh();
  mesh.materials.emplace_back();  // one-sided
  add_box(mesh, {-1, 0, -1}, {1, 2, 1}, false);
  add_quad(mesh, {-5, 0, -5}, {0, 0, 10}, {10, 0, 0});
  add_box(mesh, {3, 1, 3}, {4, 2, 4}, false);
  mesh.material_of[0] = 1;
  CHECK(double_sided(mesh) == 2);
  const Solids solids = find_solids(mesh);
  CHECK(solids.count == 2);
  // Nothing is looked for where no material has two sides.
  mesh.materials[0].double_sided = false;
  CHECK(find_solids(mesh).count == 0);
}

TEST_CASE("solids: a closed surface with light or things inside is a room", "[scene][solids]") {
  Mesh room = double_sided_mesh();
  add_box(room, {-1, -1, -1}, {1, 1, 1}, false);
  SECTION("a point light") {
    LightRig rig;
    rig.points.push_back({{0.5, 0.5, 0.9}, glm::vec3(1), ""});
    CHECK(double_sided(room, rig) == kBox);
    rig.points[0].position.x = 1.5;
    CHECK(double_sided(room, rig) == 0);
  }
  SECTION("a spot light") {
    LightRig rig;
    rig.spots.emplace_back();
    CHECK(double_sided(room, rig) == kBox);
  }
  SECTION("a lamp that is too small for most rays") {
    room.materials.emplace_back();
    room.materials[1].emission = glm::vec3(100);
    add_quad(room, {0.9F, 0.9F, 0.9F}, {0.001F, 0, 0}, {0, 0, 0.001F}, 1);
    CHECK(double_sided(room) == kBox);
  }
  SECTION("a table") {
    add_box(room, {-0.5F, -1.0F, -0.5F}, {0.5F, -0.3F, 0.5F}, false);
    CHECK(double_sided(room) == kBox);  // that of the room; the table is solid
  }
}

TEST_CASE("solids: what is sunk a little into a solid makes it no room", "[scene][solids]") {
  Mesh slab = double_sided_mesh();
  add_box(slab, {-2, -0.2F, -2}, {2, 0, 2}, false);
  add_box(slab, {-0.1F, -0.05F, -0.1F}, {0.1F, 1, 0.1F}, false);  // the leg of a table
  CHECK(double_sided(slab) <= kBox);  // the leg, in which the top of the slab is seen
}
