#include "engine/pipeline/quality/surface_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "engine/base/error.h"
#include "engine/base/low_discrepancy.h"
#include "engine/base/memory.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/quality/disc_pairs.h"
#include "engine/pipeline/render/clearance.h"
#include "engine/pipeline/render/tile_renderer.h"
#include "engine/pipeline/scene_record.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/mesh_reference.h"
#include "engine/scene/sampling/patch_sampler.h"
#include "engine/scene/sampling/places_by_area.h"
#include "engine/shade/lift.h"
#include "engine/shade/reference/cosine_rays.h"

namespace ptc {
namespace {

// The seed of the rays at the mesh and of those at the surfels, far from the seeds of runs
constexpr std::uint64_t kSurfaceSeed = std::uint64_t{1} << 52;
constexpr std::uint64_t kPlaceSeed = 0x5eed;

/// Returns the memory for meshes and the rays at them.
MeshLimits limits_of(const RunOptions& run, const MemoryBudget& budget,
                     const std::filesystem::path& target) {
  return {.reading = budget.left(),
          .kept = budget.left(),
          .traced = budget.left(),
          .textures = texture_cap(run),
          .temp_directory = roomiest_temp_dir(run, target)};
}

/// Returns the receiver of a place, as a picture of the mesh has it.
Receiver receiver_of(const RayScene& rays, const SurfaceHit& at, const glm::vec3& towards,
                     float lift) {
  const float turn = at.front ? 1.0F : -1.0F;
  const glm::vec3 up = at.geometric_normal * turn;
  return receiver_at({.position = clear_of_walls(rays, at.position, up, towards, double{lift}),
                      .normal = at.normal * turn,
                      .lift = lift,
                      .offset_normal = up});
}

}  // namespace

MemoryBudget SurfaceJudge::budget(const ContainerReader& scene, const Sky& sky) const {
  MemoryBudget all = budget_of(request_.run.memory_bytes, "comparing surfels with their meshes");
  charge_directory(all, scene);
  charge_sky(all, sky);
  if (request_.mesh) charge_mesh(all, *request_.mesh, nullptr);
  return all;
}

std::vector<SurfaceJudge::Place> SurfaceJudge::places_on(const RayScene& rays,
                                                         const DirectLight& light) const {
  const Mesh& mesh = rays.mesh();
  std::vector<std::uint32_t> triangles(mesh.triangles.size());
  std::iota(triangles.begin(), triangles.end(), 0U);
  const PlacesByArea by_area(rays, triangles, kPlaceSeed);
  if (!(by_area.area() > 0)) return {};
  const PatchSampler sampler(rays, &light, request_.sampling.lights, false);
  std::vector<std::optional<Place>> found(kPlaces);
  executor_.for_each(kPlaces, [&](std::size_t i, unsigned) {
    SurfaceHit at = by_area.place(static_cast<std::uint32_t>(i), kPlaces);
    // Every second place of a material with two sides is on its back
    at.front = sides_of(mesh, at.triangle) == 1 || i % 2 == 0;
    for (unsigned side = 0; side < sides_of(mesh, at.triangle); ++side) {
      if (at.opacity > 0 && sampler.is_seen(at, at.front, 2 * i + side)) {
        found[i] = Place{at, at.geometric_normal * (at.front ? -1.0F : 1.0F)};
        return;
      }
      at.front = !at.front;
    }
  });
  std::vector<Place> places;
  for (const auto& place : found) {
    if (place) places.push_back(*place);
  }
  return places;
}

std::vector<SurfaceJudge::Place> SurfaceJudge::places_seen(const RayScene& rays,
                                                           const Camera& camera) const {
  const SquarePoints points(kPlaceSeed);
  std::vector<Place> places;
  for (std::uint32_t i = 0; i < kPlaces; ++i) {
    const glm::vec2 square = points.square(i);
    const glm::vec3 direction = camera.direction(square.x * static_cast<float>(camera.width),
                                                 square.y * static_cast<float>(camera.height));
    const auto hit =
        rays.closest(camera.position, direction, 0, std::numeric_limits<double>::infinity());
    if (hit) places.push_back({*hit, direction});
  }
  return places;
}

void SurfaceJudge::trace_truth(const RayScene& rays, const DirectLight& light, bool by_emitters) {
  // No light that the surfels leave out
  const LightSampling& asked = request_.sampling.lights;
  const LightPaths paths{.sampling = {.sun_rays = std::min(2U, asked.sun_rays),
                                      .area_rays = by_emitters ? 16U : 0U,
                                      .sky_rays = std::min(16U, asked.sky_rays)},
                         .emission = !by_emitters};
  truth_.resize(2 * places_.size());
  executor_.for_each(truth_.size(), [&](std::size_t i, unsigned) {
    const SurfaceHit& at = places_[i / 2].at;
    const glm::vec3 normal = at.front ? at.normal : -at.normal;
    std::vector<glm::vec3> directions;
    cosine_directions(normal, kRays, kSurfaceSeed + i, directions);
    const RayTraced found =
        trace_mesh(rays, light, at.position, normal, directions, paths, kSurfaceSeed + i);
    truth_[i] = {.occlusion = found.occlusion, .irradiance = found.irradiance, .sky = found.sky};
  });
}

BoundedError SurfaceJudge::measure(const ContainerReader& scene) {
  const bool by_emitters = lit_by_emitters(scene);
  Progress silent;
  const LightRig lights =
      request_.lights ? *request_.lights : recorded_lights(scene, request_.run, target_, silent);
  const MemoryBudget left = budget(scene, lights.sky);
  std::vector<Receiver> receivers;
  {
    // Choose the places at the first call, and find how a picture would look at them
    LoadedMeshes meshes = load_meshes(request_.inputs, request_.mesh.get(),
                                      {request_.backdrop, request_.one_sided, request_.moment},
                                      limits_of(request_.run, left, target_), silent);
    require_request(!meshes.parts, "error",
                    "surfels can be compared with their meshes only where these fit in memory");
    const RayScene rays(meshes.mesh);
    if (truth_.empty()) {
      const DirectLight light(rays, lights);
      places_ = request_.sampling.camera ? places_seen(rays, *request_.sampling.camera)
                                         : places_on(rays, light);
      require_request(places_.size() >= kFewestPlaces, "error",
                      request_.sampling.camera
                          ? "the camera sees too little of the meshes to compare surfels with them"
                          : "too few places of the meshes are lit to compare surfels with them");
      trace_truth(rays, light, by_emitters);
    }
    const float lift =
        lift_height(surfel_radius(scene), LightingRequest{}.lift, scene.header().frame);
    for (const Place& place : places_)
      receivers.push_back(receiver_of(rays, place.at, place.towards, lift));
  }
  return_freed_memory();

  // Trace the same rays at the surfels
  return error_of_pairs(trace_pairs(scene, lights.sky, receivers,
                                    {.rays = kRays, .seed = kSurfaceSeed}, left, executor_),
                        truth_);
}

}  // namespace ptc
