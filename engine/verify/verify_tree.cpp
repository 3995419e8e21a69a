// Checks the octree against its points (spec/nodes.md#verify). One walk goes from the root through
// the whole tree. It stops before small subtrees, which other walks go through meanwhile, a round
// of them at a time, and adopts what those found in its own order:
//
//   root ....................................
//     top   adopt   adopt  leaf   adopt  ...        the walk from the root
//             |       |             |
//           ( subtree | subtree  |  subtree | ...    a round, over all threads )
//
// The subtrees depend on the file alone, so that sums and findings are the same for any number of
// threads. Where a subtree cannot be adopted, because its points do not follow or because groups
// are shared, the file was written with that fault: then one walk checks all of the tree alone.
#include "engine/verify/verify_tree.h"

#include <algorithm>
#include <atomic>
#include <deque>
#include <limits>
#include <memory>
#include <optional>

#include "engine/verify/tree_walk.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxTreePages = 64;
constexpr std::size_t kMinCachedPages = 8;
constexpr std::uint64_t kSubtreePages = 16;  // a subtree has no more points than these pages
constexpr std::size_t kSubtreesAtOnce = 64;  // of a round, for each walk
constexpr std::size_t kNeighbours = 4;       // subtrees that one walk takes together
constexpr std::size_t kMaxLookAhead = 8192;  // groups that are looked at for one round

/// Points of a subtree, at most.
std::uint64_t subtree_points(const FileHeader& header) noexcept {
  return kSubtreePages * points_per_page(header);
}

/// Bytes of one walk with its share of a round, besides node pages.
std::uint64_t walk_bytes(const Superblock& s) noexcept {
  constexpr std::uint64_t kGroupBytes = 2 * kMaxChildren * sizeof(NodeChild);
  constexpr std::uint64_t kContextBytes = std::uint64_t{2} << 17;  // of zstd, for nodes and points
  return PointRuns::bytes(s) + 2 * (std::uint64_t{1} << s.header.page_shift) + kContextBytes +
         kMaxLevel * kGroupBytes + kSubtreesAtOnce * sizeof(Subtree);
}

/// Looks ahead of a walk for subtrees that are small enough to be walked at once.
class LookAhead {
 public:
  LookAhead(const ContainerReader& container, const std::vector<bool>& damaged, NodePages& pages)
      : node_pages_(container.node_pages()),
        damaged_(damaged),
        pages_(pages),
        limit_(subtree_points(container.header())) {}

  /// Returns the next subtrees, in the order of the walk.
  /// @param rest  children that are still to visit, in the order of the walk
  /// @param most  subtrees to return
  std::deque<Subtree> find(const std::vector<ChildRef>& rest, std::size_t most) {
    found_.clear();
    most_ = most;
    looked_at_ = 0;
    look_at(rest, std::numeric_limits<std::uint64_t>::max(), -1);
    return std::move(found_);
  }

 private:
  /// Looks at neighbouring children.
  /// @param end    number of the first point behind the last child
  /// @param level  of their group
  void look_at(const std::vector<ChildRef>& children, std::uint64_t end, int level) {
    std::uint64_t begin = children.empty() ? end : first_point(children.front());
    for (std::size_t i = 0; i < children.size(); ++i) {
      if (found_.size() == most_ || looked_at_ == kMaxLookAhead) return;
      const std::uint64_t next = i + 1 < children.size() ? first_point(children[i + 1]) : end;
      if (children[i].interior) look_at(children[i], begin, next, level);
      begin = next;
    }
  }

  /// Takes the subtree below a child, if it is small, or looks at its children. Where the number of
  /// a first point is not known or wrong, a subtree may seem larger or smaller than it is.
  void look_at(const ChildRef& child, std::uint64_t begin, std::uint64_t end, int level) {
    const std::uint32_t page = node_pages_[child.page];
    if (damaged_[page]) return;
    if (end - begin <= limit_) {
      found_.push_back({.page = page, .slot = child.slot});
      return;
    }
    ++looked_at_;
    const GroupView group = pages_.page(page).nodes[child.slot];
    if (group.level() <= level) return;
    const int own_level = group.level();
    std::vector<ChildRef> children;
    for (int i = 0; i < group.size(); ++i) children.push_back(group.child(i));
    look_at(children, end, own_level);
  }

  /// Returns the number of the first point below a child; 0 where the way there is damaged.
  std::uint64_t first_point(ChildRef child) {
    for (int level = -1; child.interior;) {
      const std::uint32_t page = node_pages_[child.page];
      if (damaged_[page]) return 0;
      const GroupView group = pages_.page(page).nodes[child.slot];
      if (group.level() <= level) return 0;
      level = group.level();
      child = group.child(0);
    }
    return child.first_point;
  }

  PageNumbers::Range node_pages_;
  const std::vector<bool>& damaged_;
  NodePages& pages_;
  std::uint64_t limit_;  ///< points of a subtree
  std::deque<Subtree> found_;
  std::size_t most_ = 0;       ///< subtrees to find
  std::size_t looked_at_ = 0;  ///< groups larger than a subtree
};

/// One check of the whole tree.
class TreeCheck {
 public:
  TreeCheck(const ContainerReader& container, const std::vector<bool>& damaged,
            CheckedPages& checked, const TreeMemory& memory, Findings findings,
            const Executor& executor, Progress& progress)
      : container_(container),
        reached_(container),
        findings_(std::move(findings)),
        walk_(container, damaged, checked, memory.cached_pages, reached_, findings_),
        ahead_(container, damaged, walk_.pages()),
        executor_(executor),
        progress_(progress) {
    for (unsigned i = 0; i < memory.walks; ++i)
      below_.push_back(
          std::make_unique<WalkBelow>(container, damaged, checked, memory.cached_pages, reached_));
  }

  /// Walks through the tree.
  /// @param alone  one walk does it
  /// @return  false when that one has to
  bool run(bool alone) {
    try {
      walk_.begin();
      while (!walk_.done()) {
        if (alone || !begins_subtree()) {
          walk_.step();
        } else if (!adopt()) {
          return false;
        }
        if (const std::uint64_t points = walk_.take_visited()) progress_.advance(points);
      }
      counts_ = walk_.finish();
    } catch (const StopVerifying&) {  // its finding is in findings_
    }
    return alone || !reached_.any_twice();
  }

  /// Returns what the walk found.
  [[nodiscard]] CheckedTree take() { return {counts_, std::move(findings_)}; }

 private:
  /// A walk below one group after another, and what it finds.
  struct WalkBelow {
    WalkBelow(const ContainerReader& container, const std::vector<bool>& damaged,
              CheckedPages& checked, std::size_t cached_pages, ReachedGroups& reached)
        : walk(container, damaged, checked, cached_pages, reached, findings) {}
    Findings findings{Subtree::kFindings, false};
    TreeWalk walk;
  };

  /// Returns whether the next child begins the first of the subtrees that were walked through.
  /// Where none is left, it walks through the next round.
  bool begins_subtree() {
    const ChildRef* const child = walk_.next_child();
    if (child == nullptr || !child->interior) return false;
    if (subtrees_.empty()) walk_round();
    if (subtrees_.empty()) return false;
    const Subtree& next = subtrees_.front();
    return container_.node_pages()[child->page] == next.page && child->slot == next.slot;
  }

  /// Walks through the next subtrees. Each walk takes a few neighbours, because these share pages.
  void walk_round() {
    if (looked_at_all_) return;
    subtrees_ = ahead_.find(walk_.rest(), kSubtreesAtOnce * below_.size());
    looked_at_all_ = subtrees_.empty();
    std::atomic<std::size_t> next = 0;
    executor_.for_each(below_.size(), [&](std::size_t i, unsigned) {
      for (;;) {
        const std::size_t first = next.fetch_add(kNeighbours);
        const std::size_t end = std::min(first + kNeighbours, subtrees_.size());
        if (first >= end) return;
        for (std::size_t k = first; k < end; ++k) below_[i]->walk.walk_below(subtrees_[k]);
      }
    });
  }

  /// Adopts the first of the subtrees. @return false when that is not possible
  bool adopt() {
    Subtree subtree = std::move(subtrees_.front());
    subtrees_.pop_front();
    return walk_.adopt(subtree);
  }

  const ContainerReader& container_;
  ReachedGroups reached_;
  Findings findings_;
  TreeWalk walk_;  ///< from the root
  LookAhead ahead_;
  const Executor& executor_;
  Progress& progress_;
  std::vector<std::unique_ptr<WalkBelow>> below_;
  std::deque<Subtree> subtrees_;  ///< walked through, and not adopted yet
  bool looked_at_all_ = false;    ///< no more subtrees are ahead
  TreeCounts counts_;
};

}  // namespace

std::uint64_t TreeMemory::least_bytes(const Superblock& superblock) noexcept {
  return 2 * (walk_bytes(superblock) + (kMinCachedPages << superblock.header.page_shift));
}

TreeMemory TreeMemory::divided(std::uint64_t bytes, const Superblock& superblock,
                               unsigned threads) noexcept {
  // The walk from the root takes as much as each of the others.
  const std::uint64_t fit = bytes / (least_bytes(superblock) / 2) - 1;
  const std::uint64_t useful = superblock.points / subtree_points(superblock.header) + 1;
  const auto walks = static_cast<unsigned>(std::min({fit, useful, std::uint64_t{threads}}));
  const std::uint64_t pages =
      (bytes / (walks + 1) - walk_bytes(superblock)) >> superblock.header.page_shift;
  return {.walks = walks,
          .cached_pages = static_cast<std::size_t>(std::min<std::uint64_t>(pages, kMaxTreePages))};
}

CheckedTree verify_tree(const ContainerReader& container, const std::vector<bool>& damaged,
                        CheckedPages& checked, const TreeMemory& memory, const Findings& before,
                        const Executor& executor, Progress& progress) {
  const auto make = [&] {
    return std::make_unique<TreeCheck>(container, damaged, checked, memory, before.next(), executor,
                                       progress);
  };
  auto check = make();
  if (!check->run(false)) {
    check.reset();  // its memory is needed
    check = make();
    static_cast<void>(check->run(true));
  }
  return check->take();
}

}  // namespace ptc
