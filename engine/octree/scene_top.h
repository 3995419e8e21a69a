// Builds the top of a tree over the trees of parts (spec/parts.md#top).
//
// All that the top needs of a part are its edges. Cells on the way to the part's first point that
// hold points of the part before, and cells on the way to its last point that hold points of the
// part behind, are groups of the top. What lies beside these ways is taken as it is. The leaves at
// the end of a way are taken as points, because the top may split them:
//
//   part 0   ... node node p p p | p p node node ...   part 1
//                     cell: ( p p | p p )              at most leaf_points: the cut is in a leaf
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/octree/tree_edges.h"
#include "engine/store/writer.h"
#include "format/node_page.h"

namespace ptc {

/// The top of a scene's tree, from the edges of its parts in the order of the curve.
/// Memory: some 400 bytes for each node beside the way to a cut, as a rule 30 nodes a part.
class SceneTop {
 public:
  /// @param leaf_points  as in all parts
  /// @param unit         lattice unit in scene units
  SceneTop(std::uint32_t leaf_points, double unit) : leaf_points_(leaf_points), unit_(unit) {}

  /// Adds the next part.
  /// @param name        for errors
  /// @param node_pages  of the part
  /// @throws DataError when its points do not lie behind those of the part before
  void add(TreeEdges edges, std::string name, std::uint32_t node_pages);

  /// The finished top.
  struct Result {
    /// The node pages of the scene's own file in the order of their ranks, the root's last.
    std::vector<ContainerWriter::Page> pages;
    ChildRef root;  ///< the root group, on one of these pages
    std::uint64_t nodes = 0, groups = 0;
    int levels = 0;  ///< greatest level of a group of the top, plus 1
  };
  /// Builds the top. Call once, after at least one part was added.
  /// @param payload_limit  of a page, bytes
  /// @throws DataError when a leaf of the whole tree has points of two parts
  [[nodiscard]] Result finish(std::size_t payload_limit);

 private:
  /// A node that the top is built from, or a point of a leaf at an edge. A reference to a group has
  /// in `first_point` where that lies: kOwn, or the number of the part plus 1.
  struct Item {
    NodeChild node;
    MortonKey key;  ///< of a point in the smallest group around the item
    std::uint32_t part;
    int level;  ///< of the smallest cell that holds it and the item before
    bool is_point = false;
  };
  struct Part {
    std::string name;
    std::uint64_t first_point;
    std::uint32_t node_pages;
    MortonKey last_key;
  };
  /// A walk along the edges of the part that was added last but one.
  class Walk;

  void take(const TreeEdges& edges, int behind);
  [[nodiscard]] NodeChild build(std::size_t begin, std::size_t end);
  [[nodiscard]] NodeChild leaf(std::size_t begin, std::size_t end) const;
  [[nodiscard]] ChildRef add_group(NodeGroup group);
  [[nodiscard]] std::vector<ContainerWriter::Page> lay_out(std::size_t payload_limit,
                                                           std::vector<ChildRef>& places) const;
  void place_groups(const std::vector<ChildRef>& places, std::uint32_t own_pages);

  static constexpr std::uint64_t kOwn = 0;

  std::uint32_t leaf_points_;
  double unit_;
  std::vector<Part> parts_;
  std::optional<TreeEdges> waiting_;  ///< of the last part, until the first key behind it is known
  int before_ = -1;                   ///< level that the waiting part shares with the one before
  std::vector<Item> items_;
  std::vector<PointRecord> points_;    ///< of the items that are points
  std::vector<std::size_t> point_of_;  ///< of each item: its place in points_, or the next one's
  std::vector<NodeGroup> groups_;      ///< of the top, children before parents
};

}  // namespace ptc
