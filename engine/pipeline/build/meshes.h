// Loads the meshes of a request, for sampling and for rendering.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/scene/sampling/mesh_parts.h"

namespace ptc {

/// The memory that meshes may take, and where those go that take more.
struct MeshLimits {
  /// Cap while meshes are read, bytes.
  std::uint64_t reading = std::numeric_limits<std::uint64_t>::max();
  /// Cap of meshes that stay in memory although all of them do not fit, bytes.
  std::uint64_t kept = std::numeric_limits<std::uint64_t>::max();
  /// Cap of the meshes and of what rays at them and their sampling need, bytes.
  std::uint64_t traced = std::numeric_limits<std::uint64_t>::max();
  /// Cap of the textures, as a TextureStore takes it, bytes.
  std::uint64_t textures = std::numeric_limits<std::uint64_t>::max();
  std::filesystem::path temp_directory = ".";
};

/// What is done with the meshes of a request.
struct MeshChoice {
  bool backdrop = false;   ///< sets them on a ground in front of a red wall
  bool one_sided = false;  ///< as for MeshRoom
  /// When scenes that move are shown; empty: scene files at their first keys, and mesh files
  /// without their animations.
  std::optional<Moment> moment{};
  /// Which of the objects of scene files, and of the nodes of mesh files, are loaded. The mesh in
  /// memory stands still.
  Motion part = Motion::any;
};

/// The meshes of a request.
struct LoadedMeshes {
  Mesh mesh;  ///< all of them, joined; without triangles when there is none, or when `parts` has
              ///< them
  std::vector<MeshLight> lights;     ///< of the files, in their order
  std::unique_ptr<MeshParts> parts;  ///< all of them, where they do not fit in memory; else null
  std::uint64_t traced_bytes = 0;    ///< what counts towards MeshLimits::traced

  [[nodiscard]] bool empty() const noexcept { return mesh.triangles.empty() && !parts; }
};

/// Reads meshes and those of scene files, and joins them into one. Clouds are skipped. Meshes that
/// take more memory than they may, to be read and to be traced by rays, are left on the disk.
/// @param also      a mesh in memory, joined after those of the inputs; null: none
/// @param limits    of all meshes together
/// @param progress  gets the warnings of each file as notes that begin with its name
/// @param field     the member of the request that names the inputs, for errors
/// @throws DataError for a file that breaks its format; RequestError when check_mesh() refuses
///         `also` or the joined mesh, or append_mesh() refuses to join them; std::system_error
[[nodiscard]] LoadedMeshes load_meshes(const std::vector<std::filesystem::path>& inputs,
                                       const Mesh* also, const MeshChoice& choice,
                                       const MeshLimits& limits, Progress& progress,
                                       const char* field = "inputs");

/// Returns the cameras of mesh and scene files at a moment: those of scene files, then those of
/// mesh files, once for each place of the file.
/// @param moment        as for MeshChoice
/// @param memory_bytes  cap on the memory while a file is read
/// @throws DataError, LimitError, std::system_error
[[nodiscard]] std::vector<MeshCamera> file_cameras(
    const std::vector<std::filesystem::path>& files, const std::optional<Moment>& moment = {},
    std::uint64_t memory_bytes = std::numeric_limits<std::uint64_t>::max());

/// Says whether an object of files moves, by its keys or by an animation of its file.
/// @throws as file_cameras()
[[nodiscard]] bool objects_move(const std::vector<std::filesystem::path>& files,
                                std::uint64_t memory_bytes);
/// Says whether cameras of files may move. @throws as file_cameras()
[[nodiscard]] bool cameras_may_move(const std::vector<std::filesystem::path>& files,
                                    std::uint64_t memory_bytes);

/// Returns the box around a mesh of load_meshes() that has a backdrop, without the backdrop.
/// @pre the mesh is in memory
[[nodiscard]] Bounds bounds_before_backdrop(const Mesh& mesh);

}  // namespace ptc
