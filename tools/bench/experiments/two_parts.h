// A small scene of parts, for changes to its files.
#pragma once

#include <array>
#include <filesystem>

#include "engine/store/reader.h"

namespace ptc::bench {

/// Writes the points of a container as a scene of two parts (spec/parts.md) with the same tree. The
/// points are cut in the middle of the children of the root group, so that this group is the whole
/// top.
/// @param whole  without channels; each half of the root's children has at least two
/// @param scene  its file
/// @param parts  their files, in the folder of the scene
/// @throws DataError when the container cannot be cut there; std::system_error
void write_two_parts(const ContainerReader& whole, const std::filesystem::path& scene,
                     const std::array<std::filesystem::path, 2>& parts);

}  // namespace ptc::bench
