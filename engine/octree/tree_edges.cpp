#include "engine/octree/tree_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include "engine/octree/node_state.h"
#include "engine/octree/page_order.h"
#include "format/error.h"
#include "format/morton.h"

namespace ptc {
namespace {

/// Which child of a group the way leads to.
enum class Side { first, last };

template <class Children>
auto& child_at(Children& children, Side side) {
  return side == Side::first ? children.front() : children.back();
}

ChildRef place_of(const ChildRef& ref, std::span<const ChildRef> places) {
  return ref.interior ? places[ref.page] : ref;
}

/// Walks from the top of a built part down to a leaf, and returns the leaf and the groups on the
/// way, the deepest one first.
std::pair<ChildRef, std::vector<NodeGroup>> way_down(const EdgeRecorder::Built& built, Side side) {
  std::vector<NodeGroup> way;
  ChildRef ref = built.top.ref;
  while (ref.interior) {
    NodeGroup& group = way.emplace_back(built.groups[ref.page]);
    ref = child_at(group.children, side).ref;
    for (NodeChild& child : group.children) child.ref = place_of(child.ref, built.places);
  }
  std::ranges::reverse(way);
  return {ref, std::move(way)};
}

void save_way(const std::vector<NodeGroup>& way, StateWriter& state) {
  state.put(std::uint64_t{way.size()});
  for (const NodeGroup& group : way) {
    state.put(group.cell.high);
    state.put(group.cell.low);
    state.put(static_cast<std::uint64_t>(group.level));
    state.put(std::uint64_t{group.children.size()});
    for (const NodeChild& child : group.children) save_child(child, state);
  }
}

constexpr double kMaxSum = 1e280;  // sums of all parts of a scene stay finite

/// Checks that a child has what a node page can hold.
void require_storable(StateReader& state, const NodeChild& child) {
  const NodeSummary& node = child.node;
  const auto sum = [](double value) { return value >= 0 && value <= kMaxSum; };
  const auto sums = [&](const std::array<double, 3>& values) {
    return std::ranges::all_of(values, sum);
  };
  constexpr double kEdge = std::uint64_t{1} << kLatticeBits;
  state.require(
      child.ref.interior || (child.ref.point_count >= 1 && child.ref.point_count <= kMaxLeafPoints),
      "a leaf of an edge has no points or more than a leaf may have");
  state.require(std::ranges::all_of(node.mean, [](double x) { return x >= 0 && x <= kEdge; }),
                "the mean of a node lies outside of the frame");
  state.require(sum(node.radius) && sum(node.area) && sum(node.thickness) && sum(node.greatest) &&
                    std::ranges::all_of(node.facing, sum) && std::ranges::all_of(node.flux, sums) &&
                    std::ranges::all_of(node.power, sums),
                "a sum of a node is negative or too large");
  state.require(std::abs(node.cone_cos) <= 1, "the cone of a node has no angle");
}

std::vector<NodeGroup> load_way(StateReader& state, const KnowsPage& knows, std::uint64_t points) {
  std::vector<NodeGroup> way(static_cast<std::size_t>(state.get_count(kMaxLevel + 1)));
  state.require(!way.empty(), "an edge of the tree has no root");
  for (NodeGroup& group : way) {
    group.cell = {state.get<std::uint64_t>(), state.get<std::uint64_t>()};
    group.level = static_cast<int>(state.get_count(kMaxLevel));
    group.children.resize(static_cast<std::size_t>(state.get_count(kMaxChildren)));
    state.require(!group.children.empty(), "a group of an edge has no children");
    for (NodeChild& child : group.children) {
      child = load_child(state, knows, points);
      require_storable(state, child);
    }
  }
  return way;
}

/// Loads the points of a leaf.
std::vector<PointRecord> load_leaf(StateReader& state) {
  std::vector<PointRecord> leaf;
  try {
    leaf = load_points(state);
  } catch (const FormatError& error) {
    state.require(false, std::string("the points of a leaf: ") + error.what());
  }
  state.require(!leaf.empty(), "a leaf of an edge has no points");
  return leaf;
}

/// Checks that a way leads down to its leaf, which lies in all its cells.
void require_way(StateReader& state, const std::vector<NodeGroup>& way,
                 std::span<const PointRecord> leaf, Side side) {
  for (const NodeGroup& group : way) {
    const bool inside = std::ranges::all_of(leaf, [&](const PointRecord& point) {
      return cell_of(point.key, group.level) == group.cell;
    });
    state.require(inside, "the leaf of an edge lies outside of a cell on the way to it");
  }
  for (std::size_t i = 0; i < way.size(); ++i) {
    const ChildRef& ref = child_at(way[i].children, side).ref;
    state.require(ref.interior == (i > 0), "an edge of the tree leads to no leaf");
    state.require(i == 0 || way[i].level < way[i - 1].level, "levels of an edge do not rise");
  }
  state.require(child_at(way.front().children, side).ref.point_count == leaf.size(),
                "a leaf of an edge lacks points");
}

bool same_group(const NodeGroup& a, const NodeGroup& b) {
  const auto bytes = [](const NodeGroup& group) {
    StateWriter state;
    save_way({group}, state);
    return state.take();
  };
  return bytes(a) == bytes(b);
}

/// Checks that both ways begin at one root, and part no earlier than below a group with two
/// children.
void require_one_tree(StateReader& state, const TreeEdges& edges) {
  auto a = edges.first.rbegin(), b = edges.last.rbegin();
  for (bool together = true; together; ++a, ++b) {
    state.require(a != edges.first.rend() && b != edges.last.rend() && same_group(*a, *b),
                  a == edges.first.rbegin() ? "the edges have two roots"
                                            : "the edges part above a single child");
    together = a->children.size() == 1 && a->children[0].ref.interior;
  }
  const ChildRef &first = edges.first.front().children.front().ref,
                 &last = edges.last.front().children.back().ref;
  state.require(first.first_point == 0, "the first leaf does not begin with the first point");
  state.require(last.point_count == edges.points - last.first_point,
                "the last leaf does not end with the last point");
  state.require(edges.first_leaf.front().key <= edges.last_leaf.back().key,
                "the last point lies before the first");
}

}  // namespace

void TreeEdges::place(const std::function<ChildRef(const ChildRef&)>& placed) {
  root = placed(root);
  for (std::vector<NodeGroup>* way : {&first, &last}) {
    for (NodeGroup& group : *way) {
      for (NodeChild& child : group.children) child.ref = placed(child.ref);
    }
  }
}

void TreeEdges::save(StateWriter& state) const {
  state.put(points);
  state.put(root.page);
  state.put(root.slot);
  save_way(first, state);
  save_way(last, state);
  save_points(first_leaf, state);
  save_points(last_leaf, state);
  radii.save(state);
}

void TreeEdges::load(StateReader& state, std::uint32_t node_pages) {
  const auto knows = [&](std::uint32_t page) { return page < node_pages; };
  points = state.get_count(kMaxTreePoints);
  root = {.interior = true, .page = state.get<std::uint32_t>(), .slot = state.get<std::uint16_t>()};
  state.require(knows(root.page), "the root of the edges does not exist");
  first = load_way(state, knows, points);
  last = load_way(state, knows, points);
  first_leaf = load_leaf(state);
  last_leaf = load_leaf(state);
  require_way(state, first, first_leaf, Side::first);
  require_way(state, last, last_leaf, Side::last);
  require_one_tree(state, *this);
  radii.load(state);
}

void EdgeRecorder::begin(const Built& built) {
  ChildRef leaf;
  std::tie(leaf, edges_.first) = way_down(built, Side::first);
  const auto points = built.points.first(leaf.point_count);
  edges_.first_leaf.assign(points.begin(), points.end());
  first_top_ = place_of(built.top.ref, built.places);
}

void EdgeRecorder::end(const Built& built) {
  ChildRef leaf;
  std::tie(leaf, edges_.last) = way_down(built, Side::last);
  const auto points = built.points.last(leaf.point_count);
  edges_.last_leaf.assign(points.begin(), points.end());
  last_top_ = place_of(built.top.ref, built.places);
}

void EdgeRecorder::close(const NodeGroup& group, const ChildRef& placed) {
  const auto extend = [&](std::optional<ChildRef>& top, Side side, std::vector<NodeGroup>& way) {
    if (!top || child_at(group.children, side).ref != *top) return;
    way.push_back(group);
    top = placed;
  };
  extend(first_top_, Side::first, edges_.first);
  extend(last_top_, Side::last, edges_.last);
}

TreeEdges EdgeRecorder::take(std::uint64_t points) {
  edges_.points = points;
  if (first_top_) edges_.root = *first_top_;
  return std::move(edges_);
}

}  // namespace ptc
