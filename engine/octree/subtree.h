// Builds the octree of points that are in memory, by one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/octree/point_columns.h"
#include "engine/octree/summary.h"
#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// The groups of a part of the tree in post-order, encoded as they lie in pages. Their references
/// to interior children are numbers of groups in this object.
struct SubtreeGroups {
  struct Group {
    std::size_t begin = 0;  ///< offset of the group in `bytes`
    std::size_t size = 0;   ///< bytes of the group
    std::uint64_t end = 0;  ///< number after its last point
  };
  std::vector<std::byte> bytes;  ///< the groups, one after another
  std::vector<Group> groups;

  /// Removes all groups, but keeps the memory.
  void clear() noexcept {
    bytes.clear();
    groups.clear();
  }
};

/// Returns the number of leading octal digits that the ranks of two coincident points share; a rank
/// has kMaxLevel - kLatticeBits digits.
[[nodiscard]] int common_rank_level(std::uint64_t a, std::uint64_t b) noexcept;

/// Builds the octree below one cell, by the rules of OctreeBuilder.
/// Memory: 90 bytes for each point, and a group for each level.
class SubtreeBuilder {
 public:
  /// Receives each group after the groups of its children. @param end  number after its last point
  /// @return  an interior reference to the group
  using Emit = std::function<ChildRef(const NodeGroup& group, std::uint64_t end)>;

  /// @param leaf_points  a cell with no more points is not split, 1 to kMaxLeafPoints
  /// @param unit         lattice unit in scene units
  SubtreeBuilder(std::uint32_t leaf_points, double unit) : leaf_points_(leaf_points), unit_(unit) {}

  /// Builds the tree of all points of one cell.
  /// @param points  ascending by key, at least 1
  /// @param first   number of the first point
  /// @param rank    rank of the first point among the points with its key
  /// @return  the node that stands for the points: a leaf when they are at most leaf_points
  [[nodiscard]] NodeChild build(std::span<const PointRecord> points, std::uint64_t first,
                                std::uint64_t rank, const Emit& emit);
  /// Builds the tree of all points of one cell, and appends its groups to `out`.
  /// @param exact  gets the groups as they are before they are encoded; null: nobody needs them
  [[nodiscard]] NodeChild build(std::span<const PointRecord> points, std::uint64_t first,
                                std::uint64_t rank, SubtreeGroups& out,
                                std::vector<NodeGroup>* exact = nullptr);

 private:
  void build(std::size_t begin, std::size_t end, std::size_t depth, NodeChild& node);

  std::uint32_t leaf_points_;
  double unit_;
  std::span<const PointRecord> points_;
  PointColumns columns_;
  std::uint64_t first_ = 0;
  const Emit* emit_ = nullptr;
  /// By point: the level of the smallest cell that holds it and the point before.
  std::vector<std::uint8_t> levels_;
  std::vector<NodeGroup> path_;  ///< groups being filled, by depth; kept so that memory is reused
};

}  // namespace ptc
