// The octree of a container as a gather walks it: references lead from groups to groups and to
// points, through the page cache.
#pragma once

#include <cstdint>
#include <utility>

#include "engine/cache/page_cache.h"
#include "engine/shade/lost_pages.h"
#include "engine/shade/scene_scale.h"
#include "format/node_page.h"

namespace ptc {

/// The facts of a container that shading needs in addition to its pages.
/// Threads: shared by all; const members may be called concurrently.
class SceneView {
 public:
  /// Takes the facts from the superblock.
  /// @param container  must outlive this
  /// @param lost       must outlive this; collects damaged pages, which are then left out. Null
  ///                   makes them errors.
  explicit SceneView(const ContainerReader& container, LostPages* lost = nullptr);

  /// Returns the frame of the scene.
  [[nodiscard]] const Frame& frame() const noexcept { return frame_; }
  /// Returns the conversion between scene units and edges of the frame.
  [[nodiscard]] const SceneScale& scale() const noexcept { return scale_; }
  /// Returns the number of points in the container.
  [[nodiscard]] std::uint64_t points() const noexcept { return points_; }
  /// Returns the number of node groups in the container.
  [[nodiscard]] std::uint64_t groups() const noexcept { return groups_; }
  /// Returns the number of points on each point page but the last.
  [[nodiscard]] std::uint32_t points_per_page() const noexcept { return points_per_page_; }
  /// Returns the reference to the root group; it is not interior when the container is empty.
  [[nodiscard]] const ChildRef& root() const noexcept { return root_; }
  /// Returns the set of damaged pages, or null when they are errors.
  [[nodiscard]] LostPages* lost() const noexcept { return lost_; }
  /// Returns the page that holds a point.
  /// @param point  below points()
  [[nodiscard]] std::uint32_t point_page(std::uint64_t point) const {
    return container_->point_pages()[static_cast<std::size_t>(point / points_per_page_)];
  }
  /// Returns the page of the node page of a rank.
  [[nodiscard]] std::uint32_t node_page(std::uint32_t rank) const noexcept {
    return container_->node_pages()[rank];
  }
  /// Returns the bytes of a point on its page.
  [[nodiscard]] std::uint8_t point_bytes() const noexcept {
    return container_->header().point_bytes;
  }
  /// Throws a FormatError that names the file, and as the place its superblock, whose counts the
  /// tree contradicts.
  [[noreturn]] void fail(const char* clause, const char* text) const;

 private:
  const ContainerReader* container_;
  LostPages* lost_;
  Frame frame_;
  SceneScale scale_;
  std::uint64_t points_;
  std::uint64_t groups_;
  std::uint32_t points_per_page_;
  ChildRef root_;
};

/// A sibling group whose page is pinned.
class PinnedGroup {
 public:
  PinnedGroup(PageGuard page, GroupView group) noexcept : page_(std::move(page)), group_(group) {}
  [[nodiscard]] const GroupView& operator*() const noexcept { return group_; }
  [[nodiscard]] const GroupView* operator->() const noexcept { return &group_; }

 private:
  PageGuard page_;
  GroupView group_;
};

/// Reads groups and points of the octree for one thread. What it returns pins a page, so one result
/// lives at a time.
class SceneReader {
 public:
  /// Takes a reader of the cache.
  /// @param view, cache  must outlive this; of the same container
  SceneReader(const SceneView& view, PageCache& cache) : view_(view), pages_(cache) {}

  /// Returns the view that the constructor was given.
  [[nodiscard]] const SceneView& view() const noexcept { return view_; }
  /// Returns a group.
  /// @param page  rank of its node page
  /// @throws FormatError when the reference leads to no group, or the page is damaged
  [[nodiscard]] PinnedGroup group(std::uint32_t page, std::uint16_t slot);
  /// Returns which children of a group need a lost page: bit i for child i.
  [[nodiscard]] unsigned lost_children(std::uint32_t page, std::uint16_t slot);
  /// Reports whether a page is damaged and to be left out. No page may be pinned by this.
  /// @param page  number of the page
  [[nodiscard]] bool is_lost(std::uint32_t page) {
    return view_.lost() && view_.lost()->contains(page, pages_);
  }
  /// Pins the page that holds a point.
  [[nodiscard]] PageGuard points(std::uint64_t point) {
    return pages_.pin(view_.point_page(point));
  }

 private:
  /// Reports whether a child needs a lost page.
  [[nodiscard]] bool needs_lost(const ChildRef& child);

  const SceneView& view_;
  PageReader pages_;
};

/// Counts what one walk down the tree meets. A walk that meets more groups or points than the
/// container has met one of them twice and is stopped, so every walk ends, whatever the references
/// in the file say.
class WalkLimit {
 public:
  /// Begins a walk.
  explicit WalkLimit(const SceneView& view)
      : view_(view), groups_(view.groups()), points_(view.points()) {}

  /// Counts a group. @throws FormatError when the walk met more groups than the container has
  void take_group();
  /// Counts points. @throws FormatError when the walk met more points than the container has
  void take_points(std::uint64_t count);

 private:
  const SceneView& view_;
  std::uint64_t groups_;  ///< groups that the walk may still meet
  std::uint64_t points_;  ///< points that the walk may still meet
};

}  // namespace ptc
