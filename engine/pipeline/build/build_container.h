// Builds containers: meshes, clouds or a procedural city to sorted, lit surfels under an octree.
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
#include "engine/pipeline/run.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/sort/external_sort.h"

namespace ptc {

struct BuildRequest {
  std::vector<std::filesystem::path> inputs;  ///< meshes and clouds
  std::shared_ptr<const Mesh> mesh;           ///< a mesh in memory, beside those of the inputs
  std::uint64_t city_points = 0;              ///< the procedural city instead of inputs
  /// A container to which the inputs are added: its points keep what they are, their order and
  /// their lights, and are not sorted again. The cube doubles until it holds all; then its points
  /// move by less than a unit of the new lattice.
  std::filesystem::path append;
  bool backdrop = false;           ///< sets the meshes on a ground before a red wall
  std::optional<LightRig> lights;  ///< of the meshes (clouds come lit); empty: a default_rig()
                                   ///< unless a mesh emits light
  SamplingOptions sampling;
  BuildOptions tree;
  std::uint8_t page_shift = 16;
  Profile profile = Profile::compact;
  /// Goes on where a build of the same request ended, however it did, and leaves what another needs
  /// to do so unless it comes to its end. Once the points are sorted, no more than
  /// `checkpoint_points` of them and what is taken at once is built again; a sort that did not come
  /// to its end begins anew. All points go to temporary files, even if memory would hold them.
  bool resume = false;
  std::uint64_t checkpoint_points = std::uint64_t{1} << 22;
  RunOptions run;
};

struct BuildReport {
  Superblock superblock;
  std::uint64_t resumed_points = 0;  ///< of an earlier build
  BuildSpace space;
  SortStatistics sort;
  StageSeconds seconds;
};

/// Samples and lights meshes, reads clouds, sorts, builds the octree and publishes the container.
/// The same request gives the same bytes for any number of threads and any cap. Notes what it takes
/// on the disk when it is known beforehand that the points go through temporary files, and refuses
/// it when there is no room.
/// @throws DataError for bad input and for what an earlier build left when it is damaged or of
///         another request; RequestError for a request that cannot be fulfilled; LimitError for a
///         cap that is too small (the text names the least that works); std::system_error, also
///         when a file may not grow so large: see fail_write() of limits on the size of files
BuildReport build_container(const BuildRequest& request, const std::filesystem::path& target,
                            Progress& progress);

}  // namespace ptc
