// Internal to the glTF reader: where the nodes of a file put meshes, cameras and lights.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/io/mesh/gltf_document.h"
#include "engine/io/mesh/mesh.h"
#include "engine/io/mesh/mesh_warnings.h"

namespace ptc {

/// A mesh, by its index in the file, in one place. The place may flatten it.
struct GltfUse {
  std::uint64_t mesh;
  Placement place;
};

/// What the nodes of the default scene show, parents before their children; of a file without
/// scenes, what all nodes show.
struct GltfNodes {
  std::vector<GltfUse> uses;
  std::vector<MeshCamera> cameras;  ///< world coordinates
  std::vector<MeshLight> lights;    ///< world coordinates
};

/// Walks through the nodes, and through the instances that they show.
/// @param memory_bytes  cap on the memory of the uses, and of what comes of them
/// @param warnings      receives cameras and lights that are left out
/// @throws DataError when a node breaks a rule; LimitError for more instances than memory holds
[[nodiscard]] GltfNodes walk_gltf_nodes(GltfDocument& document, std::uint64_t memory_bytes,
                                        MeshWarnings& warnings);

}  // namespace ptc
