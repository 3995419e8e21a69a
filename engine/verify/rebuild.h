// Inside the whole-file check: the tree that this program builds from the points of a file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/store/reader.h"
#include "engine/verify/finding.h"

namespace ptc {

/// Builds the octree again and compares it with the stored one group by group, every bit but where
/// pages lie. A tree that differs is damage when this version of the program wrote it, else a
/// warning: other writers round as they may.
/// @param container  whose tree verify_tree() found whole
/// @return  the digest of the stored tree (spec/nodes.md#tree-digest)
/// Memory: the cached pages, and what OctreeBuilder takes.
[[nodiscard]] std::array<std::uint64_t, 2> compare_rebuilt(const ContainerReader& container,
                                                           std::size_t cached_pages,
                                                           Findings& findings,
                                                           const Executor& executor,
                                                           Progress& progress);

}  // namespace ptc
