// Short rays around a surfel that find where the surface ends.
//
// Along each of 16 directions, rays down through the plane of the disc say whether the surface goes
// on at a distance, and halving finds where it ends. With e the distance of the end in a direction,
// the disc moves against the moment
//
//     m = 1/r * integral over directions of direction * (r^2 - e^2) / 2
//
// which is the integral of the unit direction over the area that sticks out, divided by r; it is 0
// where nothing sticks out.
//
//          |  |  | down
//     -----+--v--v.........       position, normal up, the disc's radius r to the right;
//     position    ^                the surface ends at the distance e
//                 e
//
// spec/shading.md#from-a-mesh has the figures.
#include "engine/scene/sampling/surroundings.h"

#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/sampling/directions.h"

namespace ptc {
namespace {

constexpr int kDirections = 16;
constexpr int kHalvings = 4;
// The surface is looked for up to this height over and under the disc's plane: kOwnHeight radii at
// the centre, and kSteepness of the distance more.
constexpr float kOwnHeight = 0.2F;
constexpr float kSteepness = 0.7F;
constexpr float kClearance = 0.1F;  // radii over the plane at which the way to an edge is checked

// How far a disc moves for its moment m, in radii. A disc whose centre is d radii from a straight
// edge has, to first order,
//   m = sin a - d^2 log((1 + sin a) / cos a),  cos a = d.
// It sticks out as much as it leaves uncovered between itself and the discs next to it at
// d = 0.909, the mean half chord over the square that it circumscribes. The way there, 0.909 - d,
// is 0.76 m within 0.04 for all d from 0.2 on.
constexpr float kMovePerMoment = 0.76F;

constexpr unsigned kBuriedRays = 8;

// Reports whether there is surface over or under the place at `distance` from the centre.
bool goes_on(const RayScene& scene, const glm::dvec3& position, const glm::vec3& normal,
             const glm::vec3& direction, float distance, float radius) {
  const float height = kSteepness * distance + kOwnHeight * radius;
  const glm::dvec3 above =
      position + glm::dvec3(direction * distance) + glm::dvec3(normal * height);
  return scene.occluded(above, -normal, 0, 2 * static_cast<double>(height));
}

// Returns the distance at which the surface ends in a direction, or the radius where it goes on, or
// where another surface stands in the way.
float reach(const RayScene& scene, const glm::dvec3& position, const glm::vec3& normal,
            const glm::vec3& direction, float radius) {
  if (goes_on(scene, position, normal, direction, radius, radius)) return radius;
  const glm::dvec3 over = position + glm::dvec3(normal * (kClearance * radius));
  if (scene.occluded(over, direction, 0, static_cast<double>(radius))) return radius;
  float low = 0, high = radius;
  for (int i = 0; i < kHalvings; ++i) {
    const float middle = 0.5F * (low + high);
    (goes_on(scene, position, normal, direction, middle, radius) ? low : high) = middle;
  }
  return 0.5F * (low + high);
}

}  // namespace

glm::vec3 move_inwards(const RayScene& scene, const glm::dvec3& position, const glm::vec3& normal,
                       float radius) {
  const Basis frame(normal);
  glm::vec3 moment(0);
  for (int i = 0; i < kDirections; ++i) {
    const float turn = 2 * kPi * static_cast<float>(i) / kDirections;
    const glm::vec3 direction = frame.x * std::cos(turn) + frame.y * std::sin(turn);
    const float distance = reach(scene, position, normal, direction, radius);
    moment += direction * ((radius - distance) * (radius + distance) / radius);
  }
  return moment * (-kMovePerMoment * kPi / kDirections);
}

bool is_buried(const RayScene& scene, const glm::dvec3& origin, const glm::vec3& normal,
               std::uint64_t seed) {
  const Mesh& mesh = scene.mesh();
  const Basis frame(normal);
  const SquarePoints points(seed);
  bool front = false;
  for (std::uint32_t i = 0; i < kBuriedRays; ++i) {
    const auto hit =
        scene.closest_triangle(origin, frame.to_world(cosine_direction(points.square(i))), 0,
                               std::numeric_limits<double>::infinity());
    if (!hit) return false;
    if (!hit->front && !mesh.materials[mesh.material_of[hit->triangle]].double_sided) continue;
    if (front) return false;
    front = true;
  }
  return true;
}

}  // namespace ptc
