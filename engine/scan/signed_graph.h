// A graph whose edges vote for or against giving two nodes the same sign.
#pragma once

#include <cstddef>
#include <cstdint>
#include <queue>
#include <vector>

namespace ptc {

/// Disjoint groups of nodes, in which each node is flipped or not (union and find).
class SignedGroups {
 public:
  /// The group of a node, named by one of its nodes.
  struct Group {
    std::uint32_t root;
    bool flipped;  ///< relative to the root
  };

  /// Makes a group of each node.
  explicit SignedGroups(std::size_t nodes) { reset(nodes); }
  /// Begins again with a group of each node.
  void reset(std::size_t nodes);
  /// Returns the group of a node.
  [[nodiscard]] Group find(std::uint32_t node) noexcept;
  /// Says whether a node is the root of its group.
  [[nodiscard]] bool is_root(std::uint32_t node) const noexcept { return parent_[node] == node; }
  /// Joins the groups of two nodes, unless they are the same. The root of a's group stays.
  /// @param opposite  whether one of the nodes is flipped relative to the other
  void join(std::uint32_t a, std::uint32_t b, bool opposite) noexcept;

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<std::uint8_t> flip_;  ///< relative to the parent
};

/// Joins nodes into groups, and finds for each node whether it must be flipped to agree with its
/// group.
///
/// The strongest edge is contracted first, and the edges of the two groups to a third one are then
/// added up, so that many weak votes outweigh a single wrong one:
///
///        a ---- +9 ---- b                     ab
///          \          /                       |
///           +3      -1          --->          +2
///             \    /                          |
///               c                             c
///
/// A negative edge is contracted by flipping one of the groups, which turns the signs of all its
/// other edges. Votes are integers, so the result does not depend on the order in which they came.
/// Source: greedy contraction as in Keuper et al. 2015, Efficient decomposition of image and mesh
/// graphs by lifted multicuts; signed groups as in Schertler et al. 2017, Towards globally optimal
/// normal orientations for large point clouds.
class SignedGraph {
 public:
  /// Two groups and the sum of the votes between them.
  struct Edge {
    std::uint32_t a, b;
    std::int64_t vote;
  };
  using Group = SignedGroups::Group;

  explicit SignedGraph(std::size_t nodes);

  /// Adds a vote between two nodes, which may belong to groups already.
  /// @param vote  above 0: same sign; below 0: opposite signs
  void add(std::uint32_t a, std::uint32_t b, std::int64_t vote);
  /// Contracts edges, the strongest first, while their votes are at least `least` in magnitude.
  /// @param least  at least 1
  void contract(std::int64_t least);
  /// Returns the group of a node.
  [[nodiscard]] Group find(std::uint32_t node) noexcept { return groups_.find(node); }
  /// Returns the edges between different groups, in no particular order.
  [[nodiscard]] std::vector<Edge> edges() const;

 private:
  struct Slot {
    std::uint64_t pair = 0;  ///< the lower node in the upper half; 0: empty
    std::int64_t vote = 0;
  };
  struct Entry {
    std::int64_t strength;
    std::uint32_t a, b;
    bool operator<(const Entry& other) const noexcept;
  };

  [[nodiscard]] Slot& slot(std::uint32_t a, std::uint32_t b);
  void grow();
  void join(std::uint32_t a, std::uint32_t b, std::int64_t vote);

  SignedGroups groups_;
  std::vector<std::vector<std::uint32_t>> beside_;  ///< of each root, roots of now or before
  std::vector<Slot> slots_;                         ///< a hash table with open addresses
  std::size_t used_ = 0;
  std::priority_queue<Entry> queue_;
};

}  // namespace ptc
