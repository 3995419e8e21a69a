// Builds a container from sorted surfels in one pass: point pages, octree, node pages.
//
//   PointStream -+-> point pages ------------------+-> PageOrder -> ContainerWriter
//                +-> OctreeBuilder -> groups ------+
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/base/stream.h"
#include "engine/io/file/state_file.h"
#include "engine/octree/tree_edges.h"
#include "engine/store/writer.h"
#include "format/point_record.h"

namespace ptc {

/// The shape of the octree and the order of its pages.
struct BuildOptions {
  std::uint32_t leaf_points = 16;  ///< a cell with no more points is not split, 1 to kMaxLeafPoints
  /// Levels of groups that share a stream of node pages: 1 keeps each level to itself, 63 puts all
  /// groups in the order in which they are finished, depth-first (spec/nodes.md#page-order).
  int levels_per_stream = 1;
};

/// How far a build got, between two points.
struct BuildPlace {
  std::uint64_t points = 0;  ///< points taken from the stream
  MortonKey last_key;        ///< key of the last point taken
};

/// Checkpoints of a build that can be interrupted and resumed.
struct Checkpoints {
  /// Fewest points between two checkpoints. There may be more, by up to one block of points that
  /// build_pages() takes at once.
  std::uint64_t interval = std::uint64_t{1} << 22;
  /// Receives, at each checkpoint, the state that another build needs to resume there, in addition
  /// to ContainerWriter::state(). Null: no checkpoints are made.
  std::function<void(const BuildPlace& at, std::vector<std::byte> state)> save;
  /// The state of a checkpoint to resume from; stream and writer must stand at the same place.
  /// Null: the build begins with the first point.
  StateReader* from = nullptr;
};

/// Returns the most memory of the node pages that build_pages() holds back, bytes.
[[nodiscard]] std::uint64_t held_pages_bytes(std::uint8_t page_shift) noexcept;

/// Writes the pages of all points and nodes in one pass. The result is the same for any number of
/// threads.
/// @param points  ascending keys in the lattice of the writer's frame
/// @param edges   gets the edges of the tree, when there is a point; excludes `checkpoints`. Null:
///                nobody needs them
/// @return  the superblock for ContainerWriter::finish(), with counts, bounds and totals filled in
/// @throws DataError, FormatError when the state to resume from is invalid;
///         std::invalid_argument when a point emits light and WriterOptions::point_bytes is
///         kPointBytes; and what stream and writer throw
/// Memory: held_pages_bytes(), and one open page for each stream. In addition, for a block of
/// 65,536 points (or one page of points if that is more), the records twice and their pages and
/// nodes three times: some 20 MB in all.
[[nodiscard]] Superblock build_pages(PointStream& points, ContainerWriter& writer,
                                     const BuildOptions& options, const Executor& executor,
                                     Progress& progress, const Checkpoints& checkpoints = {},
                                     TreeEdges* edges = nullptr);

}  // namespace ptc
