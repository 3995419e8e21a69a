// Scenes made in code: their size and their openings.
#include "tools/bench/scenes/procedural.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/ray_scene.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

void check_sound(const Mesh& mesh) {
  REQUIRE_NOTHROW(check_mesh(mesh));
  REQUIRE(mesh.material_of.size() == mesh.triangles.size());
  std::vector<bool> used(mesh.positions.size());
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) used[corner] = true;
    const glm::vec3 a = mesh.positions[triangle[0]];
    const glm::vec3 normal =
        glm::cross(mesh.positions[triangle[1]] - a, mesh.positions[triangle[2]] - a);
    REQUIRE(glm::length(normal) > 0);
  }
  for (const glm::vec3& p : mesh.positions)
    REQUIRE((std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)));
  CHECK(std::ranges::find(used, false) == used.end());
  for (const std::uint16_t material : mesh.material_of) REQUIRE(material < mesh.materials.size());
}

/// Returns the place (y, z) where a ray crosses the plane of an x.
glm::vec2 at_plane(const glm::vec3& from, const glm::vec3& along, float x) {
  const glm::vec3 p = from + along * ((x - from.x) / along.x);
  return {p.y, p.z};
}

/// Returns how far a place is inside the window's frame, metres; below 0 outside.
float inside_window(const glm::vec2& p) {
  return std::min({p.x - 0.9F, 2.3F - p.x, p.y - 1.2F, 2.8F - p.y});
}

constexpr double kFar = std::numeric_limits<double>::infinity();

}  // namespace

TEST_CASE("fractal: it has the requested number of triangles, none degenerate, each vertex used",
          "[bench][procedural]") {
  for (const std::uint64_t wanted : {1'000U, 5'000U, 10'000U, 20'000U, 77'777U, 300'000U}) {
    const LitScene scene = make_fractal(wanted);
    CAPTURE(wanted);
    CHECK(static_cast<double>(scene.mesh.triangles.size()) ==
          Approx(static_cast<double>(wanted)).epsilon(0.1));
    check_sound(scene.mesh);
  }
}

TEST_CASE("fractal: it is the same every time", "[bench][procedural]") {
  const LitScene a = make_fractal(20'000), b = make_fractal(20'000);
  CHECK(a.mesh.positions == b.mesh.positions);
  CHECK(a.mesh.triangles == b.mesh.triangles);
  CHECK(a.mesh.material_of == b.mesh.material_of);
}

TEST_CASE("fractal: the camera is above the ground and sees it", "[bench][procedural]") {
  const LitScene scene = make_fractal(20'000);
  const RayScene rays(scene.mesh);
  const glm::dvec3 from = scene.camera.position;
  CHECK(rays.occluded(from, {0, -1, 0}, 0, kFar));
  CHECK(!rays.occluded(from, {0, 1, 0}, 0, kFar));
  CHECK(rays.occluded(from, glm::vec3(glm::normalize(scene.camera.look_at - from)), 0, kFar));
}

TEST_CASE("window room: its mesh is valid, and the sun shines in", "[bench][procedural]") {
  const LitScene scene = make_window_room();
  check_sound(scene.mesh);
  REQUIRE(scene.lights.suns.size() == 1);
  const glm::vec3 to_sun = scene.lights.suns.front().to_sun;
  CHECK(!RayScene(scene.mesh).occluded({5.5, 1.2, 1.9}, to_sun, 0, kFar));
}

TEST_CASE("window room: light leaves it through the window alone", "[bench][procedural]") {
  const LitScene scene = make_window_room();
  const RayScene rays(scene.mesh);
  constexpr std::uint32_t kRays = 1 << 14;
  for (const glm::vec3& from :
       {glm::vec3(3, 1.5F, 2), glm::vec3(5, 1.2F, 0.5F), glm::vec3(4.5F, 2.5F, 3.5F)}) {
    const SquarePoints points(7);
    unsigned escaped = 0, through_window = 0;
    for (std::uint32_t i = 0; i < kRays; ++i) {
      const glm::vec2 p = points.square(i);
      const float y = 2 * p.x - 1, ring = std::sqrt(1 - y * y),
                  turn = 2 * std::numbers::pi_v<float> * p.y;
      const glm::vec3 along(ring * std::cos(turn), y, ring * std::sin(turn));
      const float margin = along.x > 0 ? std::min(inside_window(at_plane(from, along, 6)),
                                                  inside_window(at_plane(from, along, 6.25F)))
                                       : -1.0F;
      if (std::abs(margin) < 1e-4F) continue;  // the frame's edge
      const bool open = !rays.occluded(glm::dvec3(from), along, 0, kFar);
      if (margin < 0) REQUIRE(!open);
      // A ray downwards meets the ground outside; nothing inside is between these places and the
      // window.
      if (margin > 0 && along.y > 0) REQUIRE(open);
      escaped += open ? 1 : 0;
      through_window += margin > 0 ? 1 : 0;
    }
    CHECK(through_window > kRays / 200);
    CHECK(escaped > through_window / 4);
    CHECK(escaped <= through_window);
  }
}

TEST_CASE("rooms with a door ajar: light reaches the camera's room through the gap alone",
          "[bench][procedural]") {
  const LitScene scene = make_ajar_rooms();
  check_sound(scene.mesh);
  const RayScene rays(scene.mesh);
  // Nothing leaves the rooms, and what sees a lamp from the dark room sees it through the doorway
  const SquarePoints points(9);
  unsigned through = 0;
  for (std::uint32_t i = 0; i < 20'000; ++i) {
    const glm::vec2 p = points.square(i);
    const float y = 2 * p.x - 1, ring = std::sqrt(1 - y * y),
                turn = 2 * std::numbers::pi_v<float> * p.y;
    const glm::vec3 along(ring * std::cos(turn), y, ring * std::sin(turn)), from(2.5F, 1.3F, 1.2F);
    const auto hit = rays.closest(glm::dvec3(from), along, 0, kFar);
    REQUIRE(hit);
    REQUIRE(hit->front);
    if (hit->position.x < 4.21) continue;
    ++through;
    const glm::vec2 at = at_plane(from, along, 4.1F);
    REQUIRE((at.x > 0 && at.x < 2.1F && at.y > 1.4F && at.y < 2.3F));
  }
  CHECK(through > 100);
  CHECK(scene.mesh.emits());
}

TEST_CASE("Cornell box: both lamps shine into a valid room, which has two sides with a box",
          "[bench][procedural]") {
  for (const CornellLamp lamp : {CornellLamp::flat, CornellLamp::box}) {
    const Mesh mesh = make_cornell(lamp).mesh;
    check_sound(mesh);
    CHECK(std::ranges::count(mesh.material_of, 3) == (lamp == CornellLamp::flat ? 2 : 12));
    CHECK(mesh.emits());
    for (const Material& material : mesh.materials)
      CHECK(material.double_sided == (lamp == CornellLamp::box));
    // From the middle, rays meet fronts alone, and the lamp above
    const RayScene scene(mesh);
    const SquarePoints points(5);
    for (std::uint32_t i = 0; i < 200; ++i) {
      const glm::vec2 at = points.square(i);
      const glm::vec3 along = glm::normalize(glm::vec3(2 * at.x - 1, 2 * at.y - 1, -0.5F));
      const auto hit = scene.closest({1, 1.5, 1}, along, 0, kFar);
      REQUIRE(hit);
      REQUIRE(hit->front);
    }
    const auto above = scene.closest({1, 1.5, 1}, {0, 1, 0}, 0, kFar);
    REQUIRE(above);
    CHECK(above->emission.x > 0);
  }
}

TEST_CASE("layers: half of a sheet's tiles are missing, the rest face up or down",
          "[bench][scene]") {
  for (const unsigned layers : {0U, 1U, 16U}) {
    const Mesh mesh = make_layers(layers).mesh;
    const double tiles = static_cast<double>(mesh.triangles.size()) / 2 - 1;
    CHECK(tiles == Approx(512.0 * layers).margin(30 * std::sqrt(layers)));
    std::size_t up = 0;
    for (const auto& t : mesh.triangles) {
      const glm::vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]],
                      &c = mesh.positions[t[2]];
      const glm::vec3 normal = glm::normalize(glm::cross(b - a, c - a));
      REQUIRE(std::abs(normal.y) == 1);
      up += normal.y > 0;
    }
    if (layers > 0) CHECK(static_cast<double>(up) == Approx(tiles).epsilon(0.15));
  }
}
