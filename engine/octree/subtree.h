// The octree of points in memory.
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

/// Groups of a part of the tree in post-order, one after another as they lie in pages. References
/// of interior children are numbers of groups in here.
struct SubtreeGroups {
  struct Group {
    std::size_t begin = 0;  ///< in bytes
    std::size_t size = 0;
    std::uint64_t end = 0;  ///< the point after its last
  };
  std::vector<std::byte> bytes;
  std::vector<Group> groups;

  void clear() noexcept {
    bytes.clear();
    groups.clear();
  }
};

/// Octal digits that the ranks of two coincident points share, of kMaxLevel - kLatticeBits.
[[nodiscard]] int common_rank_level(std::uint64_t a, std::uint64_t b) noexcept;

/// Builds the octree below one cell, as OctreeBuilder says.   Memory: 90 bytes a point, and a group
/// for each level.
class SubtreeBuilder {
 public:
  /// Takes a group when its children are done. @return an interior reference to it
  using Emit = std::function<ChildRef(const NodeGroup& group, std::uint64_t end)>;

  /// @param leaf_points, unit  as of OctreeBuilder
  SubtreeBuilder(std::uint32_t leaf_points, double unit) : leaf_points_(leaf_points), unit_(unit) {}

  /// @param points  all of one cell, ascending, at least 1
  /// @param first   number of the first of them
  /// @param rank    of the first among those with its key
  /// @return the node that stands for them: a leaf when it has no more points than a leaf may
  [[nodiscard]] NodeChild build(std::span<const PointRecord> points, std::uint64_t first,
                                std::uint64_t rank, const Emit& emit);
  /// The same; groups are appended to `out`.
  [[nodiscard]] NodeChild build(std::span<const PointRecord> points, std::uint64_t first,
                                std::uint64_t rank, SubtreeGroups& out);

 private:
  void build(std::size_t begin, std::size_t end, std::size_t depth, NodeChild& node);

  std::uint32_t leaf_points_;
  double unit_;
  std::span<const PointRecord> points_;
  PointColumns columns_;
  std::uint64_t first_ = 0;
  const Emit* emit_ = nullptr;
  std::vector<std::uint8_t>
      levels_;                   ///< of the smallest cell that holds a point and the one before
  std::vector<NodeGroup> path_;  ///< groups being filled, by depth; kept for their memory
};

}  // namespace ptc
