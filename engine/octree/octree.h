// Builds the octree over sorted surfels, bottom-up in one pass.
//
// Points in Morton order visit the cells of the octree in depth-first order, so that a cell is
// complete as soon as a point outside it arrives. Only the cells around the current point are open,
// one for each level:
//
//   points   | p0 p1 p2 | p3 p4 | p5 ... p9 | p10 ->         arriving
//   cells    [ piece 0  ][piece 1][ piece 2 ]                small enough for one thread each
//   path_     root > ... > cell that holds pieces 1 and 2    open; closed when p10 lies outside
//
// Pieces are built side by side by the threads of an executor. What joins them, from the pieces up
// to the root, is done by one thread in their order, so the result does not depend on the threads.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/io/file/state_file.h"
#include "engine/octree/node_state.h"
#include "engine/octree/subtree.h"
#include "engine/octree/tree_edges.h"
#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// Receives finished sibling groups in post-order: each group after the groups of its children.
class GroupSink {
 public:
  virtual ~GroupSink() = default;
  /// Takes a group.
  /// @param group  the group as it lies in a page, with the references that add() returned for the
  ///               groups of its children; valid during the call
  /// @param end    number after the last point of the group
  /// @return  an interior reference to the group
  virtual ChildRef add(const GroupView& group, std::uint64_t end) = 0;
};

/// Builds the octree of surfels that arrive in Morton order (Kontkanen et al. 2011, restated in
/// Fischer et al. 2024). Cells of a few thousand points are built in parallel; the cells around
/// them are closed as their children are done.
///
/// A cell is split while it holds more than `leaf_points` points. A chain of cells with one
/// occupied child each becomes a single node, which stands for the smallest cell that holds its
/// points. Cells of coincident points are split by rank, below the lattice. Sums follow the order
/// of the tree, so they depend on the points alone.
///
/// Memory: some 100 bytes for each point of one call of add(), for the point and its groups. Of all
/// earlier points, one open cell for each level with at most 8 closed children, and the points of
/// an unfinished piece, at most the greater of kSubtreePoints and leaf_points.
class OctreeBuilder {
 public:
  /// The most points of a cell that is built by one thread, unless leaf_points is more.
  static constexpr std::uint32_t kSubtreePoints = 4096;

  /// @param leaf_points  1 to kMaxLeafPoints
  /// @param unit         lattice unit in scene units
  OctreeBuilder(GroupSink& sink, std::uint32_t leaf_points, double unit, const Executor& executor);

  /// Adds points, and hands all groups that are finished to the sink.
  /// @param points  ascending keys, none below a key added before
  void add(std::span<const PointRecord> points);

  /// Saves the state between two calls of add(), for a builder with the same arguments.
  void save(StateWriter& state) const;
  /// Resumes from a saved state, before the first call of add().
  /// @param knows  whether a page may be one that the sink returned
  /// @throws DataError, FormatError when the state is invalid
  void load(StateReader& state, const KnowsPage& knows);

  /// A finished tree.
  struct Result {
    ChildRef root;             ///< reference to the root group; not interior without points
    NodeSummary total;         ///< summary of all points
    std::uint64_t points = 0;  ///< points added
    std::uint64_t nodes = 0;   ///< children of all groups
    std::uint64_t groups = 0;  ///< groups handed to the sink
    int levels = 0;            ///< greatest level of a group, plus 1
  };
  /// Builds what is left, and closes all cells. Call once.
  [[nodiscard]] Result finish();

  /// Takes down the edges of the tree, before the first call of add(). save() does not save them.
  void record_edges() { edges_.emplace(); }
  /// Returns the edges of a tree that has a point, but for the radii. The references are those that
  /// the sink returned. @pre record_edges(), finish()
  [[nodiscard]] TreeEdges take_edges() { return edges_->take(result_.points); }

 private:
  /// A cell with few enough points for one thread, whose parent has too many; and the part of the
  /// tree below it.
  struct Piece {
    std::uint64_t first = 0;  ///< number of its first point
    std::size_t count = 0;    ///< its points
    std::uint64_t rank = 0;   ///< rank of its first point among the points with the same key
    int shared = 0;  ///< level of the smallest cell that holds its first point and the point before
    MortonKey before;             ///< key of the point before
    NodeChild top;                ///< the node that stands for the piece
    SubtreeGroups groups;         ///< its groups; they refer to each other by number
    std::vector<NodeGroup> kept;  ///< the same with exact sums, where the edges need them
  };

  [[nodiscard]] int common(std::size_t at, std::size_t other) const;
  [[nodiscard]] int level_before(std::size_t at) const;
  [[nodiscard]] std::span<const PointRecord> points_of(const Piece& piece) const;
  [[nodiscard]] Piece& new_piece();
  void cut(bool last);
  void build(bool last);
  void join(Piece& piece);
  [[nodiscard]] ChildRef emit(std::span<std::byte> group, std::uint64_t end);
  [[nodiscard]] NodeChild close(std::uint64_t end);

  GroupSink& sink_;
  const Executor& executor_;
  std::uint32_t leaf_points_;
  std::size_t piece_points_;
  double unit_;
  std::vector<SubtreeBuilder> builders_;  ///< one for each thread
  std::vector<PointRecord> window_;       ///< points from window_first_ on, not in a piece yet
  std::uint64_t window_first_ = 0;
  std::uint64_t rank_ = 0;        ///< rank of the point that cut() is at, among those with its key
  MortonKey last_key_;            ///< key of the point before it
  std::uint64_t last_rank_ = 0;   ///< rank of the point before it
  std::vector<Piece> pieces_;     ///< kept between calls, so that their memory is used again
  std::size_t piece_count_ = 0;   ///< pieces in use
  std::vector<ChildRef> places_;  ///< where the groups of a piece lie, by number
  std::vector<NodeGroup> path_;   ///< open cells, from the root down
  NodeChild current_;             ///< the node closed last, which is in no cell yet
  std::vector<std::byte> encoded_;
  std::optional<EdgeRecorder> edges_;  ///< set by record_edges()
  Result result_;
};

}  // namespace ptc
