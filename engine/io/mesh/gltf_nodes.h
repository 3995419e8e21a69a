// Internal to the glTF reader: where the nodes of a file put meshes, cameras and lights.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/io/mesh/gltf_document.h"
#include "engine/io/mesh/mesh.h"
#include "engine/io/mesh/mesh_warnings.h"

namespace ptc {

/// A mesh, by its index in the file, in one place. The place may flatten it.
struct GltfUse {
  std::uint64_t mesh;
  std::uint64_t node;  ///< that shows it
  Placement place;
};

/// What the nodes of the default scene show, parents before their children; of a file without
/// scenes, what all nodes show.
struct GltfNodes {
  std::vector<GltfUse> uses;
  std::vector<MeshCamera> cameras;  ///< world coordinates
  std::vector<MeshLight> lights;    ///< world coordinates
  bool moves_mesh = false;          ///< as MeshFile
  double animation_seconds = 0;     ///< as MeshFile
};

/// What to look for among the nodes.
enum class GltfSearch : std::uint8_t { all, cameras };

/// Walks through the nodes, and through the instances that they show.
/// @param search        with `cameras` there are no uses and no lights, nor are they checked
/// @param seconds       time at which animations are shown, as MeshRoom::seconds
/// @param part          which nodes show their meshes and lights
/// @param memory_bytes  cap on the memory of the uses, and of what comes of them
/// @param warnings      receives cameras, lights and animations that are left out
/// @throws DataError when a node breaks a rule; LimitError for more instances than memory holds
[[nodiscard]] GltfNodes walk_gltf_nodes(GltfDocument& document, GltfSearch search,
                                        std::optional<double> seconds, Motion part,
                                        std::uint64_t memory_bytes, MeshWarnings& warnings);

}  // namespace ptc
