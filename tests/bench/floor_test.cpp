// How far the discs of a mesh are from the mesh: the error that no gather can fall below.
#include <cmath>
#include <memory>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/scene/mesh_reference.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/shade/reference/brute_force.h"
#include "tools/bench/scenes/procedural.h"

using namespace ptc;

namespace {

/// The RMS difference between rays at discs and rays at the mesh, over the mean.
struct Floor {
  double occlusion = 0, irradiance = 0;
};

/// Returns the places of a mesh that camera rays hit; they serve as receivers.
std::vector<SurfaceHit> seen(const RayScene& rays, Camera camera, unsigned side) {
  camera.width = camera.height = side;
  std::vector<SurfaceHit> hits;
  for (unsigned i = 0; i < side * side; ++i) {
    const glm::vec3 along =
        camera.direction(static_cast<float>(i % side) + 0.5F, static_cast<float>(i / side) + 0.5F);
    if (const auto hit = rays.closest(camera.position, along, 0, 1e9)) hits.push_back(*hit);
  }
  return hits;
}

Floor measure(const bench::LitScene& scene, std::uint64_t count, unsigned side) {
  const RayScene rays(scene.mesh);
  const DirectLight light(rays, scene.lights);
  const ThreadPool executor;
  SamplingOptions options;
  options.count = count;
  std::vector<Surfel> surfels(count + count / 10);
  surfels.resize(sample_mesh(light, rays, options, executor)->next(surfels));
  const DiscRays discs(surfels, Sides::both, {});
  const std::vector<SurfaceHit> hits = seen(rays, scene.camera, side);
  const double lift = 0.15 * std::sqrt(0.5) * spacing_for(scene.mesh, count);
  std::vector<Shading> ours(hits.size());
  std::vector<RayTraced> truth(hits.size());
  executor.for_each(hits.size(), [&](std::size_t i, unsigned) {
    const SurfaceHit& h = hits[i];
    ours[i] = discs.trace({h.position + lift * glm::dvec3(h.geometric_normal), h.normal}, 4096, i);
    truth[i] = trace_mesh(rays, light, h.position, h.normal, 4096, {.sampling = {1, 1, 2}}, i);
  });
  Floor floor;
  double occlusion = 0, irradiance = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    floor.occlusion += std::pow(static_cast<double>(ours[i].occlusion - truth[i].occlusion), 2);
    floor.irradiance +=
        std::pow(static_cast<double>(ours[i].irradiance.g - truth[i].irradiance.g), 2);
    occlusion += static_cast<double>(truth[i].occlusion);
    irradiance += static_cast<double>(truth[i].irradiance.g);
  }
  const auto n = static_cast<double>(hits.size());
  return {std::sqrt(floor.occlusion * n) / occlusion, std::sqrt(floor.irradiance * n) / irradiance};
}

/// Planks, 3 surfels wide, on posts above a ground: a scene that is all edges.
bench::LitScene planks() {
  bench::LitScene scene;
  Mesh& mesh = scene.mesh;
  mesh.materials.emplace_back();
  const auto quad = [&mesh](const glm::vec3& a, const glm::vec3& u, const glm::vec3& v) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {a, a + u, a + u + v, a + v});
    mesh.triangles.insert(mesh.triangles.end(),
                          {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
    mesh.material_of.insert(mesh.material_of.end(), {0, 0});
  };
  quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4});
  for (int i = 0; i < 16; ++i) {
    const float x = -1.6F + 0.2F * static_cast<float>(i);
    quad({x, 0.4F, 1.5F}, {0.1F, 0, 0}, {0, 0, -3});
    quad({x, 0.4F, 1.5F}, {0, 0, -3}, {0.1F, 0, 0});
  }
  scene.lights.sky.radiance = glm::vec3(1);
  scene.camera = {.position = {0, 0.3, 0}, .look_at = {0.2, 0, 0.1}, .vertical_fov = 1.4F};
  return scene;
}

}  // namespace

TEST_CASE("floor: planks made of discs let through as much as the planks themselves",
          "[bench][floor]") {
  const Floor floor = measure(planks(), 24000, 12);  // the light meets no plank's underside
  INFO(floor.occlusion);
  CHECK(floor.occlusion < 0.03);  // 0.148 with discs about the middles of their patches
}

TEST_CASE("floor: a terrain finer than its surfels has the occlusion and light of its mesh",
          "[bench][floor]") {
  const Floor floor = measure(bench::make_fractal(80000), 20000, 16);
  INFO(floor.occlusion << " " << floor.irradiance);
  CHECK(floor.occlusion <
        0.075);  // 0.097 and 0.169 when each disc takes a place and a normal of the mesh
  CHECK(floor.irradiance < 0.13);
}

TEST_CASE("floor: the window of a room made of discs is as wide as that of its mesh",
          "[bench][floor]") {
  const Floor floor = measure(bench::make_window_room(), 30000, 12);
  INFO(floor.occlusion);
  CHECK(floor.occlusion < 0.0012);
}
