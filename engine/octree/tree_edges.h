// What must be known of a tree so that it can be joined with the trees before and behind it on the
// curve: the groups around its first and its last point, with sums that are not rounded.
//
//   root            o------.---------.------.        a cell on the way to the first point may hold
//                  /       |         |       \       points of the part before, one on the way to
//   first        o-.     (node)    (node)   .-o      the last point those of the part behind;
//              /   |                        |   \    the nodes beside these ways stay what they are
//   leaves   [p p]                           [p p]
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "engine/io/file/state_file.h"
#include "engine/octree/square_sum.h"
#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// The maximum number of points of a tree: a leaf refers to its first one by 48 bits.
inline constexpr std::uint64_t kMaxTreePoints = (std::uint64_t{1} << 48) - 1;

/// The two edges of a tree.
struct TreeEdges {
  std::uint64_t points = 0;  ///< of the tree, at least 1
  ChildRef root;             ///< the root group
  /// The groups that the first and the last point lie in, from the deepest one up to the root, with
  /// references of the container.
  std::vector<NodeGroup> first, last;
  /// The points of the leaves at the end of both ways.
  std::vector<PointRecord> first_leaf, last_leaf;
  SquareSum radii;  ///< of the squares of all radii; the area of the points is twice the sum

  /// Changes all references to groups. @param placed  returns the reference in place of one
  void place(const std::function<ChildRef(const ChildRef&)>& placed);
  /// Saves the edges.
  void save(StateWriter& state) const;
  /// Loads edges that save() saved.
  /// @param node_pages  of the container
  /// @throws DataError when they are no edges of a tree. Wrong ones that it does not see may give a
  ///         wrong top over them, but one that pages can hold
  void load(StateReader& state, std::uint32_t node_pages);
};

/// Takes down the edges of a tree while OctreeBuilder builds it.
class EdgeRecorder {
 public:
  /// The groups of a part of the tree, by the numbers by which they refer to each other, and where
  /// a sink has put them.
  struct Built {
    NodeChild top;  ///< of the part
    std::span<const NodeGroup> groups;
    std::span<const ChildRef> places;  ///< of the groups
    std::span<const PointRecord> points;
  };
  /// Takes the part of the tree with the first point.
  void begin(const Built& built);
  /// Takes the part of the tree with the last point.
  void end(const Built& built);
  /// Takes a group around parts of the tree, after all groups in it.
  void close(const NodeGroup& group, const ChildRef& placed);
  /// Returns the edges. @pre the root was the last group
  [[nodiscard]] TreeEdges take(std::uint64_t points);

 private:
  TreeEdges edges_;
  std::optional<ChildRef> first_top_, last_top_;  ///< the nodes that the ways have come up to
};

}  // namespace ptc
