// The octree over sorted surfels, bottom-up in one pass.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// Takes finished sibling groups, children before parents.
class GroupSink {
 public:
  virtual ~GroupSink() = default;
  /// @return where the group can be found: an interior reference
  virtual ChildRef add(const NodeGroup& group) = 0;
};

/// Builds the octree of surfels that arrive in Morton order (Kontkanen et al. 2011, restated in
/// Fischer et al. 2024).
///
/// A cell is split while it holds more than `leaf_points` points; chains of cells with one occupied
/// child are one node, which stands for the smallest cell that holds its points. Cells of
/// coincident points are split by rank, below the lattice. Sums run in the order of the tree, so
/// they depend on the points alone.
///
/// Memory: one open cell per level with at most 8 closed children each, and the points of the one
/// cell that may still become a leaf: at most leaf_points + 1.
class OctreeBuilder {
 public:
  /// @param leaf_points  1 to kMaxLeafPoints
  /// @param unit         lattice unit in scene units
  OctreeBuilder(GroupSink& sink, std::uint32_t leaf_points, double unit);

  /// @param point  its key not below the one before
  void add(const PointRecord& point);

  struct Result {
    ChildRef root;            ///< of the root group; not interior when there are no points
    NodeSummary total;        ///< of all points
    std::uint64_t points = 0;
    std::uint64_t nodes = 0;  ///< children of all groups
    std::uint64_t groups = 0;
    int levels = 0;           ///< greatest level of a group + 1
  };
  /// Closes all cells. Call once.
  [[nodiscard]] Result finish();

 private:
  /// Points of one cell that is closed: a leaf to be, or a node whose children are in the sink.
  struct Cluster {
    std::uint64_t first = 0;
    std::uint64_t count = 0;
    ChildRef ref;
    NodeSummary node;
    bool summarised = false;  ///< `node` is known; a leaf is summarised when its parent must split
  };
  struct OpenCell {
    int level = 0;
    MortonKey key;  ///< of its first point
    std::uint64_t count = 0;
    bool splits = false;  ///< holds more than leaf_points
    std::vector<Cluster> children;
  };

  void attach(Cluster cluster);
  void settle();
  Cluster close();
  ChildRef emit(OpenCell& cell);
  void summarise(Cluster& leaf) const;

  GroupSink& sink_;
  std::uint32_t leaf_points_;
  double unit_;
  std::vector<OpenCell> path_;
  std::vector<PointRecord> window_;  ///< points from window_first_ on: those not yet in a summary
  std::uint64_t window_first_ = 0;
  Cluster current_;
  MortonKey last_key_;
  std::uint64_t rank_ = 0;  ///< of the last point among those with its key
  Result result_;
};

/// Summary of a run of surfels: exact bounding sphere and cone. @param unit as above
[[nodiscard]] NodeSummary summarise_points(std::span<const PointRecord> points, double unit);
/// Summary of several clusters; the sphere holds their spheres, the cone their cones.
[[nodiscard]] NodeSummary summarise_nodes(std::span<const NodeSummary* const> nodes);

}  // namespace ptc
