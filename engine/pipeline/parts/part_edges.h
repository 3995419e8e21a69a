// The edges of a part's tree, in a file beside the part.
//
//   city.0.ptcx         the part
//   city.0.ptcx.edges   its edges: some 50 KB; gone, they are found again from all of its points
#pragma once

#include <filesystem>

#include "engine/base/executor.h"
#include "engine/octree/tree_edges.h"
#include "engine/store/reader.h"

namespace ptc {

/// Returns the name of the file that holds the edges of a part.
[[nodiscard]] std::filesystem::path edges_path(const std::filesystem::path& part);

/// Writes the edges of a part, whole or not at all, tied to it by the checksum of its superblock.
/// @throws FormatError when the part is damaged; std::system_error
void write_edges(const std::filesystem::path& part, const TreeEdges& edges);

/// Removes a part and its edges, as far as they are there. @throws std::system_error
void remove_part(const std::filesystem::path& part);

/// Reads the edges of a part from the file beside it, or finds them from its points where there is
/// no such file, or one of another part.
/// @param part  has at least one point
/// @throws DataError when the file is damaged; FormatError when a page of the part is;
///         std::system_error
/// Memory: a page, 200 bytes for each of 65,536 points, and the edges.
[[nodiscard]] TreeEdges edges_of(const ContainerReader& part, const Executor& executor);

/// Finds the edges of a container from its points.
[[nodiscard]] TreeEdges find_edges(const ContainerReader& part, const Executor& executor);

}  // namespace ptc
