// The last level of the whole-file check: the stored tree against the tree that this program builds
// from the same points.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/store/reader.h"
#include "engine/verify/finding.h"

namespace ptc {

/// Builds the octree again and compares it with the stored one, group by group and bit by bit,
/// except for the pages that groups lie in. A tree that differs is damage when this version of the
/// program wrote the file, otherwise a warning: other writers may round differently.
/// @param container     one whose tree verify_tree() found complete
/// @param cached_pages  node pages that are kept decoded, at least 1
/// @return  the digest of the stored tree (spec/nodes.md#tree-digest)
/// @throws FormatError, std::system_error
/// Memory: the cached pages, and what OctreeBuilder takes.
[[nodiscard]] std::array<std::uint64_t, 2> compare_rebuilt(const ContainerReader& container,
                                                           std::size_t cached_pages,
                                                           Findings& findings,
                                                           const Executor& executor,
                                                           Progress& progress);

}  // namespace ptc
