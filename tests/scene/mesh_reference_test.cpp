// The ray-traced reference, compared with form factors and a furnace.
#include "engine/scene/mesh_reference.h"

#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/scene/sampling/directions.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

const glm::vec3 kUp(0, 1, 0);

// Returns the form factor from a patch to a rectangle by its definition, the integral of
// cos cos' / (pi d^2).
double factor(const glm::dvec3& at, const glm::dvec3& normal, const glm::dvec3& corner,
              const glm::dvec3& u, const glm::dvec3& v) {
  const glm::dvec3 front = glm::cross(u, v);  // as long as the area is large
  const int n = 600;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const glm::dvec3 d = corner + u * ((i + 0.5) / n) + v * ((j + 0.5) / n) - at;
      const double square = glm::dot(d, d);
      const double cosines = glm::dot(normal, d) * -glm::dot(front, d);
      if (glm::dot(normal, d) > 0 && cosines > 0) sum += cosines / (square * square);
    }
  }
  return sum / (kPiDouble * n * n);
}

Mesh emitting_quad(const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v) {
  Mesh mesh = empty_mesh();
  mesh.materials[0].emission = {1, 2, 4};
  mesh.materials[0].albedo = glm::vec3(0);
  add_quad(mesh, corner, u, v);
  return mesh;
}

void check_factor(const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
                  const glm::dvec3& at) {
  const Mesh mesh = emitting_quad(corner, u, v);
  const RayScene scene(mesh);
  LightRig rig;
  rig.sky.radiance = {3, 3, 6};
  const DirectLight light(scene, rig);
  const double expected =
      factor(at, glm::dvec3(kUp), glm::dvec3(corner), glm::dvec3(u), glm::dvec3(v));
  const unsigned rays = 16384;
  const RayTraced result = trace_mesh(scene, light, at, kUp, rays, {{0, 0, 0}}, 1);
  // This is the deviation of random rays; stratified ones do better.
  const double noise = 3 * std::sqrt(expected * (1 - expected) / rays);
  CHECK(static_cast<double>(result.occlusion) == Approx(expected).margin(noise));
  CHECK(static_cast<double>(result.irradiance.x) ==
        Approx(kPiDouble * expected).margin(kPiDouble * noise));
  CHECK(result.irradiance.z == Approx(4 * result.irradiance.x));
  CHECK(static_cast<double>(result.sky.x) ==
        Approx(3 * kPiDouble * (1 - expected)).margin(10 * noise));
}

/// A closed box that emits 1 and reflects half.
Mesh furnace() {
  Mesh mesh = empty_mesh();
  mesh.materials[0].emission = glm::vec3(1);
  mesh.materials[0].albedo = glm::vec3(0.5f);
  add_box(mesh, glm::vec3(-1), glm::vec3(1), true);
  return mesh;
}

}  // namespace

TEST_CASE("trace_mesh: a parallel square gives its form factor", "[scene][reference]") {
  for (const float height : {0.2f, 1.0f, 5.0f}) {
    check_factor({-1, height, -1}, {2, 0, 0}, {0, 0, 2}, {0, 0, 0});
    check_factor({-1, height, -1}, {2, 0, 0}, {0, 0, 2}, {0.9, 0, -0.4});
  }
}

TEST_CASE("trace_mesh: a square at a right angle gives its form factor", "[scene][reference]") {
  for (const double away : {0.05, 0.5, 2.0}) {
    check_factor({0, 0, 1}, {0, 0, -2}, {0, 2, 0}, {away, 0, 0.3});
  }
}

TEST_CASE("trace_mesh: parallel unit squares at unit distance exchange 0.1998",
          "[scene][reference]") {
  // Howell C-11 gives 0.19982, the mean over receivers on the lower square.
  const Mesh mesh = emitting_quad({0, 1, 0}, {1, 0, 0}, {0, 0, 1});
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  double mean = 0;
  const int n = 24;
  for (int i = 0; i < n * n; ++i) {
    const glm::dvec3 at((i % n + 0.5) / n, 0, (i / n + 0.5) / n);
    mean +=
        static_cast<double>(
            trace_mesh(scene, light, at, kUp, 256, {}, static_cast<std::uint64_t>(i)).occlusion) /
        (n * n);
  }
  CHECK(mean == Approx(0.19982).epsilon(0.01));
}

TEST_CASE("trace_mesh: unit squares that share an edge at a right angle exchange 0.2",
          "[scene][reference]") {
  // Howell C-14: 0.20004.
  const Mesh mesh = emitting_quad({0, 0, 1}, {0, 0, -1}, {0, 1, 0});
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  double mean = 0;
  const int n = 32;
  for (int i = 0; i < n * n; ++i) {
    const glm::dvec3 at((i % n + 0.5) / n, 0, (i / n + 0.5) / n);
    mean +=
        static_cast<double>(
            trace_mesh(scene, light, at, kUp, 256, {}, static_cast<std::uint64_t>(i)).occlusion) /
        (n * n);
  }
  CHECK(mean == Approx(0.20004).epsilon(0.01));
}

TEST_CASE("trace_mesh: in a furnace the irradiance is pi times emission plus one reflection",
          "[scene][reference]") {
  const Mesh mesh = furnace();
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  const RayTraced result = trace_mesh(scene, light, {0.2, -1, 0.3}, kUp, 1024, {{1, 16, 1}}, 1);
  CHECK(result.occlusion == 1);
  CHECK(result.irradiance.x == Approx(1.5 * kPiDouble).epsilon(0.01));
  CHECK(result.sky == glm::vec3(0));
}

TEST_CASE(
    "trace_mesh: in a furnace bounce k adds the k-th power of albedo, however emission arrives",
    "[scene][reference]") {
  const Mesh mesh = furnace();
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  // Shadow rays at the last hit bring emission over one more reflection than rays alone.
  for (const unsigned area_rays : {0u, 16u}) {
    for (unsigned n = 1; n <= 4; ++n) {
      const double expected = 2 - std::pow(0.5, area_rays > 0 ? n : n - 1.0);
      const RayTraced result =
          trace_mesh(scene, light, {0.2, -1, 0.3}, kUp, 4096, {{1, area_rays, 1}, n}, 1);
      INFO(area_rays << " area rays, " << n << " bounces");
      CHECK(result.irradiance.x == Approx(expected * kPiDouble).epsilon(0.01));
    }
  }
}

TEST_CASE("trace_mesh: a lit surface reflects albedo over pi times its direct light",
          "[scene][reference]") {
  // A ceiling over the receiver, lit from below by the sun and the sky.
  Mesh mesh = empty_mesh();
  mesh.materials[0].albedo = {0.5f, 0.25f, 1};
  add_quad(mesh, {-500, 1, -500}, {1000, 0, 0}, {0, 0, 1000});
  const RayScene scene(mesh);
  LightRig rig;
  rig.suns.push_back({{0, -1, 0}, {2, 2, 2}, 0});
  rig.sky.radiance = glm::vec3(1);
  const DirectLight light(scene, rig);
  const RayTraced result = trace_mesh(scene, light, {0, 0, 0}, kUp, 1024, {}, 1);
  CHECK(result.occlusion == Approx(1).epsilon(1e-3));
  CHECK(result.irradiance.x == Approx(0.5 * (2 + kPiDouble)).epsilon(0.01));
  CHECK(result.irradiance.y == Approx(0.25 * (2 + kPiDouble)).epsilon(0.01));
}

TEST_CASE("trace_mesh: a back side hides and is black, unless it is double-sided",
          "[scene][reference]") {
  Mesh mesh = empty_mesh();
  mesh.materials[0].emission = glm::vec3(5);
  mesh.materials[0].albedo = glm::vec3(1);
  add_quad(mesh, {-500, 1, -500}, {0, 0, 1000}, {1000, 0, 0});  // faces up
  LightRig rig;
  rig.suns.push_back({{0, -1, 0}, {2, 2, 2}, 0});  // from below
  {
    const RayScene scene(mesh);
    const DirectLight light(scene, rig);
    const RayTraced result = trace_mesh(scene, light, {0, 0, 0}, kUp, 256, {}, 1);
    CHECK(result.occlusion == Approx(1).epsilon(0.01));
    CHECK(result.irradiance == glm::vec3(0));
  }
  mesh.materials[0].double_sided = true;
  const RayScene scene(mesh);
  const DirectLight light(scene, rig);
  CHECK(trace_mesh(scene, light, {0, 0, 0}, kUp, 256, {}, 1).irradiance.x ==
        Approx(2).epsilon(0.02));
}

TEST_CASE("trace_mesh: the result is the same ten million metres away", "[scene][reference]") {
  Mesh mesh = emitting_quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2});
  add_box(mesh, {0.25f, 0.25f, 0.25f}, {0.5f, 0.5f, 0.5f}, false);
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  const RayTraced here = trace_mesh(scene, light, {0, 0, 0}, kUp, 2048, {}, 3);
  mesh.origin = {1e7, 3e7, -2e7};
  const RayScene moved(mesh);
  const DirectLight moved_light(moved, {});
  const RayTraced there = trace_mesh(moved, moved_light, mesh.origin, kUp, 2048, {}, 3);
  CHECK(there.occlusion == here.occlusion);
  CHECK(there.irradiance.x == Approx(here.irradiance.x).epsilon(1e-4));
}

TEST_CASE("trace_mesh: without rays or without a normal the result is zero", "[scene][reference]") {
  const Mesh mesh = emitting_quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2});
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  CHECK(trace_mesh(scene, light, {0, 0, 0}, kUp, 0, {}, 1).occlusion == 0);
  CHECK(trace_mesh(scene, light, {0, 0, 0}, glm::vec3(0), 16, {}, 1).occlusion == 0);
}
