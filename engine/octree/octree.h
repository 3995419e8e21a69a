// The octree over sorted surfels, bottom-up in one pass.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/io/file/state_file.h"
#include "engine/octree/subtree.h"
#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// Takes finished sibling groups in post-order: children, each after its own, before their parent.
class GroupSink {
 public:
  virtual ~GroupSink() = default;
  /// @param group  as it lies in a page, with what was returned for the groups of its children;
  /// valid during the call
  /// @param end    the point after its last
  /// @return where the group can be found: an interior reference
  virtual ChildRef add(const GroupView& group, std::uint64_t end) = 0;
};

/// Builds the octree of surfels that arrive in Morton order (Kontkanen et al. 2011, restated in
/// Fischer et al. 2024): cells of a few thousand points side by side, the cells around them as
/// theirs are done.
///
/// A cell is split while it holds more than `leaf_points` points; chains of cells with one occupied
/// child are one node, which stands for the smallest cell that holds its points. Cells of
/// coincident points are split by rank, below the lattice. Sums run in the order of the tree, so
/// they depend on the points alone.
///
/// Memory: the points of one call of add() and their groups, some 100 bytes each; of all before,
/// one open cell per level with at most 8 closed children each and kSubtreePoints or leaf_points
/// points, whichever is more.
class OctreeBuilder {
 public:
  /// A cell with no more points is built by one thread.
  static constexpr std::uint32_t kSubtreePoints = 4096;

  /// @param leaf_points  1 to kMaxLeafPoints
  /// @param unit         lattice unit in scene units
  OctreeBuilder(GroupSink& sink, std::uint32_t leaf_points, double unit, const Executor& executor);

  /// @param points  their keys ascending, none below those before
  void add(std::span<const PointRecord> points);

  /// What there is between two calls of add(), for a builder with the same arguments that goes on.
  void save(StateWriter& state) const;
  /// Takes it up before the first call of add(). @param pages  given so far, that groups may lie in
  /// @throws DataError, FormatError
  void load(StateReader& state, std::uint32_t pages);

  struct Result {
    ChildRef root;      ///< of the root group; not interior when there are no points
    NodeSummary total;  ///< of all points
    std::uint64_t points = 0;
    std::uint64_t nodes = 0;  ///< children of all groups
    std::uint64_t groups = 0;
    int levels = 0;  ///< greatest level of a group + 1
  };
  /// Closes all cells. Call once.
  [[nodiscard]] Result finish();

 private:
  /// A whole cell of few points whose parent has many: its part of the tree, as built by itself.
  struct Piece {
    std::uint64_t first = 0;
    std::size_t count = 0;
    std::uint64_t rank = 0;  ///< of its first point among those with its key
    int shared = 0;    ///< level of the smallest cell that holds its first point and the one before
    MortonKey before;  ///< key of that one
    NodeChild top;     ///< interior references of its groups are numbers of groups
    SubtreeGroups groups;
  };

  [[nodiscard]] int common(std::size_t at, std::size_t other) const;
  [[nodiscard]] int level_before(std::size_t at) const;
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
  std::vector<SubtreeBuilder> builders_;  ///< one a thread
  std::vector<PointRecord> window_;  ///< points from window_first_ on: those not yet in a piece
  std::uint64_t window_first_ = 0;
  std::uint64_t rank_ = 0;       ///< of the point that cut() is at among those with its key
  MortonKey last_key_;           ///< of the point before it
  std::uint64_t last_rank_ = 0;  ///< likewise
  std::vector<Piece> pieces_;    ///< kept between calls for their memory
  std::size_t piece_count_ = 0;
  std::vector<ChildRef> places_;  ///< of a piece's groups
  std::vector<NodeGroup> path_;   ///< open cells, from the root on
  NodeChild current_;             ///< the last that is closed; not yet in a cell
  std::vector<std::byte> encoded_;
  Result result_;
};

}  // namespace ptc
