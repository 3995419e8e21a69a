// Scene files: small JSON that says which meshes and clouds stand where, with materials, lights and
// a camera (spec/guide/scenes.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// A mesh or a cloud of a scene.
struct SceneObject {
  std::filesystem::path file;
  std::vector<Placement> places;     ///< empty: it stands where its file says
  std::optional<Material> material;  ///< takes the place of those of a mesh
  bool one_sided = false;            ///< as for MeshRoom
  bool moves = false;                ///< whether it has several keys
};

/// A moment of a sequence, at which scenes that move are shown.
struct Moment {
  double frame = 1;    ///< of keys in scene files
  double seconds = 0;  ///< of animations in mesh files
};

/// A camera of a scene, which may move.
struct SceneCamera {
  std::string name;  ///< may be empty
  /// Where it stands at some frames, in their order; at least one.
  std::vector<std::pair<double, Camera>> keys;

  /// Returns the camera at a frame: between two keys their mean, weighted by how near they are;
  /// before the first or after the last it stands still.
  [[nodiscard]] Camera at(double frame) const;
};

/// The content of scene files, and of other files beside them.
struct SceneObjects {
  /// In the order of the files; those of a scene file that differ in their places alone are one,
  /// but for those that move, which are another.
  std::vector<SceneObject> objects;
  std::optional<LightRig> lights;  ///< of the first file that has any; its sky's map is not read
  std::vector<std::filesystem::path> named;  ///< all files that scene files name
  bool moves = false;                        ///< whether an object has keys
  std::vector<SceneCamera> cameras;          ///< of scene files
};

/// Says whether a name is that of a scene file: whether it ends in .scene.json.
[[nodiscard]] bool is_scene_file(const std::filesystem::path& path);

/// Returns the objects of files: those that scene files name, and other files themselves.
/// @param textures      reads the textures of materials; null: they are left out
/// @param memory_bytes  cap on the memory of the JSON, and on that of the places
/// @param moment        where objects with keys stand; empty: at their first key
/// @throws DataError for a scene file that breaks its format, which names the member that is wrong;
///         LimitError for one that takes more memory; std::system_error
[[nodiscard]] SceneObjects read_scene_objects(const std::vector<std::filesystem::path>& files,
                                              TextureStore* textures, std::uint64_t memory_bytes,
                                              const std::optional<Moment>& moment = {});

/// Returns the files of the objects of files, without a look at their places.
/// @throws as read_scene_objects()
[[nodiscard]] std::vector<std::filesystem::path> object_files(
    const std::vector<std::filesystem::path>& files,
    std::uint64_t memory_bytes = std::numeric_limits<std::uint64_t>::max());

/// Returns a camera as those of mesh files are, which keep their horizontal angle.
[[nodiscard]] MeshCamera mesh_camera(const std::string& name, const Camera& camera);

/// Returns lights that stand in another place, with the sky turned as well. Their intensities stay.
[[nodiscard]] LightRig placed_lights(LightRig rig, const Placement& place);

}  // namespace ptc
