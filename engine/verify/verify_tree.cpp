// Checks the octree against its points (spec/nodes.md#verify) in one walk, depth first. Leaves must
// take the points in their order without a gap, so tree and points are read side by side:
//
//   path_    root group > child group > ... > leaf      one open group for each level
//                                              |
//   points_  ....read....................[its points].....
//
// On the way back up, the exact summary of each child's points is combined into that of its parent,
// so that every stored summary is compared with one computed from the points alone. Where pages are
// damaged, the walk skips what they hold: sums above are then unknown and not compared, and the
// next leaf may begin at a later point.
#include "engine/verify/verify_tree.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "engine/octree/octree.h"
#include "engine/verify/node_pages.h"
#include "engine/verify/point_runs.h"
#include "engine/verify/verify_node.h"
#include "format/node_page.h"

namespace ptc {
namespace {

constexpr char kTop[] = "spec/parts.md#parts-top";
constexpr char kLevel[] = "spec/nodes.md#node-level";
constexpr char kCell[] = "spec/nodes.md#node-cell";
constexpr char kChildren[] = "spec/nodes.md#node-children";
constexpr char kLeaf[] = "spec/nodes.md#node-leaf";
constexpr char kEmission[] = "spec/nodes.md#node-emission";
constexpr char kReferences[] = "spec/nodes.md#references";
constexpr char kCounts[] = "spec/container.md#superblock-counts";
constexpr char kRoot[] = "spec/container.md#superblock-root";

/// A group on the path from the root, where it lies, and what was found below it so far.
struct OpenGroup {
  NodeGroup group;
  std::uint32_t page = 0;         ///< page that the group lies in
  std::uint64_t from_header = 0;  ///< bytes from the page header to the group, or to the payload if
                                  ///< that is compressed
  std::string place;              ///< the group's name in messages, ending in ": "
  std::size_t next = 0;           ///< the child to visit next
  std::uint64_t points = 0;       ///< points in the children visited
  int last_octant = -1;           ///< octant of the child visited last, 0 to 7
  bool complete = true;           ///< nothing was skipped in the children visited
  std::array<NodeSummary, kMaxChildren> exact;  ///< exact summaries of the children visited
};

/// Decodes a group, and notes where it lies for messages.
OpenGroup open_group(NodePages& pages, std::uint32_t page, std::uint16_t slot) {
  const NodePages::Place place = pages.page(page);
  const auto at = static_cast<std::size_t>(place.nodes[slot].bytes().data() - place.payload);
  OpenGroup opened;
  opened.group = place.nodes.decode(slot);
  opened.page = page;
  opened.from_header = kPageHeaderBytes + (place.raw ? at : 0);
  opened.place =
      (place.raw ? "" : fmt::format("decoded byte {}: ", at)) + fmt::format("group {}: ", slot);
  return opened;
}

/// Records which groups were reached, with one bit for each: groups are numbered consecutively
/// through all node pages.
class ReachedGroups {
 public:
  explicit ReachedGroups(const ContainerReader& container)
      : container_(container), first_(container.page_count()) {
    std::uint64_t groups = 0;
    for (const std::uint32_t page : container.node_pages()) {
      first_[page] = groups;
      groups += container.entry(page).record_count;
    }
    bits_.resize(groups);
  }

  /// Marks a group as reached. Returns false when it was reached before.
  bool reach(std::uint32_t page, std::uint16_t slot) {
    const std::uint64_t group = first_[page] + slot;
    if (bits_[group]) return false;
    return bits_[group] = true;
  }

  /// Reports the groups that were not reached, with one finding for each page.
  void report_rest(const TreeReport& report) const {
    for (const std::uint32_t page : container_.node_pages()) {
      if (!container_.is_own(page)) continue;  // the top leads to some groups of a part
      const auto first = bits_.begin() + static_cast<std::ptrdiff_t>(first_[page]);
      const auto last = first + container_.entry(page).record_count;
      const auto missed = std::find(first, last, false);
      if (missed == last) continue;
      const auto others = std::count(missed, last, false) - 1;
      report.page(page, 0, kReferences,
                  fmt::format("group {} is the child of no node{}", missed - first,
                              others > 0 ? fmt::format("; other such groups: {}", others) : ""));
    }
  }

 private:
  const ContainerReader& container_;
  std::vector<std::uint64_t> first_;  ///< by page: the number of its first group
  std::vector<bool> bits_;
};

/// The walk through the tree. Its path holds the open groups from the root to the current one.
class TreeWalk {
 public:
  TreeWalk(const ContainerReader& container, const std::vector<bool>& damaged,
           std::size_t cached_pages, Findings& findings, Progress& progress)
      : container_(container),
        superblock_(container.superblock()),
        node_pages_(container.node_pages()),
        damaged_(damaged),
        report_(container, findings),
        progress_(progress),
        pages_(container, cached_pages),
        reached_(container),
        points_(container, damaged, report_) {}

  TreeCounts run() {
    // Count the groups of parts, whether the top leads to them or not. Then walk the tree.
    for (const auto& part : container_.parts()) {
      counts_.groups += part->superblock().node_groups;
      counts_.nodes += part->superblock().nodes;
      counts_.levels = std::max(counts_.levels, int{part->superblock().levels});
    }
    if (superblock_.points > 0) {
      enter(node_pages_[superblock_.root_page], superblock_.root_slot);
      while (!path_.empty()) step();
    }
    // Compare the totals with the superblock's, unless a part was skipped.
    if (!counts_.complete) return counts_;
    reached_.report_rest(report_);
    points_.finish();
    require_equal(kCounts, "nodes", superblock_.nodes, counts_.nodes);
    require_equal(kCounts, "node groups", superblock_.node_groups, counts_.groups);
    require_equal(kRoot, "levels", superblock_.levels, static_cast<std::uint64_t>(counts_.levels));
    return counts_;
  }

 private:
  void require_equal(const char* clause, const char* what, std::uint64_t said,
                     std::uint64_t found) const {
    if (said == found) return;
    report_.superblock(clause, fmt::format("the superblock records {} {}, but the tree has {}",
                                           said, what, found));
  }

  void fault(const OpenGroup& open, const char* clause, const std::string& text) const {
    report_.page(open.page, open.from_header, at_seam_ ? kTop : clause, open.place + text);
  }

  /// Says whether what hangs below a group is a seam: the group is of the top of a scene of parts.
  [[nodiscard]] bool is_top(const OpenGroup& open) const {
    return !container_.parts().empty() && container_.is_own(open.page);
  }

  /// Says whether the leaf that is visited is the first below a group of the top.
  [[nodiscard]] bool begins_seam() const {
    for (std::size_t i = path_.size(); i-- > 0;) {
      if (is_top(path_[i])) return true;
      if (path_[i].next > 0) return false;
    }
    return false;
  }

  /// Skips the next child and everything below it.
  void pass_over() {
    resume_ = true;
    leave_incomplete();
  }

  /// Moves on from the next child, and notes that something below it was skipped.
  void leave_incomplete() {
    counts_.complete = false;
    if (path_.empty()) return;
    path_.back().complete = false;
    ++path_.back().next;
  }

  /// Visits the next child of the innermost group, or leaves the group after its last child.
  void step() {
    OpenGroup& open = path_.back();
    if (open.next == open.group.children.size()) {
      leave();
      return;
    }
    const ChildRef& ref = open.group.children[open.next].ref;
    if (ref.interior) {
      enter(node_pages_[ref.page], ref.slot);
    } else {
      visit_leaf(open, ref);
    }
  }

  /// Opens a group, unless it is damaged or its place in the tree is wrong.
  void enter(std::uint32_t page, std::uint16_t slot) {
    if (damaged_[page]) return pass_over();
    OpenGroup open = open_group(pages_, page, slot);
    at_seam_ = !path_.empty() && is_top(path_.back()) && !is_top(open);
    const bool fits = check_place(open, slot);
    at_seam_ = false;
    if (!fits) return pass_over();
    if (container_.is_own(page)) {
      ++counts_.groups;
      counts_.nodes += open.group.children.size();
      counts_.levels = std::max(counts_.levels, open.group.level + 1);
    }
    path_.push_back(std::move(open));
  }

  /// Checks the place of a group in the tree. @return false when the walk cannot enter it
  bool check_place(const OpenGroup& open, std::uint16_t slot) {
    if (!reached_.reach(open.page, slot)) {
      fault(open, kReferences, "it is the child of two nodes");
      return false;
    }
    if (!path_.empty()) return check_inside(open, path_.back());
    check_root(open);
    return true;
  }

  void check_root(const OpenGroup& open) const {
    const std::vector<NodeChild>& children = open.group.children;
    if (children.size() > 1) return;
    if (children[0].ref.interior || open.group.level != 0) {
      fault(open, kChildren, "the root has one child, which is not a leaf at level 0");
    }
  }

  /// Checks a group against its parent: its level, its cell and its place among the children.
  /// @return  false when it is not deeper than its parent, so that the walk might never end
  bool check_inside(const OpenGroup& open, OpenGroup& parent) const {
    const NodeGroup& group = open.group;
    const NodeGroup& around = parent.group;
    if (group.level <= around.level) {
      fault(open, kLevel,
            fmt::format("its level {} is not deeper than its parent's, {}", group.level,
                        around.level));
      return false;
    }
    if (group.children.size() < 2) fault(open, kChildren, "it has one child but is not the root");
    if (!contains(around, group.cell)) {
      fault(open, kCell, "its cell lies outside its parent's cell");
    } else {
      check_next_octant(parent, group.cell);
    }
    return true;
  }

  static bool contains(const NodeGroup& group, const MortonKey& key) {
    return cell_of(key, std::min(group.level, kLatticeBits)) == group.cell;
  }

  /// Checks that the next child lies in a later octant than the child before it. Below the lattice
  /// children differ by rank instead, and a root that is a leaf has no octants.
  /// @param key  of any point of the child
  void check_next_octant(OpenGroup& open, const MortonKey& key) const {
    if (open.group.level >= kLatticeBits || open.group.children.size() == 1) return;
    const int digit = octant(key, open.group.level + 1);
    if (digit <= open.last_octant) {
      fault(
          open, kChildren,
          fmt::format("child {} does not lie in a later octant than the child before", open.next));
    }
    open.last_octant = digit;
  }

  /// Reads the points of a leaf, and checks their order, their cell and the leaf's summary.
  void visit_leaf(OpenGroup& open, const ChildRef& ref) {
    const auto child_fault = [&](const char* clause, const std::string& text) {
      fault(open, clause, fmt::format("child {}: {}", open.next, text));
    };
    at_seam_ = begins_seam();
    // Check that its points follow those of the leaf before, and are not too many.
    if (ref.first_point != next_point_ && !(resume_ && ref.first_point > next_point_)) {
      child_fault(kLeaf, fmt::format("its points begin with number {}, but the next point is "
                                     "number {}",
                                     ref.first_point, next_point_));
      at_seam_ = false;
      return pass_over();
    }
    at_seam_ = is_top(open);
    resume_ = false;
    next_point_ = container_.next_point(ref.first_point + ref.point_count);
    if (ref.point_count > superblock_.leaf_points) {
      child_fault(kLeaf, fmt::format("it has {} points, but a leaf has at most {}", ref.point_count,
                                     superblock_.leaf_points));
    }
    // Read them, and check that they lie in one octant of the group's cell.
    const auto points = points_.take(ref.first_point, ref.point_count);
    progress_.advance(ref.point_count);
    if (!points) {
      at_seam_ = false;
      return pass_over();
    }
    const auto outside = [&](const PointRecord& point) { return !contains(open.group, point.key); };
    if (std::ranges::any_of(*points, outside)) {
      child_fault(kCell, "its points lie outside the cell");
    } else {
      check_one_octant(open, *points);
    }
    at_seam_ = false;
    // Check the stored bounds point by point, then the whole summary.
    const NodeSummary& stored = open.group.children[open.next].node;
    const double unit = superblock_.header.frame.unit();
    auto wrong = check_bounds(stored, *points, unit);
    if (wrong) child_fault(wrong->clause, wrong->text);
    close_child(open, summarise_points(*points, unit), points->size(), !wrong);
  }

  void check_one_octant(OpenGroup& open, std::span<const PointRecord> points) const {
    check_next_octant(open, points.front().key);
    const int level = open.group.level + 1;
    if (level > kLatticeBits || open.group.children.size() == 1) return;
    if (octant(points.front().key, level) != octant(points.back().key, level)) {
      fault(open, kChildren, fmt::format("child {} has points in more than one octant", open.next));
    }
  }

  /// Finishes the next child after all below it was visited.
  /// @param exact    summary computed from its points
  /// @param compare  false when the child's summary was already reported as wrong
  void close_child(OpenGroup& open, const NodeSummary& exact, std::uint64_t points, bool compare) {
    const NodeSummary& stored = open.group.children[open.next].node;
    if (const auto wrong =
            compare ? compare_summary(stored, exact, open.group.level) : std::nullopt) {
      fault(open, wrong->clause, fmt::format("child {}: {}", open.next, wrong->text));
    }
    open.exact[open.next] = exact;
    open.points += points;
    ++open.next;
  }

  /// Closes the innermost group, and combines its children's summaries into that of its parent's
  /// child.
  void leave() {
    const OpenGroup open = std::move(path_.back());
    path_.pop_back();
    if (!open.complete) return leave_incomplete();
    const std::size_t count = open.group.children.size();
    const bool emits = std::any_of(open.exact.begin(), open.exact.begin() + count,
                                   [](const NodeSummary& node) { return node.emits; });
    if (emits != emits_light(open.group)) {
      fault(open, kEmission,
            emits ? "a point below it emits light, but it says otherwise"
                  : "it has columns of emission, but no point below it emits light");
    }
    if (count > 1 && open.points <= superblock_.leaf_points) {
      fault(open, kLeaf, fmt::format("it splits {} points, which fit into one leaf", open.points));
    }
    if (path_.empty()) return;
    std::array<const NodeSummary*, kMaxChildren> parts{};
    for (std::size_t i = 0; i < count; ++i) parts[i] = &open.exact[i];
    close_child(path_.back(), summarise_nodes(std::span(parts).first(count)), open.points, true);
  }

  const ContainerReader& container_;
  const Superblock& superblock_;
  PageNumbers::Range node_pages_;
  const std::vector<bool>& damaged_;
  TreeReport report_;
  Progress& progress_;
  NodePages pages_;
  ReachedGroups reached_;
  PointRuns points_;
  std::vector<OpenGroup> path_;  ///< open groups from the root, at most 63 because levels ascend
  TreeCounts counts_;
  bool at_seam_ = false;  ///< what is checked lies between the top of a scene and what is below it
  std::uint64_t next_point_ = 0;  ///< number of the point that the next leaf begins with
  bool resume_ =
      false;  ///< something was skipped, so that the next leaf may begin at a later point
};

}  // namespace

TreeCounts verify_tree(const ContainerReader& container, const std::vector<bool>& damaged,
                       std::size_t cached_pages, Findings& findings, Progress& progress) {
  return TreeWalk(container, damaged, cached_pages, findings, progress).run();
}

}  // namespace ptc
