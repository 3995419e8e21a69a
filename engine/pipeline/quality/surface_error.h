// Measures how well the surfels of a container stand for the meshes that they were made of.
//
//   place on the mesh     o-----> rays at the mesh       with the direct light where they end
//                         |
//   receiver above it     o-----> rays at the surfels    along the same directions
//
// What a picture of the surfels gets wrong, whatever the settings of its gather.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/memory_budget.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/scene/ray_scene.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// Compares containers of the same meshes with these meshes, at the same places.
///
/// The places are spread over the meshes by area, on the sides that light reaches; where the
/// sampling has a camera, over its picture. Their light at the mesh, by two independent sets of
/// rays, is found once, with one reflection. That at the surfels comes along the same directions,
/// so that most of the noise of the rays falls out of the differences.
///
/// Results depend on the meshes, the lights and the containers alone.
/// Memory: within the cap of the request; between two calls some 10 MB.
class SurfaceJudge {
 public:
  static constexpr unsigned kPlaces = 2048;  ///< places that are compared, at most
  static constexpr unsigned kFewestPlaces = 64;
  static constexpr unsigned kRays = 512;  ///< of each of the two sets of rays of a place

  /// @param request   names the meshes, the camera of its sampling and the resources; must outlive
  ///                  this
  /// @param target    as for roomiest_temp_dir()
  /// @param executor  must outlive this
  SurfaceJudge(const BuildRequest& request, std::filesystem::path target, const Executor& executor)
      : request_(request), target_(std::move(target)), executor_(executor) {}

  /// Returns the errors of a container. Irradiance is that of light from surfaces, as for shading.
  /// @param scene  built of the meshes of the request, with the same lights each time
  /// @throws RequestError when the meshes do not fit in memory, or fewer than kFewestPlaces of
  ///         theirs are lit or seen; LimitError, DataError, std::system_error
  [[nodiscard]] BoundedError measure(const ContainerReader& scene);

 private:
  /// A place on the mesh that is compared.
  struct Place {
    SurfaceHit at;         ///< `front` says which side is seen
    glm::vec3 towards{0};  ///< direction in which it is looked at, unit
  };

  /// Returns a budget with what is in memory all the time: the container's directory, the sky and
  /// the mesh of the request.
  [[nodiscard]] MemoryBudget budget(const ContainerReader& scene, const Sky& sky) const;
  /// Returns the sides of the meshes' places that light reaches.
  [[nodiscard]] std::vector<Place> places_on(const RayScene& rays, const DirectLight& light) const;
  /// Returns the places that the camera sees.
  [[nodiscard]] std::vector<Place> places_seen(const RayScene& rays, const Camera& camera) const;
  /// Finds the light at the mesh of all places.
  void trace_truth(const RayScene& rays, const DirectLight& light, bool by_emitters);

  const BuildRequest& request_;
  std::filesystem::path target_;
  const Executor& executor_;
  std::vector<Place> places_;
  std::vector<Shading> truth_;  ///< two for each place, side by side; empty before the first call
};

}  // namespace ptc
