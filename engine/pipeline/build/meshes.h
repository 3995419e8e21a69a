// The meshes of a request as they are sampled and rendered.
#pragma once

#include <filesystem>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"

namespace ptc {

/// Reads meshes and joins them to one; clouds among the inputs are passed over.
/// @param also      a mesh in memory that comes after those of the inputs, or null
/// @param backdrop  sets the meshes on a ground before a red wall
/// @param progress  gets the warnings of each file as notes that begin with its name
/// @param cameras   gets the cameras of the files; may be null
/// @throws DataError, std::system_error; RequestError as check_mesh() of `also`
[[nodiscard]] Mesh load_meshes(const std::vector<std::filesystem::path>& inputs, const Mesh* also,
                               bool backdrop, Progress& progress,
                               std::vector<MeshCamera>* cameras = nullptr);

}  // namespace ptc
