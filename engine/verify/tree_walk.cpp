// The walk reads tree and points side by side (engine/verify/tree_walk.h). What a walk below one
// group finds depends on what came before only by a few facts: the number and the key of the last
// point, and whether something was skipped. So such walks run side by side, and the walk from the
// root adopts what they found where these facts agree.
#include "engine/verify/tree_walk.h"

#include <algorithm>
#include <array>
#include <span>

#include <fmt/format.h>

#include "engine/octree/octree.h"
#include "engine/octree/summary.h"
#include "engine/store/clauses.h"
#include "engine/verify/verify_node.h"

namespace ptc {
namespace {

constexpr char kLevel[] = "spec/nodes.md#node-level";
constexpr char kCell[] = "spec/nodes.md#node-cell";
constexpr char kChildren[] = "spec/nodes.md#node-children";
constexpr char kLeaf[] = "spec/nodes.md#node-leaf";
constexpr char kEmissionRule[] = "spec/nodes.md#node-emission";
constexpr char kReferences[] = "spec/nodes.md#references";
constexpr char kRoot[] = "spec/container.md#superblock-root";

bool contains(const NodeGroup& group, const MortonKey& key) {
  return cell_of(key, std::min(group.level, kLatticeBits)) == group.cell;
}

}  // namespace

ReachedGroups::ReachedGroups(const ContainerReader& container)
    : container_(container), first_(container.page_count()) {
  std::uint64_t groups = 0;
  for (const std::uint32_t page : container.node_pages()) {
    first_[page] = groups;
    groups += container.entry(page).record_count;
  }
  bits_ = std::vector<std::atomic<std::uint64_t>>(groups / 64 + 1);
}

bool ReachedGroups::reach(std::uint32_t page, std::uint16_t slot) noexcept {
  const std::uint64_t group = first_[page] + slot, bit = std::uint64_t{1} << group % 64;
  if ((bits_[group / 64].fetch_or(bit, std::memory_order_relaxed) & bit) == 0) return true;
  twice_ = true;
  return false;
}

void ReachedGroups::report_rest(const TreeReport& report) const {
  for (const std::uint32_t page : container_.node_pages()) {
    if (!container_.is_own(page)) continue;  // the top leads to some groups of a part
    // Find the first group of the page that was not reached, and count all of them.
    std::uint64_t missed = 0, count = 0;
    for (std::uint64_t slot = 0; slot < container_.entry(page).record_count; ++slot) {
      if (reached(first_[page] + slot)) continue;
      if (count++ == 0) missed = slot;
    }
    if (count == 0) continue;
    report.page(page, 0, kReferences,
                fmt::format("group {} is the child of no node{}", missed,
                            count > 1 ? fmt::format("; other such groups: {}", count - 1) : ""));
  }
}

TreeWalk::TreeWalk(const ContainerReader& container, const std::vector<bool>& damaged,
                   CheckedPages& checked, std::size_t cached_pages, ReachedGroups& reached,
                   Findings& findings)
    : container_(container),
      superblock_(container.superblock()),
      node_pages_(container.node_pages()),
      damaged_(damaged),
      reached_(reached),
      findings_(findings),
      report_(container, findings),
      pages_(container, checked, cached_pages),
      points_(container, damaged, checked, report_) {}

void TreeWalk::begin() {
  // Count the groups of parts, whether the top leads to them or not.
  for (const auto& part : container_.parts()) {
    counts_.groups += part->superblock().node_groups;
    counts_.nodes += part->superblock().nodes;
    counts_.levels = std::max(counts_.levels, int{part->superblock().levels});
  }
  if (superblock_.points > 0) enter(node_pages_[superblock_.root_page], superblock_.root_slot);
}

std::vector<ChildRef> TreeWalk::rest() const {
  std::vector<ChildRef> rest;
  for (std::size_t i = path_.size(); i-- > 0;) {
    const std::vector<NodeChild>& children = path_[i].group.children;
    const bool innermost = i + 1 == path_.size();
    for (std::size_t k = path_[i].next + (innermost ? 0 : 1); k < children.size(); ++k)
      rest.push_back(children[k].ref);
  }
  return rest;
}

const ChildRef* TreeWalk::next_child() const noexcept {
  const OpenGroup& open = path_.back();
  const bool ended = open.next == open.group.children.size();
  return ended ? nullptr : &open.group.children[open.next].ref;
}

void TreeWalk::step() {
  const ChildRef* const ref = next_child();
  if (ref == nullptr) {
    take_over(close_group());
  } else if (ref->interior) {
    enter(node_pages_[ref->page], ref->slot);
  } else {
    visit_leaf(path_.back(), *ref);
  }
}

bool TreeWalk::adopt(Subtree& subtree) {
  // Enter the group, whose place was not checked yet.
  const std::size_t depth = path_.size();
  enter(subtree.page, subtree.slot);
  if (path_.size() == depth) return true;  // passed over
  // Compare what the other walk took for granted.
  const bool skipped = resume_ || subtree.skipped_before;
  if (const auto first = subtree.first_point) {
    if (*first != next_point_ && !(skipped && *first > next_point_)) return false;
    next_point_ = subtree.next_point;
  }
  resume_ = subtree.first_point ? subtree.resume : skipped;
  if (!points_.append(subtree.points)) return false;
  if (!findings_.append(subtree.findings)) return false;
  // Add up what it found, and go on behind the group.
  counts_.groups += subtree.counts.groups;
  counts_.nodes += subtree.counts.nodes;
  counts_.levels = std::max(counts_.levels, subtree.counts.levels);
  counts_.complete &= subtree.counts.complete;
  visited_ += subtree.visited;
  path_.pop_back();
  take_over(subtree.group);
  return true;
}

TreeCounts TreeWalk::finish() {
  // Compare the totals with the superblock's, unless a part was skipped.
  if (!counts_.complete) return counts_;
  reached_.report_rest(report_);
  points_.compare();
  require_equal(clause::kSuperblockCounts, "nodes", superblock_.nodes, counts_.nodes);
  require_equal(clause::kSuperblockCounts, "node groups", superblock_.node_groups, counts_.groups);
  require_equal(kRoot, "levels", superblock_.levels, static_cast<std::uint64_t>(counts_.levels));
  return counts_;
}

void TreeWalk::walk_below(Subtree& subtree) {
  // Take for granted that the first leaf follows what came before.
  counts_ = {};
  first_point_.reset();
  skipped_before_ = false;
  next_point_ = 0;
  resume_ = true;
  // Walk.
  path_.push_back(open_group(subtree.page, subtree.slot));
  while (path_.size() > 1 || next_child() != nullptr) step();
  subtree.group = close_group();
  // Hand over.
  subtree.counts = counts_;
  subtree.findings = std::exchange(findings_, Findings(Subtree::kFindings, false));
  subtree.points = points_.finish();
  subtree.first_point = first_point_;
  subtree.skipped_before = skipped_before_;
  subtree.next_point = next_point_;
  subtree.resume = resume_;
  subtree.visited = take_visited();
}

/// Decodes a group, and notes where it lies for messages.
TreeWalk::OpenGroup TreeWalk::open_group(std::uint32_t page, std::uint16_t slot) {
  const NodePages::Place place = pages_.page(page);
  OpenGroup opened{.group = place.nodes.decode(slot),
                   .page = page,
                   .slot = slot,
                   .at = static_cast<std::size_t>(place.nodes[slot].bytes().data() - place.payload),
                   .raw = place.raw};
  opened.exact.reserve(opened.group.children.size());
  return opened;
}

void TreeWalk::require_equal(const char* clause, const char* what, std::uint64_t said,
                             std::uint64_t found) const {
  if (said == found) return;
  report_.superblock(
      clause, fmt::format("the superblock records {} {}, but the tree has {}", said, what, found));
}

void TreeWalk::fault(const OpenGroup& open, const char* clause, const std::string& text) const {
  const std::string place = (open.raw ? "" : fmt::format("decoded byte {}: ", open.at)) +
                            fmt::format("group {}: ", open.slot);
  report_.page(open.page, kPageHeaderBytes + (open.raw ? open.at : 0),
               at_seam_ ? clause::kPartsTop : clause, place + text);
}

/// Says whether what hangs below a group is a seam: the group is of the top of a scene of parts.
bool TreeWalk::is_top(const OpenGroup& open) const {
  return !container_.parts().empty() && container_.is_own(open.page);
}

/// Says whether the leaf that is visited is the first below a group of the top.
bool TreeWalk::begins_seam() const {
  for (std::size_t i = path_.size(); i-- > 0;) {
    if (is_top(path_[i])) return true;
    if (path_[i].next > 0) return false;
  }
  return false;
}

/// Skips the next child and everything below it.
void TreeWalk::pass_over() {
  resume_ = true;
  if (!first_point_) skipped_before_ = true;
  leave_incomplete();
}

/// Moves on from the next child, and notes that something below it was skipped.
void TreeWalk::leave_incomplete() {
  counts_.complete = false;
  if (path_.empty()) return;
  path_.back().complete = false;
  ++path_.back().next;
}

/// Opens a group, unless it is damaged or its place in the tree is wrong.
void TreeWalk::enter(std::uint32_t page, std::uint16_t slot) {
  if (damaged_[page]) return pass_over();
  OpenGroup open = open_group(page, slot);
  at_seam_ = !path_.empty() && is_top(path_.back()) && !is_top(open);
  const bool fits = check_place(open);
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
bool TreeWalk::check_place(const OpenGroup& open) {
  if (!reached_.reach(open.page, open.slot)) {
    fault(open, kReferences, "it is the child of two nodes");
    return false;
  }
  if (!path_.empty()) return check_inside(open, path_.back());
  check_root(open);
  return true;
}

void TreeWalk::check_root(const OpenGroup& open) const {
  const std::vector<NodeChild>& children = open.group.children;
  if (children.size() > 1) return;
  if (children[0].ref.interior || open.group.level != 0) {
    fault(open, kChildren, "the root has one child, which is not a leaf at level 0");
  }
}

/// Checks a group against its parent: its level, its cell and its place among the children.
/// @return  false when it is not deeper than its parent, so that the walk might never end
bool TreeWalk::check_inside(const OpenGroup& open, OpenGroup& parent) const {
  const NodeGroup& group = open.group;
  const NodeGroup& around = parent.group;
  if (group.level <= around.level) {
    fault(
        open, kLevel,
        fmt::format("its level {} is not deeper than its parent's, {}", group.level, around.level));
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

/// Checks that the next child lies in a later octant than the child before it. Below the lattice
/// children differ by rank instead, and a root that is a leaf has no octants.
/// @param key  of any point of the child
void TreeWalk::check_next_octant(OpenGroup& open, const MortonKey& key) const {
  if (open.group.level >= kLatticeBits || open.group.children.size() == 1) return;
  const int digit = octant(key, open.group.level + 1);
  if (digit <= open.last_octant) {
    fault(open, kChildren,
          fmt::format("child {} does not lie in a later octant than the child before", open.next));
  }
  open.last_octant = digit;
}

/// Reads the points of a leaf, and checks their order, their cell and the leaf's summary.
void TreeWalk::visit_leaf(OpenGroup& open, const ChildRef& ref) {
  const auto child_fault = [&](const char* clause, const std::string& text) {
    fault(open, clause, fmt::format("child {}: {}", open.next, text));
  };
  // Check that its points follow those of the leaf before, and are not too many.
  if (ref.first_point != next_point_ && !(resume_ && ref.first_point > next_point_)) {
    at_seam_ = begins_seam();
    child_fault(kLeaf,
                fmt::format("its points begin with number {}, but the next point is number {}",
                            ref.first_point, next_point_));
    at_seam_ = false;
    return pass_over();
  }
  if (!first_point_) first_point_ = ref.first_point;
  resume_ = false;
  next_point_ = container_.next_point(ref.first_point + ref.point_count);
  visited_ += ref.point_count;
  at_seam_ = is_top(open);
  if (ref.point_count > superblock_.leaf_points) {
    child_fault(kLeaf, fmt::format("it has {} points, but a leaf has at most {}", ref.point_count,
                                   superblock_.leaf_points));
  }
  // Read them, and check that they lie in one octant of the group's cell.
  const auto points = points_.take(ref.first_point, ref.point_count);
  if (points) check_cell(open, *points);
  at_seam_ = false;
  if (!points) return pass_over();
  // Check the stored bounds point by point, then the whole summary.
  const auto& [columns, begin, end, pieces] = *points;
  const auto wrong = check_bounds(open.group.children[open.next].node, columns, begin, end);
  if (wrong) child_fault(wrong->clause, wrong->text);
  close_child(open, summarise_points(columns, begin, end), end - begin, !wrong);
}

/// Checks that the points of the next child lie in one octant of the group's cell.
void TreeWalk::check_cell(OpenGroup& open, const PointRun& points) const {
  const auto inside = [&](const MortonKey& key) { return contains(open.group, key); };
  const auto piece_inside = [&](const auto& ends) { return std::ranges::all_of(ends, inside); };
  if (!std::ranges::all_of(points.pieces, piece_inside)) {
    fault(open, kCell, fmt::format("child {}: its points lie outside the cell", open.next));
    return;
  }
  const MortonKey& first = points.pieces.front()[0];
  check_next_octant(open, first);
  const int level = open.group.level + 1;
  if (level > kLatticeBits || open.group.children.size() == 1) return;
  if (octant(first, level) != octant(points.pieces.back()[1], level)) {
    fault(open, kChildren, fmt::format("child {} has points in more than one octant", open.next));
  }
}

/// Finishes the next child after all below it was visited.
/// @param exact    summary computed from its points
/// @param compare  false when the child's summary was already reported as wrong
void TreeWalk::close_child(OpenGroup& open, const NodeSummary& exact, std::uint64_t points,
                           bool compare) {
  const NodeSummary& stored = open.group.children[open.next].node;
  if (const auto wrong =
          compare ? compare_summary(stored, exact, open.group.level) : std::nullopt) {
    fault(open, wrong->clause, fmt::format("child {}: {}", open.next, wrong->text));
  }
  if (open.complete) open.exact.push_back(exact);
  open.points += points;
  ++open.next;
}

/// Closes the innermost group, and combines its children's summaries.
ClosedGroup TreeWalk::close_group() {
  const OpenGroup open = std::move(path_.back());
  path_.pop_back();
  if (!open.complete) return {};
  const bool emits = std::ranges::any_of(open.exact, &NodeSummary::emits);
  if (emits != emits_light(open.group)) {
    fault(open, kEmissionRule,
          emits ? "a point below it emits light, but it says otherwise"
                : "it has columns of emission, but no point below it emits light");
  }
  if (open.exact.size() > 1 && open.points <= superblock_.leaf_points) {
    fault(open, kLeaf, fmt::format("it splits {} points, which fit into one leaf", open.points));
  }
  std::array<const NodeSummary*, kMaxChildren> parts{};
  std::ranges::transform(open.exact, parts.begin(), [](const NodeSummary& node) { return &node; });
  return {true, open.points, summarise_nodes(std::span(parts).first(open.exact.size()))};
}

/// Finishes the next child of the innermost group, which was the group that is closed now.
void TreeWalk::take_over(const ClosedGroup& group) {
  if (!group.complete) return leave_incomplete();
  if (!path_.empty()) close_child(path_.back(), group.exact, group.points, true);
}

}  // namespace ptc
