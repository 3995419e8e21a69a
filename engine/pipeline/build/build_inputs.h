// What a build is made from: meshes, clouds or the city, measured, then moved into the sort.
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
  Bounds bounds;
  std::vector<glm::dvec3> sample;
  std::uint64_t points = 0;
  bool estimate_radii = false;

  /// @throws DataError when the points have no normals
  void measure(const std::filesystem::path& path, Progress& progress);
};

/// The meshes of a request under rays and light; gone before the sort needs its memory.
struct LitMesh {
  LitMesh(Mesh m, const LightRig& lights) : mesh(std::move(m)), rays(mesh), light(rays, lights) {}

  Mesh mesh;
  RayScene rays;
  DirectLight light;
};

/// What a build is made from, and what the sort must know of it beforehand.
struct BuildInputs {
  Bounds bounds;
  std::vector<glm::dvec3> sample;  ///< places, for splitters
  Clouds clouds;
  LightRig lights;
  bool emitters = false;         ///< among the triangles
  std::unique_ptr<LitMesh> lit;  ///< null without triangles
};

/// Reads and measures what is asked for. @throws DataError, std::system_error
[[nodiscard]] BuildInputs read_inputs(const BuildRequest& request, StageSeconds& seconds,
                                      Progress& progress);

/// Moves all surfels into the sort; meshes are sampled and lit, and gone afterwards.
/// @return  the spacing of those on meshes, 0 without @throws DataError when a file changed since
/// it was read
double feed_inputs(BuildInputs& inputs, const BuildRequest& request, const Frame& frame,
                   ExternalSorter& sorter, const Executor& executor, Progress& progress);

[[nodiscard]] inline std::array<double, 3> to_array(const glm::dvec3& p) {
  return {p.x, p.y, p.z};
}

}  // namespace ptc
