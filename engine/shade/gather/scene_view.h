// The octree of a container as a gather walks it.
#pragma once

#include <cstdint>
#include <utility>

#include "engine/cache/page_cache.h"
#include "engine/shade/lost_pages.h"
#include "engine/shade/scene_scale.h"
#include "format/node_page.h"

namespace ptc {

/// What shading needs of a container besides its pages; shared by all threads.
class SceneView {
 public:
  /// @param lost  outlives the view: pages found damaged are left out; null: they are errors
  explicit SceneView(const ContainerReader& container, LostPages* lost = nullptr);

  [[nodiscard]] const Frame& frame() const noexcept { return frame_; }
  [[nodiscard]] const SceneScale& scale() const noexcept { return scale_; }
  [[nodiscard]] std::uint64_t points() const noexcept { return points_; }
  [[nodiscard]] std::uint64_t groups() const noexcept { return groups_; }
  [[nodiscard]] std::uint32_t points_per_page() const noexcept { return points_per_page_; }
  /// The root group; not interior when the container is empty.
  [[nodiscard]] const ChildRef& root() const noexcept { return root_; }
  [[nodiscard]] LostPages* lost() const noexcept { return lost_; }
  /// Page that holds a point.
  [[nodiscard]] std::uint32_t point_page(std::uint64_t point) const {
    return container_->point_pages()[static_cast<std::size_t>(point / points_per_page_)];
  }
  /// Throws a FormatError that names the file, and the superblock as the place: the tree belies it.
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

/// One thread's way into the octree. What it gives pins a page, so one result lives at a time.
class SceneReader {
 public:
  SceneReader(const SceneView& view, PageCache& cache) : view_(view), pages_(cache) {}

  [[nodiscard]] const SceneView& view() const noexcept { return view_; }
  /// Finds a group.
  /// @throws FormatError when its page does not hold it
  [[nodiscard]] PinnedGroup group(std::uint32_t page, std::uint16_t slot);
  /// Finds the children of a group that need a lost page: bit i for child i.
  [[nodiscard]] unsigned lost_children(std::uint32_t page, std::uint16_t slot);
  /// Pins the page that holds a point.
  [[nodiscard]] PageGuard points(std::uint64_t point) {
    return pages_.pin(view_.point_page(point));
  }

 private:
  [[nodiscard]] bool is_lost(const ChildRef& child);

  const SceneView& view_;
  PageReader pages_;
};

/// What one walk down the tree may still meet: no group or point twice, so a walk ends whatever the
/// references say.
class WalkLimit {
 public:
  explicit WalkLimit(const SceneView& view)
      : view_(view), groups_(view.groups()), points_(view.points()) {}

  /// @throws FormatError when more were met than there are
  void take_group();
  void take_points(std::uint64_t count);

 private:
  const SceneView& view_;
  std::uint64_t groups_;
  std::uint64_t points_;
};

}  // namespace ptc
