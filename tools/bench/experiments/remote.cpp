#include "tools/bench/experiments/remote.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace ptc::bench {

void CountingRanges::read(std::uint64_t offset, std::span<std::byte> out) {
  source_.read(offset, out);
  ++requests_;
  bytes_ += out.size();
}

std::vector<ConeView> views_of(const Superblock& scene) {
  glm::dvec3 low, high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<glm::length_t>(axis);
    low[i] = scene.bounds_low[axis];
    high[i] = scene.bounds_high[axis];
  }
  const glm::dvec3 centre = (low + high) / 2.0, extent = high - low;
  const glm::dvec3 outside = glm::normalize(glm::dvec3(0.6, 0.5, 0.7));
  glm::dvec3 along(0);
  along[extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2] = 1;
  return {{.name = "outside",
           .eye = centre + 1.05 * glm::length(extent) * outside,
           .along = -outside,
           .half_angle = std::numbers::pi},
          {.name = "inside", .eye = centre, .along = along, .half_angle = 0.5}};
}

std::size_t ViewChoice::choose(std::size_t nodes) {
  for (;;) {
    const Division division = divide(nodes);
    // Ask for what divides the nodes that look too large; all that look largest, with too few nodes
    const bool enough = division.nodes >= nodes || division.waiting.empty();
    const double largest =
        enough ? kUnevenness * division.least : division.waiting.front().size / 2;
    std::vector<std::uint32_t> missing;
    for (const Candidate& node : division.waiting) {
      if (node.size > largest) missing.push_back(page_of(node.ref));
    }
    if (missing.empty()) return division.nodes;
    scene_.load(missing);
  }
}

/// Divides the largest node, again and again, and sets those aside whose groups are not loaded.
ViewChoice::Division ViewChoice::divide(std::size_t nodes) const {
  const Superblock& s = scene_.superblock();
  std::vector<Candidate> heap{
      {std::numeric_limits<double>::max(),
       {.interior = true, .page = s.root_page, .slot = static_cast<std::uint16_t>(s.root_slot)}}};
  std::size_t leaves = 0;
  Division out;
  const auto count = [&] { return heap.size() + leaves + out.waiting.size(); };
  while (!heap.empty() && count() < nodes) {
    std::ranges::pop_heap(heap, {}, &Candidate::size);
    const Candidate largest = heap.back();
    heap.pop_back();
    if (scene_.has(page_of(largest.ref))) {
      out.least = largest.size;
      add_group(largest.ref, heap, leaves);
    } else {
      out.waiting.push_back(largest);
    }
  }
  out.nodes = count();
  return out;
}

/// Adds the nodes of a group that are in view.
/// @param leaves  is raised by the number of those that no group divides
void ViewChoice::add_group(const ChildRef& ref, std::vector<Candidate>& heap,
                           std::size_t& leaves) const {
  const Frame& frame = scene_.header().frame;
  for (const NodeChild& child : scene_.nodes(ref.page).decode(ref.slot).children) {
    const auto at = [&](std::size_t axis) {
      return frame.origin[axis] + child.node.mean[axis] * frame.unit();
    };
    const glm::dvec3 to = glm::dvec3(at(0), at(1), at(2)) - view_.eye;
    const double radius = child.node.radius * frame.unit(), distance = glm::length(to);
    if (!in_view(to, distance, radius)) continue;
    if (!child.ref.interior) {
      ++leaves;
      continue;
    }
    heap.push_back({radius / std::max(distance, radius), child.ref});
    std::ranges::push_heap(heap, {}, &Candidate::size);
  }
}

/// Says whether a sphere reaches into the view.
/// @param to  from the eye to its centre
bool ViewChoice::in_view(const glm::dvec3& to, double distance, double radius) const {
  if (distance <= radius) return true;
  const double angle = std::acos(std::clamp(glm::dot(to, view_.along) / distance, -1.0, 1.0));
  return angle - std::asin(radius / distance) <= view_.half_angle;
}

}  // namespace ptc::bench
