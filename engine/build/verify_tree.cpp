// The octree against its points (spec/nodes.md#verify).
#include "engine/build/verify_tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <vector>

#include "engine/build/container_points.h"
#include "engine/build/octree.h"
#include "engine/build/verify_node.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr char kLevel[] = "spec/nodes.md#node-level";
constexpr char kCell[] = "spec/nodes.md#node-cell";
constexpr char kChildren[] = "spec/nodes.md#node-children";
constexpr char kLeaf[] = "spec/nodes.md#node-leaf";
constexpr char kReferences[] = "spec/nodes.md#references";
constexpr char kOrder[] = "spec/points.md#point-order";
constexpr char kCounts[] = "spec/container.md#superblock-counts";
constexpr char kRoot[] = "spec/container.md#superblock-root";
constexpr char kTotals[] = "spec/container.md#superblock-totals";

constexpr double kRelative = 1e-6;  // of totals: sums in another order

[[noreturn]] void fail(const ContainerReader& container, std::uint64_t offset, const char* clause,
                       const std::string& text) {
  throw FormatError(offset, clause, text).rebased(0, container.path().string());
}

[[noreturn]] void fail_superblock(const ContainerReader& container, const char* clause,
                                  const std::string& text) {
  fail(container, container.superblock().file_bytes - 2 * kBlockBytes, clause, text);
}

/// A group, where it lies, and what was found below it so far.
struct OpenGroup {
  NodeGroup group;
  std::uint64_t offset = 0;  ///< in the file; of the page's payload when that is compressed
  std::string place;         ///< for messages
  std::size_t next = 0;      ///< child to be visited
  std::uint64_t points = 0;  ///< in the children visited
  int last_octant = -1;      ///< of the child before
  std::array<NodeSummary, kMaxChildren> exact;  ///< of the children visited
};

/// Node pages, the least recently used of which make room.
class NodePages {
 public:
  NodePages(const ContainerReader& container, std::size_t capacity)
      : container_(container), capacity_(capacity) {}

  [[nodiscard]] OpenGroup open(std::uint32_t page, std::uint16_t slot) {
    const Page& found = get(page);
    const NodePage nodes(found.payload.data(), found.header.record_count);
    const auto at = static_cast<std::size_t>(nodes[slot].mean_x() - found.payload.data()) - 24 -
                    8 * static_cast<std::size_t>(nodes[slot].size());
    const bool raw = found.header.coding.codec == Codec::raw;
    OpenGroup opened;
    opened.group = nodes.decode(slot);
    opened.offset = container_.entry(page).offset + kPageHeaderBytes + (raw ? at : 0);
    opened.place = (raw ? "" : fmt::format("decoded byte {}: ", at)) +
                   fmt::format("page {}, group {}: ", page, slot);
    return opened;
  }

 private:
  struct Page {
    PageHeader header;
    std::vector<std::byte> payload;
    std::uint64_t used = 0;
  };

  const Page& get(std::uint32_t page) {
    auto found = pages_.find(page);
    if (found == pages_.end()) found = load(page);
    found->second.used = ++clock_;
    return found->second;
  }

  std::unordered_map<std::uint32_t, Page>::iterator load(std::uint32_t page) {
    Page fresh;
    if (pages_.size() >= capacity_) {
      const auto oldest =
          std::ranges::min_element(pages_, {}, [](const auto& entry) { return entry.second.used; });
      fresh.payload = std::move(oldest->second.payload);
      pages_.erase(oldest);
    }
    fresh.payload.resize(container_.page_payload_limit());
    fresh.header = container_.read_page(page, fresh.payload, decoder_);
    return pages_.emplace(page, std::move(fresh)).first;
  }

  const ContainerReader& container_;
  std::size_t capacity_;
  PageDecoder decoder_;
  std::unordered_map<std::uint32_t, Page> pages_;
  std::uint64_t clock_ = 0;
};

/// Which groups were reached: a bit each, numbered through all node pages.
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

  /// False when it was reached before.
  bool reach(std::uint32_t page, std::uint16_t slot) {
    const std::uint64_t group = first_[page] + slot;
    if (bits_[group]) return false;
    return bits_[group] = true;
  }

  void require_all() const {
    const auto missed = std::ranges::find(bits_, false);
    if (missed == bits_.end()) return;
    const auto group = static_cast<std::uint64_t>(missed - bits_.begin());
    std::uint32_t page = 0;
    for (const std::uint32_t candidate : container_.node_pages()) {
      if (first_[candidate] <= group) page = candidate;
    }
    fail(container_, container_.entry(page).offset, kReferences,
         fmt::format("group {} of page {} is the child of no node", group - first_[page], page));
  }

 private:
  const ContainerReader& container_;
  std::vector<std::uint64_t> first_;  ///< of a node page's groups
  std::vector<bool> bits_;
};

/// Points in their order, with their totals.
class PointTotals {
 public:
  PointTotals(const ContainerReader& container, Progress& progress)
      : container_(container), progress_(progress), points_(container) {}

  [[nodiscard]] std::uint64_t taken() const noexcept { return taken_; }

  /// The next `count` points; valid until the next call.
  std::span<const PointRecord> take(std::size_t count) {
    block_.resize(count);
    if (points_.next(block_) != count) fail_superblock(container_, kCounts, "points are missing");
    for (const PointRecord& point : block_) add(point);
    progress_.advance(count);
    return block_;
  }

  /// Compares the totals with the superblock's.
  void finish() const {
    const Superblock& s = container_.superblock();
    if (taken_ != s.points) {
      fail_superblock(container_, kCounts,
                      fmt::format("leaves hold {} of {} points", taken_, s.points));
    }
    compare("area", s.area, area_);
    for (std::size_t c = 0; c < 3; ++c) compare("flux", s.flux[c], flux_[c]);
    if (s.bounds_low != low_ || s.bounds_high != high_) {
      fail_superblock(container_, kTotals,
                      fmt::format("bounds are not those of the points, {} {} {} to {} {} {}",
                                  low_[0], low_[1], low_[2], high_[0], high_[1], high_[2]));
    }
  }

 private:
  void add(const PointRecord& point) {
    if (point.key < last_) {
      const auto page = container_.point_pages()[taken_ / container_.superblock().points_per_page];
      fail(container_, container_.entry(page).offset + kPageHeaderBytes, kOrder,
           fmt::format("key of point {} is below the one before", taken_));
    }
    last_ = point.key;
    const std::array<double, 3> at =
        container_.superblock().frame.to_position(decode_morton(point.key));
    const double area = 2.0 * static_cast<double>(point.radius) * static_cast<double>(point.radius);
    area_ += area;
    for (std::size_t k = 0; k < 3; ++k) {
      low_[k] = taken_ == 0 ? at[k] : std::min(low_[k], at[k]);
      high_[k] = taken_ == 0 ? at[k] : std::max(high_[k], at[k]);
      flux_[k] += area * static_cast<double>(decode_half(point.radiance[k]));
    }
    ++taken_;
  }

  void compare(const char* what, double said, double found) const {
    if (std::abs(said - found) <= kRelative * std::max(std::abs(said), std::abs(found))) return;
    fail_superblock(container_, kTotals,
                    fmt::format("superblock says {} {}, the points have {}", what, said, found));
  }

  const ContainerReader& container_;
  Progress& progress_;
  ContainerPoints points_;
  std::vector<PointRecord> block_;
  MortonKey last_{};
  std::uint64_t taken_ = 0;
  double area_ = 0;
  std::array<double, 3> flux_{};
  std::array<double, 3> low_{};
  std::array<double, 3> high_{};
};

/// The walk: groups from the root to where it is now.
class TreeWalk {
 public:
  TreeWalk(const ContainerReader& container, std::size_t cached_pages, Progress& progress)
      : container_(container),
        superblock_(container.superblock()),
        pages_(container, cached_pages),
        reached_(container),
        points_(container, progress) {}

  TreeCounts run() {
    if (superblock_.points > 0) {
      push(superblock_.root_page, superblock_.root_slot);
      while (!path_.empty()) step();
    }
    reached_.require_all();
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
    fail_superblock(container_, clause,
                    fmt::format("superblock says {} {}, the tree has {}", said, what, found));
  }

  [[noreturn]] void fail_at(const OpenGroup& open, const char* clause,
                            const std::string& text) const {
    fail(container_, open.offset, clause, open.place + text);
  }

  /// Visits one child, or leaves the innermost group when all were visited.
  void step() {
    OpenGroup& open = path_.back();
    if (open.next == open.group.children.size()) {
      leave();
      return;
    }
    const ChildRef& ref = open.group.children[open.next].ref;
    if (ref.interior) {
      push(ref.page, ref.slot);
    } else {
      visit_leaf(open, ref);
    }
  }

  void push(std::uint32_t page, std::uint16_t slot) {
    OpenGroup open = pages_.open(page, slot);
    const NodeGroup& group = open.group;
    if (!reached_.reach(page, slot)) fail_at(open, kReferences, "is the child of two nodes");
    if (path_.empty()) {
      check_root(open);
    } else {
      check_inside(open, path_.back());
    }
    ++counts_.groups;
    counts_.nodes += group.children.size();
    counts_.levels = std::max(counts_.levels, group.level + 1);
    path_.push_back(std::move(open));
  }

  void check_root(const OpenGroup& open) const {
    const std::vector<NodeChild>& children = open.group.children;
    if (children.size() > 1) return;
    if (children[0].ref.interior || open.group.level != 0) {
      fail_at(open, kChildren, "a root with one child is not a leaf at level 0");
    }
  }

  void check_inside(const OpenGroup& open, OpenGroup& parent) const {
    const NodeGroup& group = open.group;
    const NodeGroup& around = parent.group;
    if (group.children.size() < 2) fail_at(open, kChildren, "has one child and is not the root");
    if (group.level <= around.level) {
      fail_at(open, kLevel,
              fmt::format("level {} is not below its parent's {}", group.level, around.level));
    }
    if (!contains(around, group.cell)) fail_at(open, kCell, "cell lies outside its parent's");
    require_next_octant(parent, group.cell);
  }

  static bool contains(const NodeGroup& group, const MortonKey& key) {
    return cell_of(key, std::min(group.level, kLatticeBits)) == group.cell;
  }

  /// Children lie in octants of their own, in ascending order. Below the lattice rank tells them
  /// apart, and a root that is a leaf has no octants.
  void require_next_octant(OpenGroup& open, const MortonKey& key) const {
    if (open.group.level >= kLatticeBits || open.group.children.size() == 1) return;
    const int digit = octant(key, open.group.level + 1);
    if (digit <= open.last_octant) {
      fail_at(open, kChildren,
              fmt::format("child {} is not in an octant behind the one before", open.next));
    }
    open.last_octant = digit;
  }

  void visit_leaf(OpenGroup& open, const ChildRef& ref) {
    const auto child = [&] { return fmt::format("child {}: ", open.next); };
    if (ref.first_point != points_.taken()) {
      fail_at(open, kLeaf,
              child() + fmt::format("its points begin with {}, the next is {}", ref.first_point,
                                    points_.taken()));
    }
    if (ref.point_count > superblock_.leaf_points) {
      fail_at(open, kLeaf,
              child() + fmt::format("has {} points, a leaf has at most {}", ref.point_count,
                                    superblock_.leaf_points));
    }
    const std::span<const PointRecord> points = points_.take(ref.point_count);
    for (const PointRecord& point : points) {
      if (!contains(open.group, point.key))
        fail_at(open, kCell, child() + "points lie outside the cell");
    }
    require_one_octant(open, points);
    const NodeSummary& stored = open.group.children[open.next].node;
    if (const auto fault = check_bounds(stored, points, superblock_.frame.unit())) {
      fail_at(open, fault->clause, child() + fault->text);
    }
    close_child(open, summarise_points(points, superblock_.frame.unit()), points.size());
  }

  void require_one_octant(OpenGroup& open, std::span<const PointRecord> points) const {
    require_next_octant(open, points.front().key);
    const int level = open.group.level + 1;
    if (level > kLatticeBits || open.group.children.size() == 1) return;
    if (octant(points.front().key, level) != octant(points.back().key, level)) {
      fail_at(open, kChildren, fmt::format("child {} lies in two octants", open.next));
    }
  }

  /// The child that is next was visited: `exact` is what lies below it.
  void close_child(OpenGroup& open, const NodeSummary& exact, std::uint64_t points) {
    const NodeSummary& stored = open.group.children[open.next].node;
    if (const auto fault = compare_summary(stored, exact, open.group.level)) {
      fail_at(open, fault->clause, fmt::format("child {}: {}", open.next, fault->text));
    }
    open.exact[open.next] = exact;
    open.points += points;
    ++open.next;
  }

  void leave() {
    const OpenGroup open = std::move(path_.back());
    path_.pop_back();
    const std::size_t count = open.group.children.size();
    if (count > 1 && open.points <= superblock_.leaf_points) {
      fail_at(open, kLeaf, fmt::format("splits {} points, which are a leaf", open.points));
    }
    if (path_.empty()) return;
    std::array<const NodeSummary*, kMaxChildren> parts{};
    for (std::size_t i = 0; i < count; ++i) parts[i] = &open.exact[i];
    close_child(path_.back(), summarise_nodes(std::span(parts).first(count)), open.points);
  }

  const ContainerReader& container_;
  const Superblock& superblock_;
  NodePages pages_;
  ReachedGroups reached_;
  PointTotals points_;
  std::vector<OpenGroup> path_;  ///< at most 63: levels ascend
  TreeCounts counts_;
};

}  // namespace

TreeCounts verify_tree(const ContainerReader& container, std::size_t cached_pages,
                       Progress& progress) {
  return TreeWalk(container, cached_pages, progress).run();
}

}  // namespace ptc
