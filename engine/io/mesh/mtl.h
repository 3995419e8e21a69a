// Internal to the OBJ reader: material libraries. Source: Wavefront, "MTL material format", 1995.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "engine/io/mesh/mesh_soup.h"

namespace ptc {

/// Adds the materials of an MTL file, of which Kd, Ke, map_Kd and map_Ke are read. A material whose
/// name is already known is skipped: the first library that defines it wins.
/// @param materials  materials by name
/// @param textures   loads the textures of map_Kd and map_Ke
/// @param warnings   receives the parts that are left out
/// @throws DataError when the file cannot be read as lines of text; std::system_error
void read_mtl(const std::filesystem::path& path, TextureLoader& textures,
              std::map<std::string, Material>& materials, MeshWarnings& warnings);

}  // namespace ptc
