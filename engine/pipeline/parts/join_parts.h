// Joins containers to a scene of parts (spec/parts.md).
//
//   city.0.ptcx  city.1.ptcx  ...     one after another along the curve, in one frame
//        |            |
//      edges        edges  ...   ->   city.ptcx: the top of the tree, and the names of the parts
#pragma once

#include <filesystem>
#include <span>

#include "engine/base/progress.h"
#include "engine/pipeline/run.h"
#include "format/container.h"

namespace ptc {

/// Writes the scene file over parts, which stay as they are. The tree is, to the last bit, that of
/// one file with all points. Texts that all parts record alike are those of the scene; a note names
/// the others.
/// @param parts   in the order of the curve; at least one, each with at least one point. They lie
///                in the folder of the target or below it
/// @param target  appears, or is replaced, whole and at the very end
/// @return  the superblock of the scene
/// @throws RequestError when there are no parts, or one lies elsewhere; DataError when a part does
///         not follow the one before, has another frame, page size, leaf size or other channels, or
///         shares a leaf with the one before; FormatError when a part is damaged; std::system_error
/// Memory: the directory of the largest part, and some 12 KB for each part.
Superblock join_parts(std::span<const std::filesystem::path> parts,
                      const std::filesystem::path& target, const RunOptions& run,
                      Progress& progress);

}  // namespace ptc
