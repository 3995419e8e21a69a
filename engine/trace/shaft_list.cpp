#include "engine/trace/shaft_list.h"

#include <algorithm>

namespace ptc {

void ShaftList::list_root(const DecodedTree& tree) {
  words_.clear();
  items_.clear();
  const ChildRef& root = tree.view().root();
  list_.size = 0;
  if (!root.interior) return;
  // One box that holds everything
  ListedBox all;
  all.reference = root.page | std::uint64_t{root.slot} << 32;
  all.interior = true;
  constexpr float kFar = 0x1p100F;
  for (std::size_t k = 0; k < 3; ++k) {
    all.columns[kLowX + k] = -kFar;
    all.columns[kHighX + k] = kFar;
  }
  all.columns[kSlabX] = 1;
  all.columns[kSlabLow] = -kFar;
  all.columns[kSlabHigh] = kFar;
  items_.push_back(all);
  make_list(items_, list_, words_);
}

void ShaftList::list_along(DecodedTree& tree, const glm::dvec3& place, const Shaft& shaft,
                           float spread) {
  items_.clear();
  opened_.clear();
  const ChildRef& root = tree.view().root();
  if (root.interior) opened_.push_back(root.page | std::uint64_t{root.slot} << 32);
  WalkLimit limit(tree.view());
  const float width = std::max({shaft.high[0] - shaft.low[0], shaft.high[1] - shaft.low[1]});
  // Open what is larger than the shaft is wide, breadth first, while the list has room
  alignas(64) float near[kTraceLanes];
  for (std::size_t next = 0; next < opened_.size(); ++next) {
    limit.take_group();
    const TraceGroup& group = tree.group(opened_[next]);
    const Beginning from(place, group.anchor);
    const unsigned met = meet_shaft(group, from, shaft, near);
    for (std::size_t i = 0; i < kTraceLanes; ++i) {
      if ((met >> i & 1) == 0) continue;
      ListedBox item(group, i, from);
      const std::size_t planned = items_.size() + (opened_.size() - next) * kTraceLanes;
      if (item.interior && item.extent() > width + spread * near[i] &&
          planned < BoxList::kCapacity - kTraceLanes) {
        opened_.push_back(item.reference);
        continue;
      }
      item.distance = near[i];
      items_.push_back(item);
    }
  }
  make_list(items_, list_, words_);
}

}  // namespace ptc
