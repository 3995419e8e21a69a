#include "engine/pipeline/convert/level_source.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/cache/page_cache.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/reference/plain_cluster.h"

namespace ptc {
namespace {

constexpr std::uint64_t kCacheBytes = std::uint64_t{16} << 20;

/// Returns the axis that most of a cluster's area faces.
glm::vec3 main_axis(const Cluster& cluster) {
  const auto face = std::ranges::max_element(cluster.facing) - cluster.facing.begin();
  glm::vec3 axis(0);
  axis[static_cast<int>(face / 2)] = face % 2 == 0 ? 1.0F : -1.0F;
  return axis;
}

/// The clusters of a level in the order of the curve.
class LevelPoints : public PointSource {
 public:
  LevelPoints(const ContainerReader& container, unsigned level, const std::optional<Bounds>& box)
      : level_(level),
        box_(box),
        view_(container),
        cache_(container, {.memory_bytes = cache_bytes(container)}),
        scene_(view_, cache_),
        limit_(view_) {
    const Frame& frame = view_.frame();
    for (int axis = 0; axis < 3; ++axis)
      middle_[axis] = frame.origin[static_cast<std::size_t>(axis)] + frame.edge / 2;
    if (view_.root().interior) stack_.push_back(view_.root());
  }

  std::size_t next(std::span<Surfel> out) override {
    std::size_t count = 0;
    while (count < out.size() && (at_ < found_.size() || find_more())) out[count++] = found_[at_++];
    return count;
  }

 private:
  static std::uint64_t cache_bytes(const ContainerReader& container) {
    const std::uint64_t page = std::uint64_t{1} << container.header().page_shift;
    const std::uint64_t frames = std::max<std::uint64_t>(2, kCacheBytes / page - 1);
    return PageCache::bytes_for(container, 1, frames);
  }

  /// Visits groups until one has clusters of the level. @return false at the end
  bool find_more() {
    found_.clear();
    at_ = 0;
    while (found_.empty()) {
      if (stack_.empty()) return false;
      const ChildRef next = stack_.back();
      stack_.pop_back();
      limit_.take_group();
      visit(next);
    }
    return true;
  }

  /// Takes the clusters of a group that are of the level, and leaves the others for later.
  void visit(const ChildRef& reference) {
    const PinnedGroup pinned = scene_.group(reference.page, reference.slot);
    const GroupView& group = *pinned;
    const bool is_last = group.level() + 1 >= static_cast<int>(level_);
    std::vector<ChildRef> open;
    for (int i = 0; i < group.size(); ++i) {
      const Cluster cluster = read_cluster(group, i, view_.frame(), middle_);
      if (!meets_box(cluster)) continue;
      const ChildRef child = group.child(i);
      if (child.interior && !is_last) {
        open.push_back(child);
      } else {
        found_.push_back(to_surfel(group, i, cluster));
      }
    }
    stack_.insert(stack_.end(), open.rbegin(), open.rend());
  }

  [[nodiscard]] bool meets_box(const Cluster& cluster) const {
    if (!box_) return true;
    for (int axis = 0; axis < 3; ++axis) {
      const double middle = middle_[axis] + static_cast<double>(cluster.to[axis]);
      const double radius = static_cast<double>(cluster.radius);
      if (middle + radius < box_->low[axis] || middle - radius > box_->high[axis]) return false;
    }
    return true;
  }

  [[nodiscard]] Surfel to_surfel(const GroupView& group, int i, const Cluster& cluster) const {
    Surfel surfel;
    surfel.position = middle_ + glm::dvec3(cluster.to);
    surfel.normal = cluster.flatness > 0 ? cluster.mean / cluster.flatness : main_axis(cluster);
    surfel.radius = std::sqrt(cluster.area / 2);
    surfel.albedo = glm::vec3(0.5F);
    const Front front = front_of(group, i, cluster, surfel.normal);
    if (front.area > 0) surfel.radiance = front.radiance / front.area;
    return surfel;
  }

  unsigned level_;
  std::optional<Bounds> box_;
  SceneView view_;
  PageCache cache_;
  SceneReader scene_;
  WalkLimit limit_;
  glm::dvec3 middle_{0};  ///< of the frame; clusters are near enough to it for floats
  std::vector<ChildRef> stack_;
  std::vector<Surfel> found_;  ///< clusters of the group that was visited last
  std::size_t at_ = 0;         ///< the next of them
};

}  // namespace

std::unique_ptr<PointSource> open_level(const ContainerReader& container, unsigned level,
                                        const std::optional<Bounds>& box) {
  return std::make_unique<LevelPoints>(container, level, box);
}

}  // namespace ptc
