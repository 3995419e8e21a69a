// The whole-file check of points and nodes: walks through the tree, depth first, over all threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/store/reader.h"
#include "engine/verify/checked_pages.h"
#include "engine/verify/finding.h"

namespace ptc {

/// What a walk through the tree reached.
struct TreeCounts {
  std::uint64_t nodes = 0;   ///< children of all groups reached
  std::uint64_t groups = 0;  ///< groups reached
  int levels = 0;            ///< deepest level of a group reached, plus 1
  bool complete = true;      ///< false when a part was skipped, so that totals cannot be compared
};

/// What a check of the tree found.
struct CheckedTree {
  TreeCounts counts;
  Findings findings;
};

/// Memory of verify_tree().
struct TreeMemory {
  unsigned walks = 1;            ///< walks below groups at the same time, at least 1
  std::size_t cached_pages = 1;  ///< node pages that each walk keeps decoded, at least 1

  /// Divides memory among walks, as many as may be useful.
  /// @param bytes  at least least_bytes()
  [[nodiscard]] static TreeMemory divided(std::uint64_t bytes, const Superblock& superblock,
                                          unsigned threads) noexcept;
  /// Returns the least memory with which the tree can be checked.
  [[nodiscard]] static std::uint64_t least_bytes(const Superblock& superblock) noexcept;
};

/// Walks the octree from its root and the points in their order, and checks order, references, sums
/// and the superblock's totals. Whatever lies in or below damaged pages is skipped, and so are the
/// sums of the nodes above it. What is found does not depend on memory and threads.
/// @param damaged  by page number, whether the page is damaged
/// @param checked  remembers the pages that were read
/// @param before   what was found before; where it stops at the first damage, so does this
/// @throws FormatError when a page that is not damaged breaks a rule; std::system_error
/// Memory: one bit for each group, 8 bytes for each page, and what was divided.
[[nodiscard]] CheckedTree verify_tree(const ContainerReader& container,
                                      const std::vector<bool>& damaged, CheckedPages& checked,
                                      const TreeMemory& memory, const Findings& before,
                                      const Executor& executor, Progress& progress);

}  // namespace ptc
