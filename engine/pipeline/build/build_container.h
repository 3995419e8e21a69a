// Builds containers: the entry point of the library that makes a .ptcx from meshes and clouds.
//
//   meshes ---- sample, light ---.
//   clouds ---- read ------------+--> external sort ----> octree, pages ----> target.ptcx
//   city ------ generate --------'    by Morton key       in one pass         published by rename
//
// Memory stays within a cap however many points and triangles there are: what does not fit goes
// through temporary files. The result depends on the request alone, not on the number of threads or
// the directories, and on the cap only where meshes do not fit (RunOptions).
//
//   ptc::BuildRequest request;
//   request.inputs = {"dragon.obj"};
//   request.run.memory_bytes = 1 << 30;
//   ptc::Progress silent;
//   const ptc::BuildReport report = ptc::build_container(request, "dragon.ptcx", silent);
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"
#include "engine/octree/build_pages.h"
#include "engine/octree/rounding.h"
#include "engine/pipeline/build/build_space.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/run.h"
#include "engine/pipeline/selection.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/sort/external_sort.h"

namespace ptc {

/// Everything that the bytes of a container follow from, and the resources for building it.
///
/// Surfels come from `inputs` and `mesh` together, or from `city_points`. Meshes are sampled and
/// lit; clouds keep their own points and the light that their files give them, unless `lights` or
/// meshes bring them other.
struct BuildRequest {
  /// Mesh files, clouds and containers, in any mixture. Normals and radii that a cloud lacks are
  /// estimated. Containers give their points with all channels, and without `lights` their lights.
  std::vector<std::filesystem::path> inputs;
  /// What the container records as the names of the inputs; empty: their file names.
  std::string input_names;
  /// A mesh in memory, added to those of `inputs`; null: none. Excludes `resume`.
  std::shared_ptr<const Mesh> mesh;
  /// Number of points of the procedural city, which is built in place of inputs; 0: no city.
  std::uint64_t city_points = 0;
  /// A container to which the inputs are appended; empty: none. Its points keep their order and are
  /// not sorted again. They keep their light unless lamps of either side would light the points of
  /// one side alone (spec/shading.md#mixed-light). The cube of the scene doubles until it holds all
  /// points; if it does, the old points move by less than one unit of the new lattice. The lights
  /// that the container records replace `lights`. Excludes `city_points`; it may be the target
  /// itself, except with `resume`.
  std::filesystem::path append;
  /// Records the place that each point had in its input, as the channel original_index, so that
  /// points can be written in that order again.
  bool original_order = false;
  /// Which points of the clouds and containers among the inputs are taken, and which channels.
  Selection selection;
  /// The axis that points up, "x", "y" or "z"; empty: what the inputs say, else y.
  std::string up;
  bool remove_duplicates = false;  ///< of points at one position keeps the first
  bool backdrop = false;           ///< sets the meshes on a ground in front of a red wall
  bool one_sided = false;          ///< only fronts reflect in mesh formats that know no sides
  /// When inputs that move are shown, as for MeshChoice. Excludes `resume`.
  std::optional<Moment> moment{};
  /// Lights of the meshes, and the sky that lights what is shaded later. Empty: those that
  /// files of meshes define, else default_rig() for meshes, but no lights at all when one of them
  /// emits light; cloud_rig() for clouds without radiance alone.
  std::optional<LightRig> lights;
  SamplingOptions sampling;            ///< how densely meshes are sampled, and with how many rays
  BuildOptions tree;                   ///< the octree's leaves and the order of its pages
  std::uint8_t page_shift = 16;        ///< a page has 2^page_shift bytes, 12 to 20
  Profile profile = Profile::compact;  ///< how points are rounded and compressed
  /// Notes which records of a LAS file the container leaves out. Whoever writes them elsewhere,
  /// from BuildReport::las_records, needs no note.
  bool note_lost_records = true;
  /// Continues an interrupted build of the same request, and leaves files from which another build
  /// can continue if this one is interrupted in turn. Once the points are sorted, an interruption
  /// costs `checkpoint_points` of them and the block that is being built; before that, the sort
  /// starts again. All points go to temporary files, even if memory would hold them.
  bool resume = false;
  /// Number of points between two checkpoints of a build with `resume`, 1 or more.
  std::uint64_t checkpoint_points = std::uint64_t{1} << 22;
  RunOptions run;  ///< memory, threads and temporary directories
};

/// The result of a build, and what it cost.
struct BuildReport {
  Superblock superblock;             ///< of the published container: counts, bounds and totals
  std::uint64_t resumed_points = 0;  ///< points that an interrupted build had built before
  BuildSpace space;                  ///< bytes on the disks, estimated before the build
  SortStatistics sort;               ///< points that were sorted and bytes that were spilled
  /// The text `las.vlrs` of the inputs with the records that the container leaves out, too; empty
  /// when they have none, or when the build continues an interrupted one.
  std::string las_records;
  bool streamed = false;  ///< whether the meshes did not fit in memory
  StageSeconds seconds;   ///< wall time of each stage
};

/// Builds a container and publishes it under the name `target`.
///
/// The stages are: sample and light the meshes, read the clouds, sort everything by Morton key,
/// build the octree, write the pages. The same request gives the same bytes for any number of
/// threads and any memory cap. The target appears, or is replaced, whole and at the very end; a
/// build that throws leaves it as it was.
/// @param progress  gets the stages, warnings about the inputs and, when points go through
///                  temporary files, a note with the disk space that this takes
/// @throws RequestError when the request contradicts itself or a setting is out of range;
///         LimitError when the memory cap is too small: the text names the least that works;
///         DataError, FormatError for an input that is not what its format requires, and for files
///         of an interrupted build that are damaged or belong to another request;
///         std::system_error when the system refuses: ENOSPC before the build when the disks have
///         too little room, EFBIG as fail_write() says
/// Memory: at most RunOptions::memory_bytes.
BuildReport build_container(const BuildRequest& request, const std::filesystem::path& target,
                            Progress& progress);

}  // namespace ptc
