// Sorted surfels to a container: point pages, octree, node pages.
#pragma once

#include <cstdint>

#include "engine/base/progress.h"
#include "engine/sort/external_sort.h"
#include "engine/store/writer.h"

namespace ptc {

struct BuildOptions {
  std::uint32_t leaf_points = 16;  ///< a cell with no more points is not split, 1 to kMaxLeafPoints
  /// Levels of groups that share a stream of node pages: 1 keeps each level to itself, 63 puts all
  /// in the order in which they are finished, which is depth-first (spec/nodes.md#page-order).
  int levels_per_stream = 1;
};

/// Writes the pages of all points and nodes in one pass.
/// @param points  ascending keys in the lattice of the writer's frame
/// @return  the superblock for ContainerWriter::finish(), its counts, bounds and totals filled
/// Memory: one open page per stream; of 65,536 points, or a page of them if that is more, the records twice, and their
/// pages and nodes three times, some 20 MB in all.   Deterministic for any number of threads.
[[nodiscard]] Superblock build_pages(PointStream& points, ContainerWriter& writer, const BuildOptions& options,
                                     const Executor& executor, Progress& progress);

}  // namespace ptc
