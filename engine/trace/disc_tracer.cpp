#include "engine/trace/disc_tracer.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace ptc {

DiscTracer::DiscTracer(const SceneView& view, PageCache& cache, Sides sides)
    : tree_(view, cache, clear_backs(sides), 1) {}

bool DiscTracer::is_empty(const ChildRef& leaf) {
  for (std::uint32_t done = 0; done < leaf.point_count; done += kTraceDiscs) {
    const auto count = std::min<std::uint32_t>(leaf.point_count - done, kTraceDiscs);
    const TraceLeaf& run = tree_.leaf(leaf.first_point + done, count);
    if (has_disc(run, Beginning(place_, run.anchor), axis_, tree_.rules())) return false;
  }
  return true;
}

void DiscTracer::begin(const glm::dvec3& origin, const glm::vec3& axis) {
  const glm::dvec3 place = tree_.place(origin);
  if (listed_ && place == place_ && axis == axis_) return;
  place_ = place;
  axis_ = axis;
  listed_ = false;
  items_.clear();
  opened_.clear();
  const ChildRef& root = tree_.view().root();
  if (root.interior) opened_.push_back(root.page | std::uint64_t{root.slot} << 32);
  WalkLimit limit(tree_.view());
  // Open what is larger than its distance, breadth first, while the list has room
  for (std::size_t next = 0; next < opened_.size(); ++next) {
    limit.take_group();
    const TraceGroup& group = tree_.group(opened_[next]);
    const Beginning from(place_, group.anchor);
    for (std::size_t i = 0; i < kTraceLanes; ++i) {
      if ((group.children >> i & 1) == 0) continue;
      ListedBox item(group, i, from);
      // Leave out what lies below the horizon
      float square = 0, top = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const float low = item.columns[kLowX + k], high = item.columns[kHighX + k];
        const float gap = std::max({low, -high, 0.0F});
        square += gap * gap;
        const float along = axis[static_cast<int>(k)];
        top += std::max(along * low, along * high);
      }
      if (top <= 0) continue;
      item.distance = std::sqrt(square);
      const float extent = item.extent();
      const std::size_t planned = items_.size() + (opened_.size() - next) * kTraceLanes;
      if (item.interior && extent > item.distance && planned < BoxList::kCapacity - kTraceLanes) {
        opened_.push_back(item.reference);
        continue;
      }
      if (!item.interior) {
        const ChildRef leaf = decode_reference(item.reference, false);
        limit.take_points(leaf.point_count);
        if (extent > item.distance && is_empty(leaf)) continue;
      }
      items_.push_back(item);
    }
  }
  make_list(items_, list_, words_);
  listed_ = true;
}

void DiscTracer::meet(std::span<const glm::vec3> directions, RaysFor wanted,
                      std::span<RayHit> hits) {
  for (std::size_t at = 0; at < directions.size(); at += kTile) {
    const std::size_t count = std::min(kTile, directions.size() - at);
    narrow_boxes(list_, directions.subspan(at, count), tile_);
    for (std::size_t from = at; from < at + count; from += kFew) {
      const std::size_t few = std::min(kFew, at + count - from);
      narrow_boxes(tile_, directions.subspan(from, few), few_);
      trace_rays(tree_, place_, few_, words_, directions.subspan(from, few), wanted,
                 hits.subspan(from, few));
    }
  }
}

}  // namespace ptc
