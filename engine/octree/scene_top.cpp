#include "engine/octree/scene_top.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "engine/base/error.h"
#include "engine/octree/summary.h"
#include "format/morton.h"

namespace ptc {

/// Turns the edges of one part into items.
class SceneTop::Walk {
 public:
  /// @param before, behind  levels of the smallest cells that hold points of the part and of the
  ///                        one before or behind it; -1: there is none
  Walk(SceneTop& top, const TreeEdges& edges, std::uint32_t part, int before, int behind)
      : top_(top), edges_(edges), part_(part), before_(before), behind_(behind), level_(before) {}

  void run() {
    const NodeGroup& root = edges_.first.back();
    const bool alone = before_ < 0 && behind_ < 0;
    if (alone || std::max(before_, behind_) >= root.level) return expand(root, 0, true, true);
    add({edges_.root, summarise_children(root.children)}, edges_.first_leaf.front().key);
  }

 private:
  /// Takes the children of a group that the top has.
  /// @param depth  number of groups above it in the part
  /// @param first, last  whether it holds the part's first and its last point
  void expand(const NodeGroup& group, std::size_t depth, bool first, bool last) {
    const MortonKey &first_key = edges_.first_leaf.front().key,
                    &last_key = edges_.last_leaf.back().key;
    for (std::size_t i = 0; i < group.children.size(); ++i) {
      const NodeChild& child = group.children[i];
      const bool to_first = first && i == 0, to_last = last && i + 1 == group.children.size();
      const MortonKey& key = to_first || (first && !to_last) ? first_key : last_key;
      if (i > 0) level_ = group.level;
      if (!to_first && !to_last) {
        add(child, key);
      } else if (!child.ref.interior) {
        add_points(to_first ? edges_.first_leaf : edges_.last_leaf);
      } else {
        const std::vector<NodeGroup>& way = to_first ? edges_.first : edges_.last;
        const NodeGroup& next = way[way.size() - depth - 2];
        const bool shared =
            (to_first && before_ >= next.level) || (to_last && behind_ >= next.level);
        if (shared) {
          expand(next, depth + 1, to_first, to_last);
        } else {
          add(child, key);
        }
      }
    }
  }

  void add(NodeChild child, const MortonKey& key, bool is_point = false) {
    ChildRef& ref = child.ref;
    ref.first_point = ref.interior ? part_ + 1 : ref.first_point + top_.parts_[part_].first_point;
    top_.point_of_.push_back(top_.points_.size());
    top_.items_.push_back({std::move(child), key, part_, level_, is_point});
  }

  /// Points of one position lie in one leaf here, so that no level splits them.
  static int level_between(const MortonKey& a, const MortonKey& b) {
    return a == b ? kMaxLevel + 1 : common_level(a, b);
  }

  void add_points(const std::vector<PointRecord>& leaf) {
    std::uint64_t number = &leaf == &edges_.first_leaf ? 0 : edges_.points - leaf.size();
    for (std::size_t i = 0; i < leaf.size(); ++i, ++number) {
      if (i > 0) level_ = level_between(leaf[i - 1].key, leaf[i].key);
      add({{.first_point = number, .point_count = 1}, {}}, leaf[i].key, true);
      top_.points_.push_back(leaf[i]);
    }
  }

  SceneTop& top_;
  const TreeEdges& edges_;
  std::uint32_t part_;
  int before_, behind_;
  int level_;  ///< of the next item
};

void SceneTop::add(TreeEdges edges, std::string name, std::uint32_t node_pages) {
  int shared = -1;
  std::uint64_t first_point = 0;
  if (waiting_) {
    const Part& before = parts_.back();
    const MortonKey& key = edges.first_leaf.front().key;
    if (before.last_key >= key)
      throw DataError(name + ": its points do not lie behind those of " + before.name);
    shared = common_level(before.last_key, key);
    first_point = before.first_point + waiting_->points;
    take(*waiting_, shared);
  }
  parts_.push_back({std::move(name), first_point, node_pages, edges.last_leaf.back().key});
  before_ = shared;
  waiting_ = std::move(edges);
}

void SceneTop::take(const TreeEdges& edges, int behind) {
  Walk(*this, edges, static_cast<std::uint32_t>(parts_.size() - 1), before_, behind).run();
}

SceneTop::Result SceneTop::finish(std::size_t payload_limit) {
  // Build the groups
  take(*waiting_, -1);
  NodeChild root = build(0, items_.size());
  if (!root.ref.interior) root.ref = add_group({.children = {root}});

  // Lay them out on pages, and let them refer to where these and those of the parts lie
  std::vector<ChildRef> places(groups_.size());
  const std::size_t pages = lay_out(payload_limit, places).size();
  place_groups(places, static_cast<std::uint32_t>(pages));
  Result result{.pages = lay_out(payload_limit, places), .root = places[root.ref.page]};
  result.groups = groups_.size();
  for (const NodeGroup& group : groups_) {
    result.nodes += group.children.size();
    result.levels = std::max(result.levels, group.level + 1);
  }
  return result;
}

/// Builds the node that stands for some items, and the groups of the top below it.
NodeChild SceneTop::build(std::size_t begin, std::size_t end) {
  // Take a node of a part as it is, and make few points a leaf
  const auto items = std::span(items_).subspan(begin, end - begin);
  if (items.size() == 1 && !items[0].is_point) return items[0].node;
  if (items.size() <= leaf_points_ && std::ranges::all_of(items, &Item::is_point))
    return leaf(begin, end);

  // Split the items where neighbours part at the level of the smallest cell that holds all
  const int level = std::ranges::min(items.subspan(1), {}, &Item::level).level;
  NodeGroup group{.cell = cell_of(items[0].key, level), .level = level, .children = {}};
  for (std::size_t first = begin; first < end;) {
    std::size_t last = first + 1;
    while (last < end && items_[last].level > level) ++last;
    group.children.push_back(build(first, last));
    first = last;
  }
  if (group.children.size() > kMaxChildren) {
    throw DataError(parts_[items_[end - 1].part].name + ": a cell that it shares with " +
                    parts_[items_[begin].part].name + " has more than 8 children");
  }
  const NodeSummary node = summarise_children(group.children);
  return {add_group(std::move(group)), node};
}

/// Makes a leaf of points.
NodeChild SceneTop::leaf(std::size_t begin, std::size_t end) const {
  const Item &first = items_[begin], &last = items_[end - 1];
  if (first.part != last.part) {
    throw DataError(parts_[last.part].name + ": its first points share a leaf of the tree with " +
                    "the last ones of " + parts_[first.part].name +
                    ": parts are cut where a leaf ends (spec/parts.md#top)");
  }
  ChildRef ref = first.node.ref;
  ref.point_count = static_cast<std::uint32_t>(end - begin);
  return {ref, summarise_points(std::span(points_).subspan(point_of_[begin], end - begin), unit_)};
}

ChildRef SceneTop::add_group(NodeGroup group) {
  groups_.push_back(std::move(group));
  return {.interior = true,
          .page = static_cast<std::uint32_t>(groups_.size() - 1),
          .first_point = kOwn};
}

/// Puts the groups on pages: the deepest level first, and each level in the order of the curve.
/// @param places  gets the place of each group
std::vector<ContainerWriter::Page> SceneTop::lay_out(std::size_t payload_limit,
                                                     std::vector<ChildRef>& places) const {
  std::vector<std::size_t> order(groups_.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, std::greater(), [&](std::size_t i) { return groups_[i].level; });

  std::vector<ContainerWriter::Page> pages;
  NodePageEncoder encoder(payload_limit);
  PageSummary open;
  const auto end_page = [&] {
    open.record_count = encoder.size();
    open.rank = static_cast<std::uint32_t>(pages.size());
    pages.push_back({open, encoder.take()});
  };
  for (const std::size_t i : order) {
    const NodeGroup& group = groups_[i];
    if (encoder.size() > 0 && !encoder.fits(group.children.size(), emits_light(group))) end_page();
    if (encoder.size() == 0) {
      open = {.type = PageType::node, .first_key = group.cell.high, .last_key = group.cell.high};
    }
    open.level = static_cast<std::uint8_t>(group.level);  // the least so far
    open.first_key = std::min(open.first_key, group.cell.high);
    open.last_key = std::max(open.last_key, group.cell.high);
    places[i] = {.interior = true,
                 .page = static_cast<std::uint32_t>(pages.size()),
                 .slot = encoder.add(group)};
  }
  end_page();
  return pages;
}

/// Lets all groups refer to ranks of the scene.
/// @param own_pages  node pages of the scene's own file
void SceneTop::place_groups(const std::vector<ChildRef>& places, std::uint32_t own_pages) {
  std::vector<std::uint32_t> first_page{own_pages};
  for (const Part& part : parts_) first_page.push_back(first_page.back() + part.node_pages);
  for (NodeGroup& group : groups_) {
    for (NodeChild& child : group.children) {
      ChildRef& ref = child.ref;
      if (!ref.interior) continue;
      if (ref.first_point == kOwn) {
        ref = places[ref.page];
      } else {
        ref.page += first_page[static_cast<std::size_t>(ref.first_point - 1)];
      }
    }
  }
}

}  // namespace ptc
