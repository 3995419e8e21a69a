// What each step gains against rays at the mesh is measured in spec/shading.md#from-a-mesh.
#include "engine/scene/sampling/patch_sampler.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/base/low_discrepancy.h"
#include "engine/base/numbers.h"
#include "engine/scene/sampling/directions.h"
#include "engine/scene/sampling/surroundings.h"
#include "engine/scene/step_off.h"

namespace ptc {
namespace {

constexpr unsigned kRounds = 6;  // of Lloyd's method
// Where both sides of a surface count, their surfels are kept apart: a back that lay at the place
// of a front would hide it. Their radii differ, so that clusters of them have a mean normal.
constexpr float kHalfGap = 0.02F;     // from the surface to each of them, radii
constexpr float kDifference = 0.02F;  // of each one's area from their mean, over that
constexpr double kMinNormal = 0.1;    // least length of a mean normal that is used

// Returns 2 r^2 of a surfel over the area for which it stands, of a surface that stops a share of
// the light. Discs as large as an opaque surface asks for overlap; smaller ones do so less, and
// cover up to pi / 2 times as much. Found by rays at panes of opacity 0.25, 0.5 and 0.75, whose
// surfels cover that share to 0.02 (spec/notes/surfels.md, "Surfaces that light passes through").
double area_share(double opacity) {
  return opacity * (0.625 + 0.375 * std::pow(opacity, 13));
}

// Returns the rays of one lit point, of those that a surfel has; rounded up.
unsigned share(unsigned rays) {
  return (rays + PatchSampler::kLitPoints - 1) / PatchSampler::kLitPoints;
}

glm::vec3 finite_or_black(const glm::vec3& c) {
  return std::isfinite(c.x + c.y + c.z) ? c : glm::vec3(0);
}

// Returns the barycentric coordinates of the triangle's point that is nearest to p. The plane has
// seven regions: three where a corner is nearest, three where an edge is, and the triangle itself.
// Source: Ericson 2005, Real-time collision detection, section 5.1.5.
glm::vec2 nearest_on_triangle(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b,
                              const glm::dvec3& c) {
  // Test the corners.
  const glm::dvec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return {0, 0};
  const double d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return {1, 0};
  const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return {0, 1};
  // Test the edges.
  const double across_c = d1 * d4 - d3 * d2;
  if (across_c <= 0 && d1 >= 0 && d3 <= 0) return {d1 / (d1 - d3), 0};
  const double across_b = d5 * d2 - d1 * d6;
  if (across_b <= 0 && d2 >= 0 && d6 <= 0) return {0, d2 / (d2 - d6)};
  const double across_a = d3 * d6 - d5 * d4;
  if (across_a <= 0 && d4 >= d3 && d5 >= d6) {
    const double v = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {1 - v, v};
  }
  // Take the foot of the perpendicular on the face.
  const double sum = across_a + across_b + across_c;
  return {across_b / sum, across_c / sum};
}

}  // namespace

// Sums over the points of a group, which describe its surfel.
struct PatchSampler::Group {
  double area = 0;     // of one side, times the opacity, scene units squared
  double opacity = 0;  // sum over the points
  glm::dvec3 albedo{0};
  glm::dvec3 emission{0};
  glm::dvec3 normal{0};
  std::vector<std::uint32_t> members;  // indices of the points, ascending: neighbours follow each
                                       // other
  std::uint32_t nearest = 0;           // index of the point that is nearest to the middle
  float distance = std::numeric_limits<float>::infinity();  // of that point from the middle
};

double sides_of(const Mesh& mesh, std::uint32_t triangle) {
  return mesh.materials[mesh.material_of[triangle]].double_sided ? 2 : 1;
}

PatchSampler::PatchSampler(const RayScene& scene, const DirectLight* light,
                           const LightSampling& rays, bool keeps_dark)
    : scene_(scene),
      light_(light),
      lit_point_{share(rays.sun_rays), share(rays.area_rays), share(rays.sky_rays)},
      keeps_dark_(keeps_dark) {}

std::vector<PatchSampler::Group> PatchSampler::sum_up(const std::vector<SurfacePoint>& points,
                                                      const std::vector<std::uint32_t>& owners,
                                                      const std::vector<Cluster>& clusters) const {
  std::vector<Group> groups(clusters.size());
  SurfaceHit surface;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const SurfacePoint& p = points[i];
    Group& group = groups[owners[i]];
    if (i == 0 || p.triangle != surface.triangle || !scene_.is_plain(p.triangle))
      surface = scene_.surface(p.triangle, p.uv.x, p.uv.y);
    group.area += p.area;
    group.members.push_back(i);
    group.opacity += static_cast<double>(surface.opacity);
    group.albedo += glm::dvec3(surface.albedo);
    group.emission += glm::dvec3(surface.emission);
    group.normal += glm::dvec3(surface.normal);
    const float distance = glm::distance(p.position, clusters[owners[i]].position);
    if (distance < group.distance) {
      group.distance = distance;
      group.nearest = i;
    }
  }
  return groups;
}

// Places a surfel at the middle of its group, on the triangle of the point that is nearest to the
// middle, across the group's mean normal, and moves it away from edges that it sticks out over.
Surfel PatchSampler::place(const Group& group, const SurfacePoint& nearest,
                           const Cluster& cluster) const {
  // Find the place on the mesh that is nearest to the middle.
  const Mesh& mesh = scene_.mesh();
  const auto& c = mesh.triangles[nearest.triangle];
  glm::vec2 uv =
      nearest_on_triangle(glm::dvec3(cluster.position), glm::dvec3(mesh.positions[c[0]]),
                          glm::dvec3(mesh.positions[c[1]]), glm::dvec3(mesh.positions[c[2]]));
  if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) uv = nearest.uv;
  const SurfaceHit at = scene_.surface(nearest.triangle, uv.x, uv.y);
  // Take the means of the group, and the normal there when the group's normals cancel out.
  const auto count = static_cast<double>(group.members.size());
  const double length = glm::length(group.normal);
  Surfel surfel;
  surfel.normal = length > kMinNormal * count ? glm::vec3(group.normal / length) : at.normal;
  const double opacity = group.opacity / count;
  surfel.radius = static_cast<float>(std::sqrt(0.5 * group.area / opacity * area_share(opacity)));
  surfel.albedo = finite_or_black(glm::vec3(group.albedo / count));
  surfel.position = at.position;
  if (!cluster.is_enclosed)
    surfel.position += move_inwards(scene_, at.position, surfel.normal, surfel.radius);
  return surfel;
}

SurfaceHit PatchSampler::lit_place(const Group& group, std::span<const SurfacePoint> points,
                                   std::size_t index, std::size_t count) const {
  const SurfacePoint& point =
      points[group.members[(2 * index + 1) * group.members.size() / (2 * count)]];
  return scene_.surface(point.triangle, point.uv.x, point.uv.y);
}

// Returns the mean radiance that a group reflects on one side, from those of a few of its points
// that are not buried, or nothing when all of them are.
// @param side  1 for the front, -1 for the back
std::optional<glm::vec3> PatchSampler::reflected(const Group& group,
                                                 std::span<const SurfacePoint> points, float side,
                                                 std::uint64_t seed) const {
  if (light_ == nullptr) return glm::vec3(0);
  const std::size_t count = std::min<std::size_t>(kLitPoints, group.members.size());
  glm::vec3 sum(0);
  float looked_at = 0;  // points that are not buried
  bool seen = false;    // one of them is not dark
  for (std::size_t i = 0; i < count; ++i) {
    const SurfaceHit at = lit_place(group, points, i, count);
    const Arriving arriving = look_at(at, side > 0, kLitPoints * seed + i);
    if (arriving.place == Place::buried) continue;
    if (light_->is_black()) return glm::vec3(0);
    sum += finite_or_black(at.albedo / kPi * arriving.light);
    looked_at += 1;
    seen |= arriving.place == Place::seen;
  }
  if (!seen) return {};
  return sum / looked_at;
}

// Says whether light is unlikely to reach a place by way of other surfaces: a few paths find
// neither the sky nor a place that is lit. So it is inside a column whose sides are all
// double-sided, and which stands open on a floor.
// @param origin  as step_off() returns it
// @param normal  unit, on the side that is asked about
bool PatchSampler::is_left_dark(const glm::dvec3& origin, const glm::vec3& normal,
                                std::uint64_t seed) const {
  constexpr std::uint32_t kPaths = 4, kSegments = 4;
  constexpr LightSampling kOneRay{.sun_rays = 1, .area_rays = 1, .sky_rays = 1};
  const Mesh& mesh = scene_.mesh();
  for (std::uint32_t path = 0; path < kPaths; ++path) {
    glm::dvec3 from = origin;
    glm::vec3 upwards = normal;
    for (std::uint32_t segment = 0; segment < kSegments; ++segment) {
      const std::uint64_t own_seed = splitmix64(seed ^ (path * kSegments + segment + 1));
      const glm::vec3 direction =
          Basis(upwards).to_world(cosine_direction(SquarePoints(own_seed).square(0)));
      const auto hit = scene_.closest(from, direction, 0, std::numeric_limits<double>::infinity());
      if (!hit || (hit->front && hit->emission != glm::vec3(0))) return false;
      if (!hit->front && !mesh.materials[mesh.material_of[hit->triangle]].double_sided) break;
      const auto next = step_off(scene_, *hit, hit->front);
      if (!next) break;
      from = *next;
      upwards = hit->front ? hit->geometric_normal : -hit->geometric_normal;
      const DirectLight::Result direct =
          light_->irradiance(hit->position, from, upwards, kOneRay, own_seed);
      if (direct.local + direct.sky != glm::vec3(0)) return false;
    }
  }
  return true;
}

bool PatchSampler::is_sunk(const SurfacePoint& point, std::uint64_t seed) const {
  const SurfaceHit at = scene_.surface(point.triangle, point.uv.x, point.uv.y);
  const auto origin = step_off(scene_, at, true);
  return !origin || is_buried(scene_, *origin, at.geometric_normal, seed);
}

// Finds the light that arrives at one side of a place and, where there is none, whether any might.
PatchSampler::Arriving PatchSampler::look_at(const SurfaceHit& at, bool front,
                                             std::uint64_t seed) const {
  const float side = front ? 1 : -1;
  const auto origin = step_off(scene_, at, front);
  if (!origin) return {Place::buried};
  // What light reaches is not buried; look around where there is none.
  if (!light_->is_black()) {
    const DirectLight::Result direct =
        light_->irradiance(at.position, *origin, side * at.normal, lit_point_, seed);
    const glm::vec3 light = direct.local + direct.sky;
    if (light != glm::vec3(0)) return {Place::seen, light};
  }
  const glm::vec3 upwards = side * at.geometric_normal;
  if (is_buried(scene_, *origin, upwards, seed)) return {Place::buried};
  const bool dark = !keeps_dark_ && sides_of(scene_.mesh(), at.triangle) == 2 &&
                    !light_->is_black() && is_left_dark(*origin, upwards, seed);
  return {dark ? Place::dark : Place::seen};
}

bool PatchSampler::is_seen(const SurfaceHit& at, bool front, std::uint64_t seed) const {
  return look_at(at, front, seed).place == Place::seen;
}

std::vector<SurfaceDetail> PatchSampler::look_closely(const SurfacePatch& patch) const {
  constexpr unsigned kRoughRounds = 3;
  constexpr std::size_t kPlaces = 4;
  std::vector<std::uint32_t> owners;
  const std::vector<Cluster> clusters =
      cluster_points(patch.points, patch.surfels, kRoughRounds, owners);
  std::vector<SurfaceDetail> details;
  std::uint64_t seed = 2 * patch.first;
  for (const Group& group : sum_up(patch.points, owners, clusters)) {
    const std::size_t count = std::min<std::size_t>(kLitPoints, group.members.size());
    SurfaceDetail detail;
    std::vector<double> light(count);
    bool seen = false;
    for (const bool front : {true, false}) {
      if (!front && sides_of(scene_.mesh(), patch.points[group.nearest].triangle) == 1) break;
      detail.area += group.area;
      for (std::size_t i = 0; i < count; ++i) {
        const SurfaceHit at = lit_place(group, patch.points, i, count);
        const Arriving arriving = look_at(at, front, kLitPoints * seed + i);
        seen |= arriving.place == Place::seen;
        const glm::vec3 leaving = finite_or_black(at.albedo / kPi * arriving.light) +
                                  (front ? finite_or_black(at.emission) : glm::vec3(0));
        light[i] += static_cast<double>(leaving.x + leaving.y + leaving.z) / 3;
      }
      ++seed;
    }
    if (!seen) continue;
    // Sum up
    double square = 0;
    for (const double at : light) {
      detail.light += at / static_cast<double>(count);
      square += at * at / static_cast<double>(count);
    }
    detail.contrast = std::sqrt(std::max(0.0, square - detail.light * detail.light));
    const double straight = glm::length(group.normal) / static_cast<double>(group.members.size());
    detail.turn = std::sqrt(2 * std::max(0.0, 1 - straight));
    for (std::size_t i = 0; i < group.members.size(); i += group.members.size() / kPlaces + 1) {
      detail.places.push_back(scene_.mesh().origin +
                              glm::dvec3(patch.points[group.members[i]].position));
    }
    details.push_back(std::move(detail));
  }
  return details;
}

std::vector<Surfel> PatchSampler::sample(const SurfacePatch& patch) const {
  // Group the points.
  std::vector<std::uint32_t> owners;
  const std::vector<Cluster> clusters =
      cluster_points(patch.points, patch.surfels, kRounds, owners);
  const std::vector<Group> groups = sum_up(patch.points, owners, clusters);

  // Light and place a surfel for each group that is not buried, two where both sides count.
  std::vector<Surfel> surfels;
  double covered = 0;  // sum of 2 r^2 of all surfels, buried ones as well
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    const Group& group = groups[i];
    const SurfacePoint& nearest = patch.points[group.nearest];
    const double sides = sides_of(scene_.mesh(), nearest.triangle);
    covered += group.area * sides;
    auto front = reflected(group, patch.points, 1, 2 * (patch.first + i));
    const auto back =
        sides == 1 ? std::nullopt : reflected(group, patch.points, -1, 2 * (patch.first + i) + 1);
    // A wall between two dark places still keeps light out
    if (sides == 2 && !front && !back && !is_sunk(nearest, 2 * (patch.first + i)))
      front = glm::vec3(0);
    if (!front && !back) continue;
    Surfel surfel = place(group, nearest, clusters[i]);
    const bool both = front && back;
    const glm::dvec3 middle = surfel.position;
    const glm::dvec3 apart(both ? kHalfGap * surfel.radius * surfel.normal : glm::vec3(0));
    const float radius = surfel.radius, difference = both ? kDifference : 0;
    if (front) {
      surfel.radius = radius * std::sqrt(1 + difference);
      surfel.position = middle + apart;
      // What the cell emits, from the area that its front has
      const double shares = static_cast<double>(group.members.size()) * (1 + double{difference});
      surfel.emission = finite_or_black(glm::vec3(group.emission / shares));
      surfel.radiance = *front;
      surfels.push_back(surfel);
    }
    if (back) {
      surfel.radius = radius * std::sqrt(1 - difference);
      surfel.position = middle - apart;
      surfel.normal = -surfel.normal;
      surfel.emission = glm::vec3(0);
      surfel.radiance = *back;
      surfels.push_back(surfel);
    }
  }
  // Scale the radii so that the surfels have the area of the patch.
  const auto scale = static_cast<float>(std::sqrt(patch.area / covered));
  for (Surfel& surfel : surfels) surfel.radius *= scale;
  return surfels;
}

}  // namespace ptc
