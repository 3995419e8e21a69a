#include "engine/shade/scene_view.h"

#include "format/error.h"

namespace ptc {

SceneView::SceneView(const ContainerReader& container)
    : container_(&container),
      frame_(container.header().frame),
      points_(container.superblock().points),
      groups_(container.superblock().node_groups),
      points_per_page_(container.superblock().points_per_page) {
  const Superblock& superblock = container.superblock();
  root_.interior = superblock.root_page != kNoPage;
  root_.page = superblock.root_page;
  root_.slot = superblock.root_slot;
}

void SceneView::fail(const char* clause, const char* text) const {
  throw FormatError(container_->superblock().file_bytes - 2 * kBlockBytes, clause, text)
      .rebased(0, container_->path().string());
}

GroupView SceneReader::group(std::uint32_t page, std::uint16_t slot) {
  const PageReader::Page view = pages_.get(page);
  const NodePage nodes(view.payload, view.record_count);
  if (slot >= nodes.size()) {
    view_.fail("spec/nodes.md#references", "a node refers to a group that its page does not hold");
  }
  return nodes[slot];
}

void WalkLimit::take_group() {
  if (groups_-- == 0) view_.fail("spec/nodes.md#references", "a group is the child of two nodes");
}

void WalkLimit::take_points(std::uint64_t count) {
  if (count > points_) view_.fail("spec/nodes.md#node-leaf", "leaves hold more points than there are");
  points_ -= count;
}

}  // namespace ptc
