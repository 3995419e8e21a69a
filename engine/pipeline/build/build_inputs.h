// The inputs of a build: meshes, clouds or the city. They are measured first and then fed to the
// sort, because the sort needs the bounds and a sample of the points before the first of them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/error.h"
#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/io/cloud/points.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/build/still_light.h"
#include "engine/scan/scan.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"
#include "engine/scene/sampling/mesh_parts.h"
#include "engine/scene/sampling/placed_sampler.h"
#include "engine/scene/sampling/solids.h"
#include "engine/scene/sampling/streamed_sampler.h"
#include "engine/sort/external_sort.h"

namespace ptc {

/// Where the bounds of clouds come from. Those that a file says of itself save a pass over it; a
/// build that begins again because they were wrong takes those of the points.
enum class BoundsFrom { files, points };

/// Thrown when a point lies beyond the bounds that its file says. The build must measure the points
/// themselves.
class BoundsExceeded : public DataError {
 public:
  using DataError::DataError;
};

/// The clouds of a request, checked and measured in a first pass.
struct Clouds {
  struct Cloud {
    std::filesystem::path path;
    std::optional<Placement> place;  ///< none: the points stay where they are
    std::uint64_t points = 0;
    std::vector<Channel> channels;                ///< in the order of its rows
    std::vector<bool> taken;                      ///< as for AttributePlan::add_input()
    std::size_t input = AttributePlan::kNoInput;  ///< its number in the plan of the channels
    std::uint32_t first_scanner = kNoScanner;     ///< the number of the first of its scanners
    /// Where the number of its scanner lies in the row of a point, and its bytes; 0 bytes when all
    /// points are of the first.
    std::size_t scanner_offset = 0, scanner_bytes = 0;
    std::optional<Bounds> said;  ///< the box of PointSource::extent(), if the points were not read
  };
  std::vector<Cloud> files;
  Bounds bounds;                   ///< of all points, scene units
  std::vector<glm::dvec3> sample;  ///< positions of an even share of the points, scene units
  std::uint64_t sample_step = 1;   ///< of how many points one is in the sample
  std::uint64_t points = 0;        ///< in all files
  /// How the points are completed, without the resources; empty when all have normals and radii.
  std::optional<ScanOptions> scan;
  bool unlit = false;                ///< one of the files gives no radiance
  bool has_container = false;        ///< one of the files is a container
  bool has_lit_container = false;    ///< one of the files is a container whose points have light
  bool lights_differ = false;        ///< the files record different lights; the first ones count
  bool coloured = false;             ///< one of the files gives colours
  bool emits = false;                ///< a point emits light
  std::vector<glm::dvec3> scanners;  ///< of all files, scene units
  /// Facts about the files under the keys of spec/points.md#texts, by join_texts(). Of the records
  /// of a LAS file there are as many as a container keeps.
  std::map<std::string, std::string> text;
  std::map<std::string, std::string> named_by;  ///< by key of `text`: the file that it is of
  std::string las_records;  ///< all records of the LAS file, once shorten_records() has run

  /// Adds a cloud to the others, in a place. Reads it to its end, unless all that is asked stands
  /// in front of its points.
  /// @param alone  whether all points of the build are of this cloud, whose values need no watch
  /// @throws DataError when the file breaks its format; RequestError, FormatError as
  ///         open_point_input()
  void measure(const std::filesystem::path& path, const std::optional<Placement>& place,
               const Selection& selection, BoundsFrom from, bool alone, Progress& progress);

  /// Moves the records of a LAS file to `las_records`, and shortens them in `text` to what a
  /// container keeps.
  /// @param progress  gets a note about each kind of records that is left out
  void shorten_records(Progress& progress);

 private:
  void read_points(PointFile& file, bool alone, Cloud& cloud, Progress& progress);
  void note_scan(const PointFileInfo& info, Cloud& cloud);
};

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

/// What the sampling of meshes may use.
struct SamplingRoom {
  unsigned at_once = 0;     ///< patches of a mesh in memory, as for sample_mesh()
  StreamingRoom streaming;  ///< of meshes on the disk
};

/// Feeds the surfels of all inputs to the sort, and what is recorded of them beyond that to the
/// sorts of attributes. Meshes are sampled and lit on the way, and freed afterwards.
/// @param first  number of points that the container has before these
/// @param room    for sampling
/// @return  distance between neighbouring surfels on the meshes, scene units; 0 without meshes
/// @throws BoundsExceeded; DataError when a cloud changed since it was measured; std::system_error
double feed_inputs(BuildInputs& inputs, const BuildRequest& request, const Frame& frame,
                   std::uint64_t first, const SamplingRoom& room, ExternalSorter& sorter,
                   AttributeSorts& attributes, const Executor& executor, Progress& progress);

/// Returns the coordinates of a point as the array that Frame takes.
[[nodiscard]] inline std::array<double, 3> to_array(const glm::dvec3& p) {
  return {p.x, p.y, p.z};
}

}  // namespace ptc
