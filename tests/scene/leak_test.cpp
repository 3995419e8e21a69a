// Light must not come through closed walls, and a surface must not hide itself.
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/mesh_reference.h"
#include "engine/scene/sampling/directions.h"
#include "engine/scene/step_off.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

// Suns all around and a bright sky.
LightRig outside() {
  LightRig rig;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        rig.suns.push_back({glm::normalize(glm::vec3(x, y, z)), glm::vec3(1), 0.3f});
        rig.suns.push_back({glm::normalize(glm::vec3(x, y, z)), glm::vec3(1), 0});
      }
    }
  }
  rig.sky.radiance = glm::vec3(1);
  return rig;
}

constexpr LightSampling kSampling{2, 1, 32};

// A point on a wall of the box [-1, 1]^3, sometimes very near to an edge or corner.
struct WallPoint {
  glm::dvec3 position;
  glm::dvec3 normal;  // inwards
};

WallPoint wall_point(Random& random) {
  glm::dvec3 p = random.in_box(-1, 1);
  for (int axis = 0; axis < 3; ++axis) {
    if (random.unit() < 0.4) continue;
    const double gap = random.unit() < 0.2 ? 0 : std::pow(10, random.between(-12, -1));
    p[axis] = std::copysign(1 - gap, p[axis]);
  }
  const int wall = static_cast<int>(random.between(0, 3));
  p[wall] = std::copysign(1.0, p[wall]);
  glm::dvec3 normal(0);
  normal[wall] = -p[wall];
  return {p, normal};
}

void check_dark(const Mesh& mesh, const glm::dmat3& rotation, std::uint64_t seed, int count) {
  const RayScene scene(mesh);
  const DirectLight light(scene, outside());
  Random random(seed);
  int lit = 0;
  for (int i = 0; i < count; ++i) {
    const WallPoint at = wall_point(random);
    const auto result =
        light.irradiance(mesh.origin + rotation * at.position, glm::vec3(rotation * at.normal),
                         kSampling, static_cast<std::uint64_t>(i));
    if (result.local != glm::vec3(0) || result.sky != glm::vec3(0)) ++lit;
  }
  CHECK(lit == 0);
}

}  // namespace

TEST_CASE("leak: a closed box is dark to the last bit, even in its corners and edges",
          "[scene][leak]") {
  Mesh inward = empty_mesh();
  add_box(inward, glm::vec3(-1), glm::vec3(1), true);
  check_dark(inward, glm::dmat3(1), 1, 5000);

  Mesh outward = empty_mesh();
  add_box(outward, glm::vec3(-1), glm::vec3(1), false);
  check_dark(outward, glm::dmat3(1), 2, 3000);

  Mesh walled = inward;
  add_box(walled, glm::vec3(-1.05f), glm::vec3(1.05f), false);
  check_dark(walled, glm::dmat3(1), 3, 3000);
}

TEST_CASE("leak: a place whose triangle is known is stepped off as one that is looked for",
          "[scene][leak]") {
  Random random(6);
  Mesh mesh = empty_mesh();
  add_box(mesh, glm::vec3(-1), glm::vec3(1), true);
  add_box(mesh, glm::vec3(-0.3F), glm::vec3(0.4F), false);
  const RayScene scene(mesh);
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    for (int k = 0; k < 20; ++k) {
      const auto u = static_cast<float>(random.unit());
      const auto v = (1 - u) * static_cast<float>(random.unit());
      const SurfaceHit at = scene.surface(i, u, v);
      const auto known = step_off(scene, at, true);
      const auto found = step_off(scene, at.position, at.geometric_normal);
      REQUIRE(known.has_value() == found.has_value());
      if (known) CHECK(glm::distance(*known, *found) < 4 * scene.epsilon());
    }
  }
}

TEST_CASE("leak: a closed box is dark, however it is turned and wherever it lies",
          "[scene][leak]") {
  Random random(4);
  for (int i = 0; i < 8; ++i) {
    Mesh mesh = empty_mesh();
    add_box(mesh, glm::vec3(-1), glm::vec3(1), true);
    const glm::mat3 rotation = random.rotation();
    turn(mesh, rotation);
    if (i % 2 == 1) mesh.origin = {1e7, 2e7, -3e7};
    check_dark(mesh, glm::dmat3(rotation), 10 + static_cast<std::uint64_t>(i), 1000);
  }
}

TEST_CASE("leak: an acute closed wedge is dark up to its crease", "[scene][leak]") {
  for (const float angle : {1.0f, 0.5f, 0.1f, 0.05f}) {
    Mesh mesh = empty_mesh();
    const glm::vec3 a(0, 0, -1), b(1, 0, -1), c(std::cos(angle), std::sin(angle), -1);
    const glm::vec3 along(0, 0, 2);
    add_quad(mesh, a, along, b - a);                      // floor, looks up
    add_quad(mesh, a, c - a, along);                      // slope, looks down
    add_quad(mesh, b, along, c - b);                      // end, looks to the crease
    add_triangle(mesh, a, b, c);                          // looks to +z
    add_triangle(mesh, a + along, c + along, b + along);  // looks to -z
    const RayScene scene(mesh);
    const DirectLight light(scene, outside());
    Random random(5);
    int lit = 0;
    for (int i = 0; i < 3000; ++i) {
      const double x = std::pow(10, random.between(-10, 0)) * 0.999;
      const glm::dvec3 p(x, 0, random.between(-0.999, 0.999));
      const auto result = light.irradiance(p, {0, 1, 0}, kSampling, static_cast<std::uint64_t>(i));
      if (result.local != glm::vec3(0) || result.sky != glm::vec3(0)) ++lit;
    }
    CHECK(lit == 0);
  }
}

TEST_CASE("leak: no plane hides itself, whatever its tilt, size and place", "[scene][leak]") {
  Random random(6);
  const double infinity = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 60; ++i) {
    Mesh mesh = ground(static_cast<float>(std::pow(10, random.between(-4, 5))));
    turn(mesh, random.rotation());
    if (i % 3 == 1) mesh.origin = {1e7, -1e7, 3e7};
    if (i % 3 == 2) {
      for (glm::vec3& p : mesh.positions)
        p += glm::vec3(random.in_box(-1, 1)) * glm::length(p) * 0.2f;
    }
    const RayScene scene(mesh);
    const DirectLight light(scene, outside());
    int hidden = 0;
    for (int k = 0; k < 200; ++k) {
      const float u = static_cast<float>(random.unit());
      const SurfaceHit at = scene.surface(static_cast<std::uint32_t>(k % 2), u,
                                          static_cast<float>(random.unit()) * (1 - u));
      const auto origin = step_off(scene, at.position, at.geometric_normal);
      REQUIRE(origin);
      glm::vec3 direction = random.direction();
      direction -=
          0.999f * glm::dot(direction, at.geometric_normal) * at.geometric_normal;  // grazing
      direction = glm::normalize(direction);
      if (glm::dot(direction, at.geometric_normal) < 0) direction = -direction;
      if (scene.occluded(*origin, direction, 0, infinity)) ++hidden;
    }
    if (i % 3 != 2) CHECK(hidden == 0);  // two triangles in different planes do see each other
  }
}

TEST_CASE("leak: a point under a contact is dark, and one next to it is lit", "[scene][leak]") {
  Mesh mesh = ground(10);
  add_box(mesh, {-1, 0, -1}, {1, 2, 1}, false);  // stands on the ground, its bottom in it
  const RayScene scene(mesh);
  LightRig rig;
  rig.sky.radiance = glm::vec3(1);
  const DirectLight light(scene, rig);
  CHECK(light.irradiance({0.3, 0, 0.2}, {0, 1, 0}, {}, 1).sky == glm::vec3(0));
  CHECK(light.irradiance({1.0 + 1e-7, 0, 0.2}, {0, 1, 0}, {}, 1).sky.x ==
        Approx(kPi / 2).epsilon(0.1));
  CHECK(light.irradiance({1.0, 0.5, 0.2}, {1, 0, 0}, {}, 1).sky.x > 1);
}

TEST_CASE("leak: a strongly tilted normal does not put the point under its own surface",
          "[scene][leak]") {
  Random random(7);
  for (int i = 0; i < 20; ++i) {
    Mesh mesh = ground(10);
    const glm::mat3 rotation = random.rotation();
    turn(mesh, rotation);
    const RayScene scene(mesh);
    int below = 0;
    for (int k = 0; k < 200; ++k) {
      const float lean = static_cast<float>(random.between(0.02, 1));
      const glm::vec3 normal = rotation * glm::normalize(glm::vec3(1, lean, 0));
      const SurfaceHit at = scene.surface(0, 0.3f, static_cast<float>(random.between(0, 0.7)));
      const auto origin = step_off(scene, at.position, normal);
      REQUIRE(origin);
      const double height = glm::dot(*origin - at.position, glm::dvec3(at.geometric_normal));
      if (height < 1.9 * scene.epsilon()) ++below;
    }
    CHECK(below == 0);
  }
}
