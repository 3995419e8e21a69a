// Sorted surfels to a container: point pages, octree, node pages.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/file/state_file.h"
#include "engine/sort/external_sort.h"
#include "engine/store/writer.h"

namespace ptc {

struct BuildOptions {
  std::uint32_t leaf_points = 16;  ///< a cell with no more points is not split, 1 to kMaxLeafPoints
  /// Levels of groups that share a stream of node pages: 1 keeps each level to itself, 63 puts all
  /// in the order in which they are finished, which is depth-first (spec/nodes.md#page-order).
  int levels_per_stream = 1;
};

/// Where a build is: between two points.
struct BuildPlace {
  std::uint64_t points = 0;  ///< taken from the stream
  MortonKey last_key;        ///< of the last of them
};

/// For a build that can be interrupted.
struct Checkpoints {
  /// Points between two checkpoints at the least, and at most those that build_pages() takes at
  /// once more.
  std::uint64_t interval = std::uint64_t{1} << 22;
  /// Takes what another build needs to go on from there, beside ContainerWriter::state(); null:
  /// there are no checkpoints.
  std::function<void(const BuildPlace& at, std::vector<std::byte> state)> save;
  /// Such a state to begin with; the stream and the writer have gone on from there, too. Null: from
  /// the first point on.
  StateReader* from = nullptr;
};

/// Writes the pages of all points and nodes in one pass.
/// @param points  ascending keys in the lattice of the writer's frame
/// @throws DataError, FormatError for a state that is none
/// @return  the superblock for ContainerWriter::finish(), its counts, bounds and totals filled
/// Memory: one open page per stream; of 65,536 points, or a page of them if that is more, the
/// records twice, and their pages and nodes three times, some 20 MB in all.   Deterministic for any
/// number of threads.
[[nodiscard]] Superblock build_pages(PointStream& points, ContainerWriter& writer,
                                     const BuildOptions& options, const Executor& executor,
                                     Progress& progress, const Checkpoints& checkpoints = {});

}  // namespace ptc
