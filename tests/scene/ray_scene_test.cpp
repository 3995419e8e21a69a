// Rays at a mesh, with a loop over all triangles in double as the oracle.
#include "engine/scene/ray_scene.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <memory>
#include <stdexcept>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

struct Expected {
  double distance = kFar;
  std::uint32_t triangle = 0;
  double margin = 0;  // smallest barycentric coordinate
};

// Solves origin + t d = (1 - u - v) a + u b + v c for each triangle by Cramer's rule.
Expected nearest(const Mesh& mesh, const glm::dvec3& origin, const glm::dvec3& d, double near) {
  Expected best;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& t = mesh.triangles[i];
    const glm::dvec3 a(mesh.positions[t[0]]);
    const glm::dvec3 ab = glm::dvec3(mesh.positions[t[1]]) - a;
    const glm::dvec3 ac = glm::dvec3(mesh.positions[t[2]]) - a;
    const glm::dvec3 to = origin - mesh.origin - a;
    const glm::dvec3 n = glm::cross(ab, ac);
    const double slope = -glm::dot(d, n);
    const double distance = glm::dot(to, n) / slope;
    const glm::dvec3 side = glm::cross(to, d);
    const double u = -glm::dot(ac, side) / -slope;
    const double v = glm::dot(ab, side) / -slope;
    const double margin = std::min({u, v, 1 - u - v});
    if (!(margin >= 0) || !(distance > near) || distance >= best.distance) continue;
    best = {distance, i, margin};
  }
  return best;
}

Mesh soup(Random& random, int triangles) {
  Mesh mesh = empty_mesh();
  for (int i = 0; i < triangles; ++i) {
    const glm::vec3 a(random.in_box(-1, 1));
    add_triangle(mesh, a, a + glm::vec3(random.in_box(-0.5, 0.5)),
                 a + glm::vec3(random.in_box(-0.5, 0.5)));
  }
  return mesh;
}

}  // namespace

TEST_CASE("ray scene: the closest hit is that of a loop over all triangles", "[scene][rays]") {
  Random random(1);
  const Mesh mesh = soup(random, 200);
  const RayScene scene(mesh);
  int hits = 0;
  for (int i = 0; i < 5000; ++i) {
    const glm::dvec3 origin = random.in_box(-1.5, 1.5);
    const glm::vec3 direction = random.direction();
    const Expected expected = nearest(mesh, origin, glm::dvec3(direction), 0);
    const auto hit = scene.closest(origin, direction, 0, kFar);
    if (expected.distance < kFar && expected.margin < 1e-5) continue;  // either side of an edge
    REQUIRE(hit.has_value() == (expected.distance < kFar));
    CHECK(scene.occluded(origin, direction, 0, kFar) == hit.has_value());
    if (!hit) continue;
    ++hits;
    CHECK(hit->triangle == expected.triangle);
    CHECK(hit->distance == Approx(expected.distance).margin(1e-5));
    CHECK(glm::distance(hit->position, origin + expected.distance * glm::dvec3(direction)) < 1e-5);
    CHECK(hit->front == (glm::dot(hit->geometric_normal, direction) < 0));
  }
  CHECK(hits > 1000);
}

TEST_CASE("ray scene: rays that are traced together meet what each meets alone", "[scene][rays]") {
  Random random(2);
  const Mesh mesh = soup(random, 100);
  const RayScene scene(mesh);
  int hidden = 0, seen = 0;
  for (std::size_t count = 0; count <= RayScene::kRaysAtOnce; ++count) {
    for (int i = 0; i < 50; ++i) {
      const glm::dvec3 origin = random.in_box(-1.5, 1.5);
      std::vector<glm::vec3> directions(count);
      for (glm::vec3& direction : directions) direction = random.direction();
      const std::uint32_t bits = scene.occluded(origin, directions, 0.1, 2);
      CHECK(bits >> count == 0);
      for (std::size_t k = 0; k < count; ++k) {
        const bool alone = scene.occluded(origin, directions[k], 0.1, 2);
        CHECK((bits >> k & 1U) == (alone ? 1U : 0U));
        (alone ? hidden : seen) += 1;
        const auto hit = scene.closest(origin, directions[k], 0.1, 2);
        const auto triangle = scene.closest_triangle(origin, directions[k], 0.1, 2);
        REQUIRE(triangle.has_value() == hit.has_value());
        if (hit) CHECK((triangle->triangle == hit->triangle && triangle->front == hit->front));
      }
    }
  }
  CHECK(std::min(hidden, seen) > 500);
}

TEST_CASE("ray scene: a triangle is plain without textures, colours and normals of vertices",
          "[scene][rays]") {
  Mesh mesh = ground(1);
  CHECK(RayScene(mesh).is_plain(0));
  Mesh coloured = mesh;
  coloured.colours.assign(mesh.positions.size(), glm::vec3(0.5F));
  CHECK(!RayScene(coloured).is_plain(0));
  mesh.normals.assign(mesh.positions.size(), glm::vec3(0, 1, 0));
  CHECK(!RayScene(mesh).is_plain(0));
}

TEST_CASE("ray scene: hits outside the range from near to far do not count", "[scene][rays]") {
  const Mesh mesh = ground(1);
  const RayScene scene(mesh);
  const glm::dvec3 origin(0.1, 2, 0.2);
  const glm::vec3 down(0, -1, 0);
  CHECK(scene.closest(origin, down, 0, 2.001)->distance == Approx(2));
  CHECK(!scene.closest(origin, down, 0, 1.999));
  CHECK(!scene.closest(origin, down, 2.001, kFar));
  CHECK(scene.closest(origin, down, 1.999, kFar));
  CHECK(scene.occluded(origin, down, 1.999, 2.001));
  CHECK(!scene.occluded(origin, down, 0, 1.999));
  CHECK(!scene.occluded(origin, down, 2.001, 10));
  CHECK(!scene.occluded(origin, -down, 0, kFar));
}

TEST_CASE("ray scene: ten million metres away the hits are the same as at the origin",
          "[scene][rays]") {
  Random random(2);
  Mesh mesh = soup(random, 100);
  Mesh moved = mesh;
  moved.origin = {1e7, -2e7, 1e7 + 0.5};
  const RayScene scene(mesh);
  const RayScene moved_scene(moved);
  for (int i = 0; i < 2000; ++i) {
    const glm::dvec3 origin = glm::round(random.in_box(-1.5, 1.5) * 1048576.0) / 1048576.0;
    const glm::vec3 direction = random.direction();
    const auto hit = scene.closest(origin, direction, 0, kFar);
    const auto far_hit = moved_scene.closest(origin + moved.origin, direction, 0, kFar);
    REQUIRE(hit.has_value() == far_hit.has_value());
    if (!hit) continue;
    CHECK(hit->triangle == far_hit->triangle);
    CHECK(hit->distance == far_hit->distance);
    CHECK(glm::distance(hit->position + moved.origin, far_hit->position) < 1e-8);
  }
}

TEST_CASE("ray scene: a ray from far away hits as precisely as one from nearby", "[scene][rays]") {
  const Mesh mesh = sphere(1, 40);
  const RayScene scene(mesh);
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const glm::vec3 direction = random.direction();
    const glm::dvec3 target = random.in_box(-0.5, 0.5);
    const glm::dvec3 close = target - 2.0 * glm::dvec3(direction);
    const glm::dvec3 away = target - 1e6 * glm::dvec3(direction);
    const auto a = scene.closest(close, direction, 0, kFar);
    const auto b = scene.closest(away, direction, 0, kFar);
    REQUIRE(a);
    REQUIRE(b);
    CHECK(glm::distance(a->position, b->position) < 1e-5);
    CHECK(b->distance - a->distance == Approx(1e6 - 2).epsilon(1e-11));
  }
}

TEST_CASE("ray scene: positions far from the mesh's origin keep the precision of its extent",
          "[scene][rays]") {
  Mesh mesh = empty_mesh();
  add_quad(mesh, {4095, 4096, 4097}, {2, 0, 0}, {0, 0, -2});
  const RayScene scene(mesh);
  CHECK(scene.epsilon() < 1e-5);
  const auto hit = scene.closest({4095.3, 4096.25, 4096.1}, {0, -1, 0}, 0, kFar);
  REQUIRE(hit);
  CHECK(hit->distance == Approx(0.25).epsilon(1e-6));
}

TEST_CASE("ray scene: no ray slips through edges and vertices of a closed mesh", "[scene][rays]") {
  Random random(4);
  Mesh mesh = sphere(1, 12);
  turn(mesh, random.rotation());
  const RayScene scene(mesh);
  for (const auto& t : mesh.triangles) {
    for (int k = 0; k < 6; ++k) {
      const glm::dvec3 a(mesh.positions[t[static_cast<std::size_t>(k % 3)]]);
      const glm::dvec3 b(mesh.positions[t[static_cast<std::size_t>((k + 1) % 3)]]);
      const glm::dvec3 on_edge = k < 3 ? a : a + random.unit() * (b - a);
      const glm::dvec3 origin = random.in_box(-0.3, 0.3);
      const glm::vec3 direction(glm::normalize(on_edge - origin));
      CHECK(scene.occluded(origin, direction, 0, kFar));
      CHECK(scene.closest(origin, direction, 0, kFar));
    }
  }
}

TEST_CASE("ray scene: a surface point has the mesh's position, colour and light", "[scene][rays]") {
  Mesh mesh = empty_mesh();
  mesh.origin = {100, 200, 300};
  add_triangle(mesh, {0, 0, 0}, {2, 0, 0}, {0, 4, 0}, 0);
  Material lamp;
  lamp.albedo = {0.1f, 0.2f, 0.3f};
  lamp.emission = {5, 6, 7};
  auto image = std::make_shared<const Texture>(Image{2, 1, {{1, 0, 0}, {0, 1, 0}}});
  lamp.texture = image;
  mesh.materials.push_back(lamp);
  mesh.material_of = {1};
  mesh.uvs = {{0.25f, 0}, {0.75f, 0}, {0.25f, 0}};
  const RayScene scene(mesh);
  const SurfaceHit hit = scene.surface(0, 0.5f, 0.25f);
  CHECK(hit.position == glm::dvec3(101, 201, 300));
  CHECK(hit.geometric_normal == glm::vec3(0, 0, 1));
  CHECK(hit.normal == glm::vec3(0, 0, 1));
  CHECK(hit.albedo.x == Approx(0.05f));
  CHECK(hit.albedo.y == Approx(0.1f));
  CHECK(hit.emission == lamp.emission);
  CHECK_THROWS_AS(scene.surface(1, 0, 0), std::invalid_argument);

  // Colours of vertices multiply the albedo, but not the emission
  mesh.colours = {{1, 1, 1}, {0, 1, 1}, {0, 0, 1}};
  const SurfaceHit coloured = RayScene(mesh).surface(0, 0.5f, 0.25f);
  CHECK(coloured.albedo.x == Approx(0.05f * 0.25f));
  CHECK(coloured.albedo.y == Approx(0.1f * 0.75f));
  CHECK(coloured.emission == lamp.emission);
}

TEST_CASE("ray scene: the normal is interpolated and stays on the geometric side",
          "[scene][rays]") {
  Mesh mesh = empty_mesh();
  add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  mesh.normals = {{0, 0, 1}, {0.6f, 0, 0.8f}, {0, 0, -1}};
  const RayScene scene(mesh);
  CHECK(glm::distance(scene.surface(0, 1, 0).normal, glm::vec3(0.6f, 0, 0.8f)) < 1e-6f);
  CHECK(scene.surface(0, 0, 1).normal == glm::vec3(0, 0, 1));
  CHECK(scene.surface(0, 0, 0.5f).normal == glm::vec3(0, 0, 1));  // the two cancel out
  Random random(5);
  for (int i = 0; i < 500; ++i) {
    for (glm::vec3& n : mesh.normals) n = random.direction();
    const SurfaceHit hit = scene.surface(0, 0.3f, 0.3f);
    CHECK(glm::length(hit.normal) == Approx(1).epsilon(1e-6));
    CHECK(glm::dot(hit.normal, hit.geometric_normal) >= -1e-6f);
  }
  mesh.normals[0] = glm::vec3(std::numeric_limits<float>::quiet_NaN());
  CHECK(scene.surface(0, 0.3f, 0.3f).normal == glm::vec3(0, 0, 1));
}

TEST_CASE("ray scene: triangles of any size have a unit normal", "[scene][rays]") {
  for (const float size : {1e-18f, 1e-9f, 1.0f, 1e9f, 1e18f}) {
    Mesh mesh = empty_mesh();
    add_triangle(mesh, {0, 0, 0}, {0, size, 0}, {0, 0, size});
    CHECK(RayScene(mesh).surface(0, 0.2f, 0.2f).geometric_normal == glm::vec3(1, 0, 0));
  }
  Mesh degenerate = empty_mesh();
  add_triangle(degenerate, {1, 1, 1}, {1, 1, 1}, {2, 2, 2});
  const SurfaceHit hit = RayScene(degenerate).surface(0, 0.2f, 0.2f);
  CHECK(glm::length(hit.geometric_normal) == 1);
  CHECK(glm::length(hit.normal) == 1);
}

TEST_CASE("ray scene: an empty mesh is never hit", "[scene][rays]") {
  const Mesh nothing = empty_mesh();
  Mesh points = empty_mesh();
  points.positions = {{0, 0, 0}};
  for (const Mesh* const mesh : std::initializer_list<const Mesh*>{&nothing, &points}) {
    const RayScene scene(*mesh);
    CHECK(!scene.closest({0, 1, 0}, {0, -1, 0}, 0, kFar));
    CHECK(!scene.occluded({0, 1, 0}, {0, -1, 0}, 0, kFar));
  }
}

TEST_CASE("ray scene: an inconsistent mesh is refused", "[scene][rays]") {
  const Mesh sound = ground(1);
  const auto refuses = [&](auto&& spoil) {
    Mesh mesh = sound;
    spoil(mesh);
    CHECK_THROWS_AS(RayScene(mesh), RequestError);
  };
  CHECK_NOTHROW(RayScene(sound));
  refuses([](Mesh& m) { m.triangles[1][2] = 6; });
  refuses([](Mesh& m) { m.material_of.pop_back(); });
  refuses([](Mesh& m) { m.material_of[0] = 1; });
  refuses([](Mesh& m) { m.objects = {"a"}; });
  refuses([](Mesh& m) { m.object_runs = {{0, 0}}; });
  const auto has_objects = [](const std::vector<ObjectRun>& runs) {
    return [runs](Mesh& m) {
      m.objects = {"a", "b"};
      m.object_runs = runs;
    };
  };
  Mesh apart = sound;
  has_objects({{0, 1}, {1, 0}})(apart);
  CHECK_NOTHROW(RayScene(apart));
  refuses(has_objects({{1, 0}}));
  refuses(has_objects({{0, 2}}));
  refuses(has_objects({{0, 0}, {0, 1}}));
  refuses([](Mesh& m) { m.normals.resize(5); });
  refuses([](Mesh& m) { m.uvs.resize(7); });
  refuses([](Mesh& m) { m.positions[3].y = std::numeric_limits<float>::infinity(); });
  refuses([](Mesh& m) { m.positions[3].z = std::numeric_limits<float>::quiet_NaN(); });
}

TEST_CASE("ray scene: invalid rays miss", "[scene][rays]") {
  const Mesh mesh = ground(1);
  const RayScene scene(mesh);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(!scene.closest({nan, 1, 0}, {0, -1, 0}, 0, kFar));
  CHECK(!scene.occluded({0, 1, 0}, {0, 0, 0}, 0, kFar));
  CHECK(!scene.occluded({0, kFar, 0}, {0, -1, 0}, 0, kFar));
  CHECK(!scene.occluded({0, 1, 0}, {0, -1, 0}, 5, 1));
}

TEST_CASE("ray scene: numbers of a mesh that no light can use are refused", "[scene][rays]") {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  Random random(3);
  const Mesh whole = [&] {
    Mesh mesh = soup(random, 2);
    mesh.normals.assign(mesh.positions.size(), glm::vec3(0, 1, 0));
    return mesh;
  }();
  REQUIRE(!whole.materials.empty());
  CHECK_NOTHROW(check_mesh(whole));
  const auto refuses = [&](auto&& spoil) {
    Mesh mesh = whole;
    spoil(mesh);
    CHECK_THROWS_AS(check_mesh(mesh), RequestError);
  };
  refuses([](Mesh& m) { m.origin.x = kNaN; });
  refuses([](Mesh& m) { m.normals.back().y = kNaN; });
  refuses([](Mesh& m) { m.colours = {glm::vec3(1)}; });
  refuses([](Mesh& m) { m.colours.assign(m.positions.size(), glm::vec3(1.5f)); });
  refuses([](Mesh& m) { m.materials.front().albedo.g = -1; });
  refuses([](Mesh& m) { m.materials.front().albedo.g = kNaN; });
  refuses([](Mesh& m) { m.materials.front().emission.b = -1; });
  refuses([](Mesh& m) { m.materials.front().emission.b = std::numeric_limits<float>::infinity(); });
}
