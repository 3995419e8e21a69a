// Loads the meshes of a request, for sampling and for rendering.
#pragma once

#include <filesystem>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"

namespace ptc {

/// Reads meshes and joins them into one. Clouds among the inputs are skipped.
/// @param also      a mesh in memory, joined after those of the inputs; null: none
/// @param backdrop  sets the meshes on a ground in front of a red wall
/// @param progress  gets the warnings of each file as notes that begin with its name
/// @param cameras   gets the cameras of the files, in their order; may be null
/// @return          the joined mesh; without triangles when there is none to read
/// @param field     the member of the request that names the inputs, for errors
/// @throws DataError for a file that breaks its format; RequestError when check_mesh() refuses
///         `also` or the joined mesh, or append_mesh() refuses to join them; std::system_error
[[nodiscard]] Mesh load_meshes(const std::vector<std::filesystem::path>& inputs, const Mesh* also,
                               bool backdrop, Progress& progress,
                               std::vector<MeshCamera>* cameras = nullptr,
                               const char* field = "inputs");

/// Returns the box around a mesh of load_meshes() that has a backdrop, without the backdrop.
[[nodiscard]] Bounds bounds_before_backdrop(const Mesh& mesh);

}  // namespace ptc
