// The two parts of a scene that moves, which are built apart: what stands still, once, and for each
// moment what moves.
//
//   still parts ---- sample, light ---> container ---- light anew ----.
//                                                                     +---> container of
//   moving parts -------------------- sample, light, sort, merge -----'     a moment
//
// The container of a moment follows from the request and the moment alone: what the container of
// the still parts follows from besides is its basis, and one with another basis is built again.
#pragma once

#include <optional>
#include <stdexcept>

#include "engine/base/executor.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/build_inputs.h"
#include "format/container.h"

namespace ptc {

/// The part of a scene that a build makes, and the numbers that both parts have in common.
struct ScenePart {
  Motion motion = Motion::still;
  /// Distance between neighbouring surfels of both parts, as the scene at rest has it, scene units.
  /// 0: a build of the still parts finds it.
  double spacing = 0;
  /// What the light and the sides of the still parts follow from. A build of the still parts sets
  /// it; one of the moving parts throws BasisDiffers when its moment has another.
  std::optional<Uuid> basis{};
};

/// Thrown when the container of the still parts is not that of the moment: lights moved, or what is
/// closed holds something else.
class BasisDiffers : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Thrown when a scene has to be built as a whole: nothing stands still or nothing moves, the
/// meshes do not fit in memory, or what moves is too far away for the lattice.
class IsOneWhole : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Says whether a request may be built in parts, as far as it shows without a look at the meshes:
/// it has neither clouds nor a backdrop, which stands around all.
[[nodiscard]] bool may_have_parts(const BuildRequest& request);

/// Builds a part of a scene. That of the moving parts is the container of the moment: the request
/// appends to the container of the still parts.
/// @param part  of the request's moment
/// @throws BasisDiffers, IsOneWhole; as build_container()
BuildReport build_part(const BuildRequest& request, ScenePart& part,
                       const std::filesystem::path& target, Progress& progress);

/// Reads the meshes of a part. Those of the moving parts hold the whole scene, of which the
/// triangles from LitMesh::first on are sampled.
/// @throws BasisDiffers, IsOneWhole; as read_inputs()
[[nodiscard]] BuildInputs read_part(const BuildRequest& request, ScenePart& part,
                                    const MeshLimits& limits, const Executor& executor,
                                    StageSeconds& seconds, Progress& progress);

}  // namespace ptc
