// Inside the OBJ reader: material libraries. Source: Wavefront, "MTL material format", 1995.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "engine/io/mesh/mesh_soup.h"

namespace ptc {

/// Adds the materials of an MTL file: Kd, Ke and map_Kd. A material of a known name is passed over:
/// the first library that defines it wins.
/// @throws DataError, std::system_error
void read_mtl(const std::filesystem::path& path, TextureLoader& textures,
              std::map<std::string, Material>& materials, MeshWarnings& warnings);

}  // namespace ptc
