// Turns a patch of surface into surfels.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/surfel.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"
#include "engine/scene/sampling/clusters.h"
#include "engine/scene/sampling/surface_patches.h"

namespace ptc {

/// Returns how many sides of a triangle count: two where its material is double-sided.
[[nodiscard]] double sides_of(const Mesh& mesh, std::uint32_t triangle);

/// How a stretch of surface turns, and how its light changes.
struct SurfaceDetail {
  std::vector<glm::dvec3> places;  ///< some of its points, scene units
  double area = 0;                 ///< of all sides, scene units squared
  double turn = 0;   ///< root mean square of the angles between normals and their mean, rad, about
  double light = 0;  ///< radiance that leaves it, mean of its points, sides and R, G, B
  double contrast = 0;  ///< standard deviation of that over the points
};

/// Groups the points of a patch, and makes a surfel of each group.
///
///     surface of a patch      16 points a surfel      groups of points       one surfel each
///                             evenly spread           (Lloyd's method)
///     +-----------+           +-----------+           +-----+-----+          +-----------+
///     |\    |    /|           |. . . . . .|           |. . .|. . .|          |   _     _  |
///     | \   |   / |   --->    | . . . . . |   --->    | . . | . . |   --->   |  ( )   ( ) |
///     |  \  |  /  |           |. . . . . .|           |. . .|. . .|          |   -     -  |
///     +-----------+           +-----------+           +-----+-----+          +-----------+
///       triangles             surface_patches.h       clusters.h             place(), reflected()
///
/// The points measure a group: its area, mean normal, albedo and emission. The surfel lies at the
/// middle of its group; the light is traced from 4 of the points, which share the surfel's rays.
/// How far it must move from an edge is looked for only where no groups lie around it. A side of a
/// double-sided material that no light reaches, not even by way of other surfaces, counts as
/// buried.
///
/// Threads: sample() may be called concurrently.
class PatchSampler {
 public:
  /// Points of a patch for each surfel.
  static constexpr unsigned kPointsPerSurfel = 16;
  /// Points of a surfel that light is traced from, evenly spread.
  static constexpr unsigned kLitPoints = 4;

  /// @param scene  has the patch and all that lies around it; must outlive this
  /// @param light  of that scene, must outlive this; null: surfels reflect nothing, and none counts
  ///               as buried, because `scene` is a part of what could bury it
  /// @param rays   shadow rays of each surfel
  /// @param keeps_dark  as SamplingOptions::keeps_dark
  PatchSampler(const RayScene& scene, const DirectLight* light, const LightSampling& rays,
               bool keeps_dark);

  /// Returns the surfels of a patch. The sum of their 2 r^2 is the area of the patch less that of
  /// groups that are buried; surfels of what is not opaque are smaller, so that they cover as much.
  /// @param patch  has kPointsPerSurfel points for each surfel
  [[nodiscard]] std::vector<Surfel> sample(const SurfacePatch& patch) const;

  /// Measures the groups of a patch, but for those of which no surfel would come.
  /// @param patch  as for sample()
  /// @pre there is a light
  [[nodiscard]] std::vector<SurfaceDetail> look_closely(const SurfacePatch& patch) const;

  /// Says whether a side of a place on the surface is likely to get a surfel: whether light reaches
  /// it, or it is not buried.
  /// @pre there is a light
  [[nodiscard]] bool is_seen(const SurfaceHit& at, bool front, std::uint64_t seed) const;

 private:
  struct Group;
  // Sums up the points of each cluster.
  [[nodiscard]] std::vector<Group> sum_up(const std::vector<SurfacePoint>& points,
                                          const std::vector<std::uint32_t>& owners,
                                          const std::vector<Cluster>& clusters) const;
  [[nodiscard]] Surfel place(const Group& group, const SurfacePoint& nearest,
                             const Cluster& cluster) const;
  /// Returns one of the places of a group that light is traced from.
  /// @param index  below `count`
  [[nodiscard]] SurfaceHit lit_place(const Group& group, std::span<const SurfacePoint> points,
                                     std::size_t index, std::size_t count) const;
  [[nodiscard]] std::optional<glm::vec3> reflected(const Group& group,
                                                   std::span<const SurfacePoint> points, float side,
                                                   std::uint64_t seed) const;
  /// Says whether a point lies inside a solid.
  [[nodiscard]] bool is_sunk(const SurfacePoint& point, std::uint64_t seed) const;
  /// What is on one side of a place: a solid, surfaces that pass no light on, or neither.
  enum class Place : std::uint8_t { buried, dark, seen };
  /// One side of a place, and the irradiance there, W/m^2.
  struct Arriving {
    Place place = Place::seen;
    glm::vec3 light{0};
  };
  [[nodiscard]] Arriving look_at(const SurfaceHit& at, bool front, std::uint64_t seed) const;
  [[nodiscard]] bool is_left_dark(const glm::dvec3& origin, const glm::vec3& normal,
                                  std::uint64_t seed) const;

  const RayScene& scene_;
  const DirectLight* light_;
  LightSampling lit_point_;  // shadow rays for each lit point of a surfel
  bool keeps_dark_;
};

}  // namespace ptc
