// Property, for any bytes as a scene file: it gives objects whose places can be inverted and whose
// materials are in range, or is refused by a DataError, or by std::system_error when a file that it
// names is missing.
//
// What follows the first zero byte becomes the file of places "a.txt" in the same directory.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <system_error>

#include "engine/base/error.h"
#include "engine/pipeline/build/scene_file.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

/// Checks a camera at its keys, between them and around them.
static void check_moving(const ptc::SceneCamera& camera) {
  ptc::fuzz::require(!camera.keys.empty());
  for (const auto& [frame, at_key] : camera.keys) {
    for (const double at : {frame - 0.5, frame, frame + 0.5}) {
      const ptc::MeshCamera seen = ptc::mesh_camera(camera.name, camera.at(at));
      ptc::fuzz::require(seen.horizontal_fov > 0 && seen.horizontal_fov < 3.1416F);
    }
  }
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ptc;
  using ptc::fuzz::require;
  std::span bytes(reinterpret_cast<const std::byte*>(data), size);
  std::optional<fuzz::MemoryFile> places;
  const auto zero =
      static_cast<std::size_t>(std::ranges::find(bytes, std::byte{0}) - bytes.begin());
  if (zero < bytes.size()) {
    places.emplace(bytes.subspan(zero + 1), "a.txt");
    bytes = bytes.first(zero);
  }
  const fuzz::MemoryFile file(bytes, "a.scene.json");
  try {
    const SceneObjects first = read_scene_objects({file.path()}, nullptr, 1 << 20);
    const SceneObjects scene =
        read_scene_objects({file.path()}, nullptr, 1 << 20, Moment{.frame = 3.75});
    require(scene.moves == first.moves && scene.named == first.named);
    for (const SceneObject& object : scene.objects) {
      require(!object.file.empty() && std::ranges::all_of(object.places, is_placement));
      if (!object.material) continue;
      for (int c = 0; c < 3; ++c)
        require(object.material->albedo[c] >= 0 && object.material->albedo[c] <= 1 &&
                object.material->emission[c] >= 0);
    }
    for (const SceneCamera& camera : scene.cameras) check_moving(camera);
  } catch (const DataError&) {
  } catch (const LimitError&) {
  } catch (const std::system_error&) {
  }
  return 0;
}
