// Follows references through the page cache. A page is checked when it is loaded, so what is left
// to check here is that a reference leads somewhere and that no walk goes in circles.
#include "engine/shade/gather/scene_view.h"

#include <array>

#include "format/error.h"
#include "format/point_page.h"

namespace ptc {

SceneView::SceneView(const ContainerReader& container, LostPages* lost)
    : container_(&container),
      lost_(lost),
      frame_(container.header().frame),
      scale_(frame_),
      points_(container.superblock().points),
      groups_(container.superblock().node_groups),
      points_per_page_(ptc::points_per_page(container.header())) {
  const Superblock& superblock = container.superblock();
  root_.interior = superblock.root_page != kNoPage;
  root_.page = superblock.root_page;
  root_.slot = superblock.root_slot;
}

void SceneView::fail(const char* clause, const char* text) const {
  throw FormatError(container_->superblock().file_bytes - 2 * kBlockBytes, clause, text)
      .rebased(0, container_->path().string());
}

PinnedGroup SceneReader::group(std::uint32_t page, std::uint16_t slot) {
  PageGuard guard = pages_.pin(view_.node_page(page));
  const NodePage nodes(guard.payload(), guard.record_count());
  if (slot >= nodes.size()) {
    view_.fail("spec/nodes.md#references", "a node refers to a group that its page does not hold");
  }
  return {std::move(guard), nodes[slot]};
}

unsigned SceneReader::lost_children(std::uint32_t page, std::uint16_t slot) {
  // Copy the references, because looking at their pages needs the pin.
  std::array<ChildRef, 8> children;
  int count = 0;
  {
    const PinnedGroup found = group(page, slot);
    count = found->size();
    for (int i = 0; i < count; ++i) children[static_cast<std::size_t>(i)] = found->child(i);
  }
  unsigned lost = 0;
  for (int i = 0; i < count; ++i)
    lost |= (needs_lost(children[static_cast<std::size_t>(i)]) ? 1U : 0U) << i;
  return lost;
}

bool SceneReader::needs_lost(const ChildRef& child) {
  if (child.interior) return is_lost(view_.node_page(child.page));
  const std::uint64_t end = child.first_point + child.point_count,
                      per_page = view_.points_per_page();
  for (std::uint64_t point = child.first_point; point < end;
       point = (point / per_page + 1) * per_page) {
    if (is_lost(view_.point_page(point))) return true;
  }
  return false;
}

void WalkLimit::take_group() {
  if (groups_-- == 0) view_.fail("spec/nodes.md#references", "a group is the child of two nodes");
}

void WalkLimit::take_points(std::uint64_t count) {
  if (count > points_)
    view_.fail("spec/nodes.md#node-leaf", "leaves hold more points than the file has");
  points_ -= count;
}

}  // namespace ptc
