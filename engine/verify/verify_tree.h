// The whole-file check of points and nodes: one walk through the tree, depth first.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/progress.h"
#include "engine/store/reader.h"
#include "engine/verify/finding.h"

namespace ptc {

/// What a walk through the tree reached.
struct TreeCounts {
  std::uint64_t nodes = 0;   ///< children of all groups reached
  std::uint64_t groups = 0;  ///< groups reached
  int levels = 0;            ///< deepest level of a group reached, plus 1
  bool complete = true;      ///< false when a part was skipped, so that totals cannot be compared
};

/// Walks the octree from its root and the points in their order, and checks order, references, sums
/// and the superblock's totals. Whatever lies in or below damaged pages is skipped, and so are the
/// sums of the nodes above it.
/// @param damaged       by page number, whether the page is damaged
/// @param cached_pages  node pages that are kept decoded, at least 1
/// @throws std::system_error
/// Memory: one bit for each group, 8 bytes for each page, the cached pages, the points of one leaf.
TreeCounts verify_tree(const ContainerReader& container, const std::vector<bool>& damaged,
                       std::size_t cached_pages, Findings& findings, Progress& progress);

}  // namespace ptc
