// The tree follows from the levels at which neighbouring points part. The smallest cell that holds
// points [begin, end) has the least of these levels, and its children end where that level occurs:
//
//   point    p0   p1   p2   p3   p4   p5
//   level       5    3    4    3    6           between neighbours
//               the cell has level 3:  {p0 p1} {p2 p3} {p4 p5}
#include "engine/octree/subtree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstring>

namespace ptc {
namespace {

constexpr int kRankLevels = kMaxLevel - kLatticeBits;  // 20 octal digits of rank

}  // namespace

int common_rank_level(std::uint64_t a, std::uint64_t b) noexcept {
  const int differ = 64 - std::countl_zero(a ^ b);  // bits from the highest that differs to the end
  return kRankLevels - (differ + 2) / 3;
}

NodeChild SubtreeBuilder::build(std::span<const PointRecord> points, std::uint64_t first,
                                std::uint64_t rank, const Emit& emit) {
  // Find the level at which each point parts from the one before.
  points_ = points;
  first_ = first;
  emit_ = &emit;
  levels_.assign(points.size(), 0);
  for (std::size_t i = 1; i < points.size(); ++i) {
    assert(points[i - 1].key <= points[i].key);
    int level = common_level(points[i - 1].key, points[i].key);
    if (level == kLatticeBits) {
      level += common_rank_level(rank, rank + 1);
      ++rank;
    } else {
      rank = 0;
    }
    levels_[i] = static_cast<std::uint8_t>(level);
  }
  // Build the tree from the root of this part down.
  columns_.assign(points, unit_);
  path_.resize(kMaxLevel + 2);
  NodeChild top;
  build(0, points.size(), 0, top);
  return top;
}

NodeChild SubtreeBuilder::build(std::span<const PointRecord> points, std::uint64_t first,
                                std::uint64_t rank, SubtreeGroups& out,
                                std::vector<NodeGroup>* exact) {
  return build(points, first, rank, [&](const NodeGroup& group, std::uint64_t end) {
    const std::size_t begin = out.bytes.size();
    append_group(group, out.bytes);
    if (exact) exact->push_back(group);
    out.groups.push_back({begin, out.bytes.size() - begin, end});
    return ChildRef{.interior = true, .page = static_cast<std::uint32_t>(out.groups.size() - 1)};
  });
}

/// Builds the node of the points from `begin` up to `end`, and of the groups below it.
/// @param depth  number of groups above it in this part of the tree
void SubtreeBuilder::build(std::size_t begin, std::size_t end, std::size_t depth, NodeChild& node) {
  // Make few points a leaf.
  if (end - begin <= leaf_points_) {
    node.ref = {.first_point = first_ + begin,
                .point_count = static_cast<std::uint32_t>(end - begin)};
    node.node = summarise_points(columns_, begin, end);
    return;
  }
  const auto at = [this](std::size_t i) {
    return levels_.begin() + static_cast<std::ptrdiff_t>(i);
  };
  // Find the smallest cell that holds all points.
  const std::uint8_t level = *std::min_element(at(begin + 1), at(end));
  NodeGroup& group = path_[depth];
  group.level = level;
  group.cell = cell_of(points_[begin].key, std::min(group.level, kLatticeBits));
  group.children.clear();
  group.children.reserve(kMaxChildren);
  // Split the points where neighbours part at that level.
  for (std::size_t first = begin; first < end;) {
    const void* const found = std::memchr(levels_.data() + first + 1, level, end - first - 1);
    const std::size_t last =
        found == nullptr
            ? end
            : static_cast<std::size_t>(static_cast<const std::uint8_t*>(found) - levels_.data());
    build(first, last, depth + 1, group.children.emplace_back());
    first = last;
  }
  // Emit the group after those of its children.
  node.node = summarise_children(group.children);
  node.ref = (*emit_)(group, first_ + end);
}

}  // namespace ptc
