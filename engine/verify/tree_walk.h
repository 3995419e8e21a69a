// The walk through the groups of the tree and the points below them, for the whole-file check.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/store/reader.h"
#include "engine/verify/finding.h"
#include "engine/verify/node_pages.h"
#include "engine/verify/point_runs.h"
#include "engine/verify/verify_tree.h"
#include "format/node_page.h"

namespace ptc {

/// Records which groups were reached, with one bit for each: groups are numbered consecutively
/// through all node pages.   Threads: reach() may be called concurrently.
class ReachedGroups {
 public:
  /// @param container  must outlive this
  explicit ReachedGroups(const ContainerReader& container);

  /// Marks a group as reached. Returns false when it was reached before.
  bool reach(std::uint32_t page, std::uint16_t slot) noexcept;
  /// Returns whether a group was reached twice.
  [[nodiscard]] bool any_twice() const noexcept { return twice_; }
  /// Reports the groups that were not reached, with one finding for each page.
  void report_rest(const TreeReport& report) const;

 private:
  [[nodiscard]] bool reached(std::uint64_t group) const noexcept {
    return (bits_[group / 64] >> group % 64 & 1) != 0;
  }

  const ContainerReader& container_;
  std::vector<std::uint64_t> first_;  ///< by page: the number of its first group
  std::vector<std::atomic<std::uint64_t>> bits_;
  std::atomic<bool> twice_ = false;
};

/// A group after all below it was visited.
struct ClosedGroup {
  bool complete = false;     ///< nothing below it was skipped
  std::uint64_t points = 0;  ///< points below it, where it is complete
  NodeSummary exact;         ///< their summary, where it is complete
};

/// What a walk of its own found below one group, for the walk above it to adopt.
struct Subtree {
  /// Findings that are kept. A subtree with more is not adopted.
  static constexpr std::size_t kFindings = 4;

  std::uint32_t page = 0;  ///< where the group lies
  std::uint16_t slot = 0;
  ClosedGroup group;
  TreeCounts counts;  ///< of the groups below the group
  Findings findings{kFindings, false};
  PointTotals points;
  std::optional<std::uint64_t> first_point;  ///< of the first leaf visited
  bool skipped_before = false;               ///< something before that leaf was skipped
  std::uint64_t next_point = 0;              ///< number of the point after the last leaf visited
  bool resume = false;                       ///< something after that leaf was skipped
  std::uint64_t visited = 0;                 ///< points in leaves visited
};

/// A walk, depth first. It checks leaves in the order of their points without a gap. On the way
/// back up, the exact summary of each child's points is combined into that of its parent, so that
/// every stored summary is compared with one computed from the points alone. Where pages are
/// damaged, it skips what they hold: sums above are then unknown and not compared, and the next
/// leaf may begin at a later point.
///
///   path_    root group > child group > ... > leaf      one open group for each level
///                                              |
///   points_  ....read....................[its points].....
///
/// Memory: the cached pages, PointRuns::bytes(), and one group for each level.
class TreeWalk {
 public:
  /// @param container, damaged, checked, reached, findings  must outlive this
  /// @param damaged       by page number, whether the page is damaged
  /// @param cached_pages  node pages that are kept decoded, at least 1
  TreeWalk(const ContainerReader& container, const std::vector<bool>& damaged,
           CheckedPages& checked, std::size_t cached_pages, ReachedGroups& reached,
           Findings& findings);

  /// Enters the root group.
  void begin();
  /// Returns whether the walk has left the root group.
  [[nodiscard]] bool done() const noexcept { return path_.empty(); }
  /// Returns the children of the open groups that are still to visit, in the order of the walk.
  [[nodiscard]] std::vector<ChildRef> rest() const;
  /// Returns the child that step() visits; null where it leaves a group.   @pre !done()
  [[nodiscard]] const ChildRef* next_child() const noexcept;
  /// Visits the next child of the innermost group, or leaves the group after its last child.
  void step();
  /// Takes over what was found below the next child, in place of visiting it.
  /// @param subtree  of the next child
  /// @return  false when the walk would have found something else; it is then of no more use
  [[nodiscard]] bool adopt(Subtree& subtree);
  /// Compares the totals of a complete walk with those of the superblock. @return what was reached
  TreeCounts finish();

  /// Walks below a group, as a walk from the root would once it has entered the group.
  /// @pre done()
  void walk_below(Subtree& subtree);

  /// The node pages that the walk reads, for those who look ahead.
  [[nodiscard]] NodePages& pages() noexcept { return pages_; }
  /// Returns the number of points in leaves visited since the last call.
  [[nodiscard]] std::uint64_t take_visited() noexcept { return std::exchange(visited_, 0); }

 private:
  /// A group on the path from the root, where it lies, and what was found below it so far.
  struct OpenGroup {
    NodeGroup group;
    std::uint32_t page = 0;  ///< page that the group lies in
    std::uint16_t slot = 0;
    std::size_t at = 0;              ///< offset in the decoded payload
    bool raw = false;                ///< it is also the offset in the stored payload
    std::size_t next = 0;            ///< the child to visit next
    std::uint64_t points = 0;        ///< points in the children visited
    int last_octant = -1;            ///< octant of the child visited last, 0 to 7
    bool complete = true;            ///< nothing was skipped in the children visited
    std::vector<NodeSummary> exact;  ///< exact summaries of the children, while it is complete
  };

  [[nodiscard]] OpenGroup open_group(std::uint32_t page, std::uint16_t slot);
  void require_equal(const char* clause, const char* what, std::uint64_t said,
                     std::uint64_t found) const;
  void fault(const OpenGroup& open, const char* clause, const std::string& text) const;
  [[nodiscard]] bool is_top(const OpenGroup& open) const;
  [[nodiscard]] bool begins_seam() const;
  void pass_over();
  void leave_incomplete();
  void enter(std::uint32_t page, std::uint16_t slot);
  [[nodiscard]] bool check_place(const OpenGroup& open);
  void check_root(const OpenGroup& open) const;
  [[nodiscard]] bool check_inside(const OpenGroup& open, OpenGroup& parent) const;
  void check_next_octant(OpenGroup& open, const MortonKey& key) const;
  [[nodiscard]] bool follows(std::uint64_t first_point) const noexcept;
  void visit_leaf(OpenGroup& open, const ChildRef& ref);
  void check_cell(OpenGroup& open, const PointRun& points) const;
  void close_child(OpenGroup& open, const NodeSummary& exact, std::uint64_t points, bool compare);
  [[nodiscard]] ClosedGroup close_group();
  void take_over(const ClosedGroup& group);

  const ContainerReader& container_;
  const Superblock& superblock_;
  PageNumbers::Range node_pages_;
  const std::vector<bool>& damaged_;
  ReachedGroups& reached_;
  Findings& findings_;
  TreeReport report_;
  NodePages pages_;
  PointRuns points_;
  std::vector<OpenGroup> path_;  ///< open groups from the root, at most 63 because levels ascend
  TreeCounts counts_;
  bool at_seam_ = false;  ///< what is checked lies between the top of a scene and what is below it
  std::optional<std::uint64_t> first_point_;  ///< of the first leaf visited
  bool skipped_before_ = false;               ///< something before that leaf was skipped
  std::uint64_t next_point_ = 0;  ///< number of the point that the next leaf begins with
  bool resume_ =
      false;  ///< something was skipped, so that the next leaf may begin at a later point
  std::uint64_t visited_ = 0;  ///< points in leaves visited
};

}  // namespace ptc
