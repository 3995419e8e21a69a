// Eight rays along the surface look for walls. They begin where the receiver will lie, and a little
// towards the camera, so that rounding puts no place behind a wall that it touches. A wall that is
// nearer than their length times the cosine of half the angle between them meets at least one of
// them, whichever way it runs; so long are they that this holds for all that is too near.
#include "engine/pipeline/render/clearance.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/base/numbers.h"

namespace ptc {
namespace {

constexpr unsigned kWays = 8;      // rays along the surface
constexpr double kKept = 2.3;      // distance from walls that is kept, lifts
constexpr double kBack = 0.5;      // lifts by which they begin towards the camera
constexpr double kSteep = 0.2;     // least sine of the angle between a wall and the surface
constexpr unsigned kMaxWalls = 2;  // walls that a place is moved away from, one after another

/// Returns directions around a normal, square to it.
std::array<glm::vec3, kWays> ways_along(const glm::vec3& normal) {
  const Basis basis(normal);
  std::array<glm::vec3, kWays> ways{};
  for (unsigned i = 0; i < kWays; ++i) {
    const float turn = 2 * kPi * (static_cast<float>(i) + 0.5F) / kWays;
    ways[i] = basis.to_world({std::cos(turn), std::sin(turn), 0});
  }
  return ways;
}

}  // namespace

glm::dvec3 clear_of_walls(const RayScene& scene, const glm::dvec3& place, const glm::vec3& normal,
                          const glm::vec3& towards, double lift) {
  const double kept = kKept * lift;
  const double reach = (kKept + kBack) * lift / std::cos(std::numbers::pi / kWays);
  const std::array<glm::vec3, kWays> ways = ways_along(normal);
  const glm::dvec3 up(normal), back = -glm::dvec3(towards) * (kBack * lift);
  glm::dvec3 at = place;
  for (unsigned walls = 0; walls < kMaxWalls; ++walls) {
    // Find the nearest wall
    double nearest = kept, length = 0;
    glm::dvec3 step(0);
    const glm::dvec3 eye = at + up * lift + back;
    for (unsigned met = scene.occluded(eye, ways, 0, reach); met != 0; met &= met - 1) {
      const glm::vec3& way = ways[static_cast<unsigned>(std::countr_zero(met))];
      const auto hit = scene.closest_triangle(eye, way, 0, reach);
      if (!hit) continue;
      // Measure the distance of the place itself from the wall's plane
      const glm::dvec3 front =
          glm::dvec3(scene.surface(hit->triangle, hit->u, hit->v).geometric_normal) *
          (hit->front ? 1.0 : -1.0);
      const double distance =
          -hit->distance * glm::dot(front, glm::dvec3(way)) - glm::dot(front, back);
      const glm::dvec3 along = front - up * glm::dot(front, up);
      const double steep = glm::length(along);
      if (distance >= nearest || steep < kSteep) continue;
      nearest = distance;
      step = along / steep;
      length = std::min(kept, (kept - distance) / steep);
    }
    if (length == 0) break;
    // Step away from it, up to the middle where another one stands behind
    const auto behind = scene.closest_triangle(eye, glm::vec3(step), 0, length + kept);
    const double half = behind ? 0.5 * (behind->distance - nearest) : length;
    at += step * std::clamp(half, 0.0, length);
    if (half < length) break;
  }
  return at;
}

}  // namespace ptc
