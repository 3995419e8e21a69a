// Scene files: small JSON that says which meshes and clouds stand where, with materials, lights and
// a camera (spec/guide/scenes.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <vector>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// A mesh or a cloud of a scene.
struct SceneObject {
  std::filesystem::path file;
  std::vector<Placement> places;     ///< empty: it stands where its file says
  std::optional<Material> material;  ///< takes the place of those of a mesh
  bool one_sided = false;            ///< as for MeshRoom
};

/// The content of scene files, and of other files beside them.
struct SceneObjects {
  /// In the order of the files; those of a scene file that differ in their places alone are one.
  std::vector<SceneObject> objects;
  std::optional<LightRig> lights;  ///< of the first file that has any; its sky's map is not read
  std::vector<std::filesystem::path> named;  ///< all files that scene files name
  std::vector<MeshCamera> cameras;           ///< of all files
};

/// Says whether a name is that of a scene file: whether it ends in .scene.json.
[[nodiscard]] bool is_scene_file(const std::filesystem::path& path);

/// Returns the objects of files: those that scene files name, and other files themselves.
/// @param textures      reads the textures of materials; null: they are left out
/// @param memory_bytes  cap on the memory of the JSON, and on that of the places
/// @throws DataError for a scene file that breaks its format, which names the member that is wrong;
///         LimitError for one that takes more memory; std::system_error
[[nodiscard]] SceneObjects read_scene_objects(const std::vector<std::filesystem::path>& files,
                                              TextureStore* textures, std::uint64_t memory_bytes);

/// Returns the files of the objects of files, without a look at their places.
/// @throws as read_scene_objects()
[[nodiscard]] std::vector<std::filesystem::path> object_files(
    const std::vector<std::filesystem::path>& files,
    std::uint64_t memory_bytes = std::numeric_limits<std::uint64_t>::max());

/// Returns lights that stand in another place, with the sky turned as well. Their intensities stay.
[[nodiscard]] LightRig placed_lights(LightRig rig, const Placement& place);

}  // namespace ptc
