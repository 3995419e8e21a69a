// Inside the whole-file check: points and nodes, depth first.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/progress.h"
#include "engine/store/reader.h"
#include "engine/verify/finding.h"

namespace ptc {

struct TreeCounts {
  std::uint64_t nodes = 0;
  std::uint64_t groups = 0;
  int levels = 0;
  bool complete = true;  ///< false when something was passed over: sums over it are not known
};

/// Walks the octree from its root and the points in their order, and checks order, references, sums
/// and the superblock's totals. What lies in or below damaged pages is passed over, and so are the
/// sums above it.
/// @param damaged       by page
/// @param cached_pages  node pages that are kept decoded, at least 1
/// Memory: a bit a group, 8 bytes a page, the cached pages, the points of one leaf.
TreeCounts verify_tree(const ContainerReader& container, const std::vector<bool>& damaged,
                       std::size_t cached_pages, Findings& findings, Progress& progress);

}  // namespace ptc
