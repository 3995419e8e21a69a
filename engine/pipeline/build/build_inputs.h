// The inputs of a build: meshes, clouds or the city. They are measured first, because the sort
// needs the bounds and a sample of the points before the first of them (feed_inputs.h).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/clouds.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/build/still_light.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"
#include "engine/scene/sampling/mesh_parts.h"
#include "engine/scene/sampling/placed_sampler.h"
#include "engine/scene/sampling/solids.h"

namespace ptc {

/// The joined meshes of a request, ready for rays and light. It is destroyed before the sort needs
/// its memory.
struct LitMesh {
  /// @param solids  of the mesh, which become one-sided
  /// @param later   whether the lights shine on the surfels only after they are in the container
  LitMesh(Mesh m, const Solids& solids, const LightRig& lights, bool later)
      : mesh(std::move(m)), rays(mesh), light(rays, later ? LightRig{} : lights) {
    close_solids(mesh, solids, rays, lights);
  }

  Mesh mesh;
  RayScene rays;
  DirectLight light;
  std::uint32_t first = 0;  ///< the first triangle that is sampled
};

/// Meshes that do not fit in memory, and what a survey found of them.
struct StreamedMeshes {
  MeshParts parts;
  SurfaceSurvey found;
};

/// The measured inputs of a build, and what the sort must know about them beforehand.
struct BuildInputs {
  Bounds bounds;                   ///< of all inputs, scene units; empty when they have no points
  std::vector<glm::dvec3> sample;  ///< positions for the sort's splitters, scene units
  Clouds clouds;
  AttributePlan attributes;  ///< the channels of the scene that is appended to, and of the clouds
  LightRig lights;
  bool emitters = false;          ///< at least one material emits light
  bool rays_at_emitters = false;  ///< and lights the surfels of the meshes by rays
  /// Whether the points are lit once all of them are in the container, since not every one of them
  /// has the light of all lamps yet (spec/shading.md#mixed-light). Meshes then stay dark at first.
  bool relight = false;
  bool keeps_dark = false;                   ///< as SamplingOptions
  std::unique_ptr<LitMesh> lit;              ///< null when no meshes are in memory
  std::unique_ptr<StreamedMeshes> streamed;  ///< null when no meshes are on the disk
  /// The light of the still parts that these are added to, once these are fed; null without any.
  std::unique_ptr<StillLight> still_light;

  [[nodiscard]] bool has_meshes() const noexcept { return lit || streamed; }
};

/// Reads the meshes and measures the clouds of a request.
/// @param from     where the bounds of clouds may come from
/// @param scene    container that the inputs are appended to, whose channels become input 0 of the
///                 plan; null: there is none
/// @param limits   of the meshes
/// @param seconds  gets a row for the stage "read", except for a city
/// @throws DataError, FormatError, std::system_error
[[nodiscard]] BuildInputs read_inputs(const BuildRequest& request, BoundsFrom from,
                                      const ContainerReader* scene, const MeshLimits& limits,
                                      StageSeconds& seconds, Progress& progress);

/// Returns about 2^16 places that are spread over a mesh by area, scene units.
/// @param first  the first triangle that counts
[[nodiscard]] std::vector<glm::dvec3> places_on(const Mesh& mesh, std::uint32_t first = 0);

/// Returns the coordinates of a point as the array that Frame takes.
[[nodiscard]] inline std::array<double, 3> to_array(const glm::dvec3& p) {
  return {p.x, p.y, p.z};
}

}  // namespace ptc
