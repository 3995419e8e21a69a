#include "engine/shade/scene_view.h"

#include "format/error.h"

namespace ptc {

SceneView::SceneView(const ContainerReader& container)
    : container_(&container),
      frame_(container.superblock().frame),
      points_(container.superblock().points),
      points_per_page_(container.superblock().points_per_page) {
  const Superblock& superblock = container.superblock();
  root_.interior = superblock.root_page != kNoPage;
  root_.page = superblock.root_page;
  root_.slot = superblock.root_slot;
}

GroupView SceneReader::group(std::uint32_t page, std::uint16_t slot) {
  const PageReader::Page view = pages_.get(page);
  const NodePage nodes(view.payload, view.record_count);
  if (slot >= nodes.size()) {
    throw FormatError(0, "spec/nodes.md#references", "a node refers to a group that its page does not hold");
  }
  return nodes[slot];
}

}  // namespace ptc
