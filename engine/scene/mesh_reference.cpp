// Monte Carlo over the hemisphere of a receiver.
//
// Cosine rays have the density cos / pi, so the irradiance, the integral of L cos over the
// hemisphere, is pi times the mean radiance that the rays see, and the occlusion is the share of
// rays that hit. Each hit needs the irradiance at its own place: shadow rays give the direct part,
// and one more cosine ray, followed recursively, gives the part that comes over further bounces.
#include "engine/scene/mesh_reference.h"

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/sampling/directions.h"
#include "engine/scene/step_off.h"

namespace ptc {
namespace {

bool is_double_sided(const Mesh& mesh, std::uint32_t triangle) {
  return mesh.materials[mesh.material_of[triangle]].double_sided;
}

// Traces one cosine ray from a hit and returns the surface that it meets.
std::optional<SurfaceHit> follow(const RayScene& scene, const SurfaceHit& hit,
                                 const glm::vec3& normal, std::uint64_t seed) {
  const std::optional<glm::dvec3> origin = step_off(scene, hit.position, normal);
  if (!origin) return std::nullopt;
  const glm::vec3 direction =
      Basis(normal).to_world(cosine_direction(SquarePoints(seed).square(0)));
  return scene.closest(*origin, direction, 0, std::numeric_limits<double>::infinity());
}

// Returns the radiance that leaves a hit towards the ray's origin.
// @param emits  whether the emission of the hit's own surface counts
glm::vec3 radiance_of(const RayScene& scene, const DirectLight& light, const SurfaceHit& hit,
                      const LightPaths& paths, bool emits, std::uint64_t seed) {
  if (!hit.front && !is_double_sided(scene.mesh(), hit.triangle)) return glm::vec3(0);
  // Reflect the direct light, and add the emission.
  const glm::vec3 normal = hit.front ? hit.normal : -hit.normal;
  const DirectLight::Result direct = light.irradiance(hit.position, normal, paths.sampling, seed);
  glm::vec3 radiance = hit.albedo / kPi * (direct.local + direct.sky);
  if (hit.front && emits) radiance += hit.emission;
  // Reflect the light of further bounces along one ray. The factor of a cosine ray is the albedo:
  // albedo / pi times cos over the density cos / pi.
  if (paths.bounces <= 1) return radiance;
  const std::uint64_t next_seed = splitmix64(seed);
  if (const auto next = follow(scene, hit, normal, next_seed)) {
    const LightPaths rest{paths.sampling, paths.bounces - 1};
    radiance += hit.albedo *
                radiance_of(scene, light, *next, rest, paths.sampling.area_rays == 0, next_seed);
  }
  return radiance;
}

}  // namespace

RayTraced trace_mesh(const RayScene& scene, const DirectLight& light, const glm::dvec3& position,
                     const glm::vec3& normal, unsigned rays, const LightPaths& paths,
                     std::uint64_t seed) {
  const glm::vec3 unit = glm::normalize(normal);
  if (!std::isfinite(unit.x + unit.y + unit.z)) return {};
  const Basis frame(unit);
  const SquarePoints points(seed);
  std::vector<glm::vec3> directions(rays);
  for (std::uint32_t i = 0; i < rays; ++i)
    directions[i] = frame.to_world(cosine_direction(points.square(i)));
  return trace_mesh(scene, light, position, normal, directions, paths, seed);
}

RayTraced trace_mesh(const RayScene& scene, const DirectLight& light, const glm::dvec3& position,
                     const glm::vec3& normal, std::span<const glm::vec3> directions,
                     const LightPaths& paths, std::uint64_t seed) {
  // Find where the rays begin.
  RayTraced result;
  const glm::vec3 unit = glm::normalize(normal);
  if (directions.empty() || !std::isfinite(unit.x + unit.y + unit.z)) return result;
  const std::optional<glm::dvec3> origin = step_off(scene, position, unit);
  if (!origin) {
    result.occlusion = 1;
    return result;
  }
  // Trace the rays and sum what they see.
  unsigned hits = 0;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const auto hit =
        scene.closest(*origin, directions[i], 0, std::numeric_limits<double>::infinity());
    if (hit) {
      ++hits;
      if (paths.bounces > 0)
        result.irradiance +=
            radiance_of(scene, light, *hit, paths, paths.emission, splitmix64(seed) + i);
    } else {
      result.sky += light.rig().sky.at(directions[i]);
    }
  }
  // Turn the sums into means over the hemisphere.
  const auto count = static_cast<float>(directions.size());
  result.occlusion = static_cast<float>(hits) / count;
  result.irradiance *= kPi / count;
  result.sky *= kPi / count;
  return result;
}

}  // namespace ptc
