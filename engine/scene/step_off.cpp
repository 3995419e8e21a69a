// How a point p is moved to a clear origin o, with e the epsilon of the scene.
//
// A point where two walls meet may lie, once rounded, on the far side of the wall that it touches;
// rays from there would let light in. So the point first moves inwards in its own triangle, which
// ends at the wall, and then rises:
//
//        wall |
//             |   8 e    o
//             |<-------->| 2 e
//   ----------p----------+--------- own triangle
//
// A ray from o down to the own triangle then looks for a lid: a surface that shows its back
// between o and the triangle lies over the point, and no light reaches the point at all.
#include "engine/scene/step_off.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>

#include "engine/scene/sampling/directions.h"

namespace ptc {
namespace {

constexpr double kLift = 2;         // epsilons that the origin rises above the surface
constexpr double kInset = 8;        // epsilons that it keeps from the edges of its triangle
constexpr double kLidBelow = 1.75;  // epsilons below the origin where a lid is looked for: nearer
                                    // than the own surface, with room for rounding

// Returns the point of a triangle near p that keeps `margin` from all edges; of a triangle that is
// too small for that, the point that is farthest from its edges.
glm::dvec3 inset(const std::array<glm::dvec3, 3>& corner, const glm::dvec3& p, double margin) {
  const glm::dvec3 normal = glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
  const double square = glm::dot(normal, normal);
  if (!(square > 0)) return p;
  // Compare each barycentric weight, which is the distance from the opposite edge over the height
  // above it, with the least weight that keeps the margin.
  std::array<double, 3> least{}, excess{};
  double sum_least = 0;
  double sum_excess = 0;
  bool is_inside = true;
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3& from = corner[(i + 1) % 3];
    const glm::dvec3 edge = corner[(i + 2) % 3] - from;
    const double weight = glm::dot(glm::cross(edge, p - from), normal) / square;
    least[i] = margin * glm::length(edge) / std::sqrt(square);
    excess[i] = std::max(0.0, weight - least[i]);
    is_inside = is_inside && weight >= least[i];
    sum_least += least[i];
    sum_excess += excess[i];
  }
  if (is_inside) return p;
  // Share out what the least weights leave in proportion to the excess of each weight.
  const double room = std::max(0.0, 1 - sum_least);
  const double scale = room > 0 ? room / sum_excess : 0;
  glm::dvec3 result(0);
  for (std::size_t i = 0; i < 3; ++i) {
    const double weight = room > 0 ? least[i] + scale * excess[i] : least[i] / sum_least;
    result += weight * corner[i];
  }
  return result;
}

// Finds the triangle at the point. Rounding may have put the point just off its triangle, and
// another triangle may lie in the same place and face the other way, so the surroundings are
// searched for a triangle whose front is on the normal's side.
std::optional<SurfaceHit> own_surface(const RayScene& scene, const glm::dvec3& position,
                                      const glm::vec3& normal) {
  const double e = scene.epsilon();
  // Look down from `height` at what lies up to `slack` above or below the point; lengths are in
  // epsilons.
  const auto around = [&](const glm::vec3& aside, double height, double slack) {
    const glm::dvec3 from = position + e * (height * glm::dvec3(normal) + glm::dvec3(aside));
    return scene.closest(from, -normal, (height - slack) * e, (height + slack) * e);
  };
  // Look at the point itself.
  std::optional<SurfaceHit> own = around(glm::vec3(0), kLift, kLift - kLidBelow);
  if (own && own->front) return own;
  // Look from higher up for a triangle that leans, whose plane passes through the point.
  const auto is_at_point = [&](const SurfaceHit& hit) {
    const double off = glm::dot(glm::dvec3(hit.geometric_normal), position - hit.position);
    return std::abs(off) < (kLift - kLidBelow) * e;
  };
  if (const auto leaning = around(glm::vec3(0), kInset, kInset); leaning && is_at_point(*leaning)) {
    if (leaning->front) return leaning;
  }
  // Look a little to each side of the point.
  const Basis basis(normal);
  for (const glm::vec3& aside : {basis.x, -basis.x, basis.y, -basis.y}) {
    const auto other = around(static_cast<float>(kInset) * aside, kLift, kLift - kLidBelow);
    if (other && (!own || other->front)) own = other;
    if (own && own->front) break;
  }
  return own;
}

}  // namespace

std::optional<glm::dvec3> step_off(const RayScene& scene, const glm::dvec3& position,
                                   const glm::vec3& normal) {
  const double e = scene.epsilon();
  std::optional<SurfaceHit> own = own_surface(scene, position, normal);
  if (!own) return position + kLift * e * glm::dvec3(normal);
  own->position = position;
  return step_off(scene, *own, own->front);
}

std::optional<glm::dvec3> step_off(const RayScene& scene, const SurfaceHit& at, bool front) {
  const double e = scene.epsilon();
  const Mesh& mesh = scene.mesh();
  std::array<glm::dvec3, 3> corner;
  for (std::size_t i = 0; i < 3; ++i) {
    corner[i] = glm::dvec3(mesh.positions[mesh.triangles[at.triangle][i]]);
  }
  // Rise along the geometric normal, because an interpolated one may lie nearly in the surface.
  const glm::vec3 up = front ? at.geometric_normal : -at.geometric_normal;
  const glm::dvec3 inside = mesh.origin + inset(corner, at.position - mesh.origin, kInset * e);
  const glm::dvec3 origin = inside + kLift * e * glm::dvec3(up);
  // Look for a lid between the origin and the own triangle.
  const auto lid = scene.closest_triangle(origin, -up, 0, kLidBelow * e);
  if (lid && !lid->front) return {};
  return origin;
}

}  // namespace ptc
