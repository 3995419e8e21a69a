// Turns a mesh into surfels, one patch of some 8192 surfels at a time.
//
//     surface of a patch      16 points a surfel      groups of points       one surfel each
//                             evenly spread           (Lloyd's method)
//     +-----------+           +-----------+           +-----+-----+          +-----------+
//     |\    |    /|           |. . . . . .|           |. . .|. . .|          |   _     _  |
//     | \   |   / |   --->    | . . . . . |   --->    | . . | . . |   --->   |  ( )   ( ) |
//     |  \  |  /  |           |. . . . . .|           |. . .|. . .|          |   -     -  |
//     +-----------+           +-----------+           +-----+-----+          +-----------+
//       triangles             surface_patches.h       clusters.h             place(), reflected()
//
// The points measure a group: its area, mean normal, albedo and emission. The surfel lies at the
// middle of its group; the light is traced from 4 of the points, which share the surfel's rays.
// Patches depend on nothing but the mesh and the options, so threads make them in any number and
// they come out in order.
//
// What each step gains against rays at the mesh is measured in spec/shading.md#from-a-mesh.
#include "engine/scene/sampling/sampler.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/base/low_discrepancy.h"
#include "engine/scene/sampling/clusters.h"
#include "engine/scene/sampling/directions.h"
#include "engine/scene/sampling/spacing_field.h"
#include "engine/scene/sampling/sub_triangle.h"
#include "engine/scene/sampling/surface_patches.h"
#include "engine/scene/sampling/surroundings.h"

namespace ptc {
namespace {

constexpr double kPatchSurfels = 8192;
constexpr unsigned kPointsPerSurfel = 16;
constexpr unsigned kRounds = 6;     // of Lloyd's method
constexpr unsigned kLitPoints = 4;  // points of a surfel that light is traced from, evenly spread
// Where both sides of a surface count, their surfels are kept apart: a back that lay at the place
// of a front would hide it. Their radii differ, so that clusters of them have a mean normal.
constexpr float kHalfGap = 0.02F;     // from the surface to each of them, radii
constexpr float kDifference = 0.02F;  // of each one's area from their mean, over that
constexpr double kMinNormal = 0.1;    // least length of a mean normal that is used
constexpr double kMaxAcross = 3e5;    // spacings along the side of a square as large as the mesh

// Returns the rays of one lit point, of those that a surfel has; rounded up.
unsigned share(unsigned rays) {
  return (rays + kLitPoints - 1) / kLitPoints;
}

double sides_of(const Mesh& mesh, std::uint32_t triangle) {
  return mesh.materials[mesh.material_of[triangle]].double_sided ? 2 : 1;
}

glm::vec3 finite_or_black(const glm::vec3& c) {
  return std::isfinite(c.x + c.y + c.z) ? c : glm::vec3(0);
}

// Returns the options with a spacing. @throws RequestError when an option makes no sense
SamplingOptions resolved(const Mesh& mesh, SamplingOptions options) {
  check_sampling(options);
  const bool by_count = options.spacing == 0;
  if (by_count) options.spacing = spacing_for(mesh, options.count);
  // Limit the number of surfels, because memory grows with it, if slowly.
  const double side = spacing_for(mesh, 1);
  require_request(side == 0 || side / options.spacing <= kMaxAcross,
                  by_count ? "sampling.count" : "sampling.spacing",
                  by_count ? "`sampling.count` is more than 9 * 10^10"
                           : "`sampling.spacing` is too small for a mesh of this size");
  return options;
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

// Sums over the points of a group, which describe its surfel.
struct Group {
  double area = 0;  // of one side, scene units squared
  glm::dvec3 albedo{0};
  glm::dvec3 emission{0};
  glm::dvec3 normal{0};
  std::vector<std::uint32_t> members;  // indices of the points, ascending: neighbours follow each
                                       // other
  std::uint32_t nearest = 0;           // index of the point that is nearest to the middle
  float distance = std::numeric_limits<float>::infinity();  // of that point from the middle
};

// Streams the surfels of a mesh. It makes a few patches at a time, in parallel, and hands them out
// in order.
class MeshSource final : public PointSource {
 public:
  MeshSource(const DirectLight& light, const RayScene& scene, const SamplingOptions& options,
             const Executor& executor)
      : light_(light),
        scene_(scene),
        options_(resolved(scene.mesh(), options)),
        lit_point_{share(options.lights.sun_rays), share(options.lights.area_rays),
                   share(options.lights.sky_rays)},
        executor_(executor),
        field_(options_),
        patches_(scene.mesh(), field_, kPatchSurfels) {}

  std::size_t next(std::span<Surfel> out) override {
    std::size_t filled = 0;
    while (filled < out.size()) {
      if (patch_ == ready_.size() && !fetch()) break;
      const std::vector<Surfel>& from = ready_[patch_];
      const std::size_t count = std::min(out.size() - filled, from.size() - taken_);
      std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(taken_), count,
                  out.begin() + static_cast<std::ptrdiff_t>(filled));
      filled += count;
      taken_ += count;
      if (taken_ == from.size()) {
        ++patch_;
        taken_ = 0;
      }
    }
    return filled;
  }

 private:
  // Makes the next patches, a few for each thread so that no thread waits long for the others.
  // @return  false after the last patch
  bool fetch() {
    const std::size_t count =
        std::min<std::size_t>(patches_.size() - done_, std::size_t{4} * executor_.threads());
    if (count == 0) return false;
    ready_.assign(count, {});
    patch_ = 0;
    executor_.for_each(count, [&](std::size_t i, unsigned) { ready_[i] = make_patch(done_ + i); });
    done_ += count;
    return true;
  }

  [[nodiscard]] std::vector<Surfel> make_patch(std::size_t index) const;
  // Sums up the points of each cluster.
  [[nodiscard]] std::vector<Group> sum_up(const std::vector<SurfacePoint>& points,
                                          const std::vector<std::uint32_t>& owners,
                                          const std::vector<Cluster>& clusters) const;
  [[nodiscard]] Surfel place(const Group& group, const SurfacePoint& nearest,
                             const Cluster& cluster) const;
  [[nodiscard]] std::optional<glm::vec3> reflected(const Group& group,
                                                   std::span<const SurfacePoint> points, float side,
                                                   std::uint64_t seed) const;

  const DirectLight& light_;
  const RayScene& scene_;
  SamplingOptions options_;
  LightSampling lit_point_;  // shadow rays for each lit point of a surfel
  const Executor& executor_;
  SpacingField field_;
  SurfacePatches patches_;
  std::size_t done_ = 0;                    // patches made so far
  std::vector<std::vector<Surfel>> ready_;  // patches that are made and not all handed out
  std::size_t patch_ = 0;                   // index in ready_ of the one being handed out
  std::size_t taken_ = 0;                   // surfels of it that were handed out
};

std::vector<Group> MeshSource::sum_up(const std::vector<SurfacePoint>& points,
                                      const std::vector<std::uint32_t>& owners,
                                      const std::vector<Cluster>& clusters) const {
  std::vector<Group> groups(clusters.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const SurfacePoint& p = points[i];
    Group& group = groups[owners[i]];
    const SurfaceHit surface = scene_.surface(p.triangle, p.uv.x, p.uv.y);
    group.area += p.area;
    group.members.push_back(i);
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
Surfel MeshSource::place(const Group& group, const SurfacePoint& nearest,
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
  surfel.radius = static_cast<float>(std::sqrt(0.5 * group.area));
  surfel.albedo = finite_or_black(glm::vec3(group.albedo / count));
  surfel.position =
      at.position + glm::dvec3(move_inwards(scene_, at.position, surfel.normal, surfel.radius));
  return surfel;
}

// Returns the mean radiance that a group reflects on one side, from those of a few of its points
// that are not buried, or nothing when all of them are.
// @param side  1 for the front, -1 for the back
std::optional<glm::vec3> MeshSource::reflected(const Group& group,
                                               std::span<const SurfacePoint> points, float side,
                                               std::uint64_t seed) const {
  const std::size_t size = group.members.size(), count = std::min<std::size_t>(kLitPoints, size);
  glm::vec3 sum(0);
  float lit = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const SurfacePoint& point = points[group.members[(2 * i + 1) * size / (2 * count)]];
    const SurfaceHit at = scene_.surface(point.triangle, point.uv.x, point.uv.y);
    const std::uint64_t own_seed = kLitPoints * seed + i;
    if (is_buried(scene_, at.position, side * at.geometric_normal, own_seed)) continue;
    const DirectLight::Result direct =
        light_.irradiance(at.position, side * at.normal, lit_point_, own_seed);
    sum += finite_or_black(at.albedo / kPi * (direct.local + direct.sky));
    lit += 1;
  }
  if (lit == 0) return {};
  return sum / lit;
}

std::vector<Surfel> MeshSource::make_patch(std::size_t index) const {
  // Spread points over the patch, and group them.
  const SurfacePatch patch = patches_.spread(index, kPointsPerSurfel);
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
    const auto front = reflected(group, patch.points, 1, 2 * (patch.first + i));
    const auto back =
        sides == 1 ? std::nullopt : reflected(group, patch.points, -1, 2 * (patch.first + i) + 1);
    if (!front && !back) continue;
    Surfel surfel = place(group, nearest, clusters[i]);
    const bool both = front && back;
    const glm::dvec3 middle = surfel.position;
    const glm::dvec3 apart(both ? kHalfGap * surfel.radius * surfel.normal : glm::vec3(0));
    const float radius = surfel.radius, difference = both ? kDifference : 0;
    if (front) {
      surfel.radius = radius * std::sqrt(1 + difference);
      surfel.position = middle + apart;
      surfel.emission =
          finite_or_black(glm::vec3(group.emission / static_cast<double>(group.members.size())));
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

}  // namespace

void check_sampling(const SamplingOptions& options) {
  require_request(options.spacing >= 0 && std::isfinite(options.spacing), "sampling.spacing",
                  "`sampling.spacing` is negative or not finite");
  require_request(options.spacing > 0 || options.count > 0, "sampling.count",
                  "`sampling.count` is 0");
  constexpr unsigned kMaxRays = 1 << 16;
  const LightSampling& lights = options.lights;
  require_request(std::max({lights.sun_rays, lights.area_rays, lights.sky_rays}) <= kMaxRays,
                  "sampling.lights.area_rays",
                  "`sampling.lights.area_rays` or another number of rays is above 65536");
  if (!options.camera) return;
  require_request(options.pixels_per_surfel > 0 && std::isfinite(options.pixels_per_surfel),
                  "sampling.pixels_per_surfel", "`sampling.pixels_per_surfel` is not positive");
  require_request(options.finest > 0 && options.finest <= 1, "sampling.finest",
                  "`sampling.finest` is not above 0 and at most 1");
  check_camera(*options.camera, "sampling.camera");
}

double spacing_for(const Mesh& mesh, std::uint64_t count) {
  require_request(count > 0, "sampling.count", "`sampling.count` is 0");
  double area = 0;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    area += sides_of(mesh, i) * whole_triangle(mesh, i).area();
  }
  return std::sqrt(area / static_cast<double>(count));
}

std::uint64_t sampling_bytes(std::uint64_t triangles, std::uint64_t surfels,
                             unsigned threads) noexcept {
  return 24 * std::max(triangles, surfels / 1000) + (std::uint64_t{20} << 20) * threads;
}

std::unique_ptr<PointSource> sample_mesh(const DirectLight& light, const RayScene& scene,
                                         const SamplingOptions& options, const Executor& executor) {
  return std::make_unique<MeshSource>(light, scene, options, executor);
}

}  // namespace ptc
