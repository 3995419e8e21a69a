#include "engine/build/octree.h"

#include <bit>
#include <cassert>
#include <utility>

namespace ptc {
namespace {

constexpr int kRankLevels = kMaxLevel - kLatticeBits;  // 20 octal digits of rank

/// Octal digits that two ranks of coincident points share, of kRankLevels.
int common_rank_level(std::uint64_t a, std::uint64_t b) {
  const int differ = 64 - std::countl_zero(a ^ b);  // bits from the lowest to the first that differs
  return kRankLevels - (differ + 2) / 3;
}

}  // namespace

OctreeBuilder::OctreeBuilder(GroupSink& sink, std::uint32_t leaf_points, double unit)
    : sink_(sink), leaf_points_(leaf_points), unit_(unit) {
  assert(leaf_points >= 1 && leaf_points <= kMaxLeafPoints);
}

void OctreeBuilder::add(const PointRecord& point) {
  const Cluster single{.first = result_.points, .count = 1};
  if (result_.points++ > 0) {
    assert(last_key_ <= point.key);
    int shared = common_level(last_key_, point.key);
    if (shared == kLatticeBits) {
      shared += common_rank_level(rank_, rank_ + 1);
      ++rank_;
    } else {
      rank_ = 0;
    }
    while (!path_.empty() && path_.back().level > shared) {
      attach(std::move(current_));
      current_ = close();
    }
    if (path_.empty() || path_.back().level < shared) {
      path_.push_back({.level = shared, .key = last_key_});
      path_.back().children.reserve(kMaxChildren);
    }
    attach(std::move(current_));
  }
  current_ = single;
  last_key_ = point.key;
  window_.push_back(point);
}

void OctreeBuilder::attach(Cluster cluster) {
  OpenCell& cell = path_.back();
  cell.count += cluster.count;
  cell.children.push_back(std::move(cluster));
  if (cell.count > leaf_points_) settle();
}

/// The innermost cell must split, so every cell around it must: their closed leaves are final. They
/// are summarised, and their points leave the window.
void OctreeBuilder::settle() {
  for (auto cell = path_.rbegin(); cell != path_.rend(); ++cell) {
    for (Cluster& child : cell->children) {
      if (!child.summarised) summarise(child);
    }
    if (std::exchange(cell->splits, true) && cell != path_.rbegin()) break;
  }
  const Cluster& last = path_.back().children.back();
  const std::uint64_t keep_from = last.first + last.count;
  window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(keep_from - window_first_));
  window_first_ = keep_from;
}

void OctreeBuilder::summarise(Cluster& leaf) const {
  leaf.node = summarise_points(std::span(window_).subspan(leaf.first - window_first_, leaf.count), unit_);
  leaf.ref = {.first_point = leaf.first, .point_count = static_cast<std::uint32_t>(leaf.count)};
  leaf.summarised = true;
}

/// Closes the innermost cell: a leaf to be while it is small, else its children go to the sink.
OctreeBuilder::Cluster OctreeBuilder::close() {
  OpenCell cell = std::move(path_.back());
  path_.pop_back();
  Cluster closed{.first = cell.children.front().first, .count = cell.count};
  if (!cell.splits) return closed;
  std::array<const NodeSummary*, kMaxChildren> nodes{};
  for (std::size_t i = 0; i < cell.children.size(); ++i) nodes[i] = &cell.children[i].node;
  closed.node = summarise_nodes(std::span(nodes).first(cell.children.size()));
  closed.ref = emit(cell);
  closed.summarised = true;
  return closed;
}

ChildRef OctreeBuilder::emit(OpenCell& cell) {
  NodeGroup group{.cell = cell_of(cell.key, std::min(cell.level, kLatticeBits)), .level = cell.level};
  group.children.reserve(cell.children.size());
  for (Cluster& child : cell.children) group.children.push_back({child.ref, child.node});
  result_.nodes += group.children.size();
  ++result_.groups;
  result_.levels = std::max(result_.levels, cell.level + 1);
  return sink_.add(group);
}

OctreeBuilder::Result OctreeBuilder::finish() {
  if (result_.points == 0) return result_;
  while (!path_.empty()) {
    attach(std::move(current_));
    current_ = close();
  }
  if (!current_.summarised) {  // all points in one leaf: a root group with one child
    summarise(current_);
    OpenCell root{.level = 0, .key = last_key_};
    root.children.push_back(current_);
    current_.ref = emit(root);
  }
  result_.root = current_.ref;
  result_.total = current_.node;
  return result_;
}

}  // namespace ptc
