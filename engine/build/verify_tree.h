// Inside the whole-file check: points and nodes, depth first.
#pragma once

#include <cstdint>

#include "engine/base/progress.h"
#include "engine/store/reader.h"

namespace ptc {

struct TreeCounts {
  std::uint64_t nodes = 0;
  std::uint64_t groups = 0;
  int levels = 0;
};

/// Walks the octree from its root and the points in their order, and checks order, references, sums
/// and the superblock's totals.
/// @param cached_pages  node pages that are kept decoded, at least 1
/// @throws FormatError for the first broken rule
/// Memory: a bit a group, 8 bytes a page, the cached pages, the points of one leaf.
TreeCounts verify_tree(const ContainerReader& container, std::size_t cached_pages,
                       Progress& progress);

}  // namespace ptc
