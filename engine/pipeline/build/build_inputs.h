// The inputs of a build: meshes, clouds or the city. They are measured first and then fed to the
// sort, because the sort needs the bounds and a sample of the points before the first of them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"
#include "engine/sort/external_sort.h"

namespace ptc {

/// The clouds of a request, checked and measured in a first pass.
struct Clouds {
  struct Cloud {
    std::filesystem::path path;
    std::uint64_t points = 0;
  };
  std::vector<Cloud> files;
  Bounds bounds;                   ///< of all points, scene units
  std::vector<glm::dvec3> sample;  ///< positions of an even share of the points, scene units
  std::uint64_t points = 0;        ///< in all files
  bool estimate_radii = false;     ///< one of the files gives no radii
  bool emits = false;              ///< a point emits light

  /// Reads a cloud to its end and adds it to the others.
  /// @throws DataError when the points have no normals or the file breaks its format
  void measure(const std::filesystem::path& path, Progress& progress);
};

/// The joined meshes of a request, ready for rays and light. It is destroyed before the sort needs
/// its memory.
struct LitMesh {
  LitMesh(Mesh m, const LightRig& lights) : mesh(std::move(m)), rays(mesh), light(rays, lights) {}

  Mesh mesh;
  RayScene rays;
  DirectLight light;
};

/// The measured inputs of a build, and what the sort must know about them beforehand.
struct BuildInputs {
  Bounds bounds;                   ///< of all inputs, scene units; empty when they have no points
  std::vector<glm::dvec3> sample;  ///< positions for the sort's splitters, scene units
  Clouds clouds;
  LightRig lights;
  bool emitters = false;         ///< at least one material emits light
  std::unique_ptr<LitMesh> lit;  ///< null when the inputs have no triangles
};

/// Reads the meshes and measures the clouds of a request.
/// @param seconds  gets a row for the stage "read", except for a city
/// @throws DataError, std::system_error
[[nodiscard]] BuildInputs read_inputs(const BuildRequest& request, StageSeconds& seconds,
                                      Progress& progress);

/// Feeds the surfels of all inputs to the sort. Meshes are sampled and lit on the way, and freed
/// afterwards.
/// @return  distance between neighbouring surfels on the meshes, scene units; 0 without meshes
/// @throws DataError when a cloud changed since it was measured; std::system_error
double feed_inputs(BuildInputs& inputs, const BuildRequest& request, const Frame& frame,
                   ExternalSorter& sorter, const Executor& executor, Progress& progress);

/// Returns the coordinates of a point as the array that Frame takes.
[[nodiscard]] inline std::array<double, 3> to_array(const glm::dvec3& p) {
  return {p.x, p.y, p.z};
}

}  // namespace ptc
