// A balanced k-d tree from which points are removed.
//
// The tree is implicit: node i splits its range of points_ at the middle and has the children
// 2 i + 1 and 2 i + 2; a range of at most 32 points is a leaf. Every node counts its remaining
// points. Removing a point swaps it behind the remaining points of its leaf and lowers the counts
// on the way down; boxes are not shrunk:
//
//   points_   | remaining | removed || remaining | removed || ...     two leaves
#include "engine/io/mesh/point_tree.h"

#include <algorithm>
#include <limits>
#include <span>

#include <glm/common.hpp>

namespace ptc {
namespace {

constexpr std::size_t kLeafPoints = 32;
// A generous bound on the relative error of a turn. A turn is a difference of two products of
// differences: four roundings of half an epsilon each. They count twice, for a box and for a point
// in it, which makes 4 epsilon; the other 4 cover terms of higher order.
constexpr double kRounding = 8 * std::numeric_limits<double>::epsilon();

// The triangle of a search, against which boxes of points are tested.
class Target {
 public:
  Target(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c)
      : corners_{a, b, c},
        low_(glm::min(a, glm::min(b, c))),
        high_(glm::max(a, glm::max(b, c))),
        size_(high_ - low_),
        sure_area_(turn(a, b, c) - 2 * kRounding * size_.x * size_.y) {}

  // Returns true only if lies_in() is false for every point of the box, however its turns are
  // rounded.
  [[nodiscard]] bool misses(const glm::dvec2& low, const glm::dvec2& high) const noexcept {
    // The coordinates of a point of the box and of a corner differ by no more than this.
    const glm::dvec2 reach = glm::max(high - low_, high_ - low);
    const double off =
        kRounding * (size_.x * reach.y + size_.y * reach.x) + std::numeric_limits<double>::min();
    for (std::size_t i = 0; i < 3; ++i) {
      const glm::dvec2& a = corners_[i];
      const glm::dvec2& b = corners_[(i + 1) % 3];
      // Find the point of the box that lies farthest to the left of the edge.
      const glm::dvec2 most(b.y - a.y > 0 ? low.x : high.x, b.x - a.x > 0 ? high.y : low.y);
      if (turn(a, b, most) < -off) return true;
    }
    // The turns of a point divided by the area are the weights of the corners whose mean it is. At
    // most two of them are negative, and none is below -off / area. So the point lies no farther
    // outside the box around the triangle than 2 off / area times the size of that box.
    if (!(sure_area_ > 0)) return false;
    const glm::dvec2 slack = 2 * off / sure_area_ * size_;
    return low.x > high_.x + slack.x || high.x < low_.x - slack.x || low.y > high_.y + slack.y ||
           high.y < low_.y - slack.y;
  }

 private:
  std::array<glm::dvec2, 3> corners_;
  glm::dvec2 low_, high_, size_;
  double sure_area_;  ///< not more than the true turn of the corners
};

// Splits a range of points the same way in all functions.
constexpr std::size_t middle(std::size_t begin, std::size_t end) {
  return begin + (end - begin) / 2;
}

}  // namespace

PointTree::PointTree(const std::vector<glm::dvec2>& points)
    : points_(points.size()), place_(points.size()) {
  if (points.empty()) return;
  for (std::uint32_t i = 0; i < points.size(); ++i) points_[i] = {points[i], i};
  build(0, {0, points.size()});
  for (std::uint32_t i = 0; i < points_.size(); ++i) place_[points_[i].name] = i;
}

void PointTree::build(std::size_t node, Range range) {
  const auto points = std::span(points_).subspan(range.first, range.second - range.first);
  Node made{points[0].at, points[0].at, static_cast<std::uint32_t>(points.size())};
  for (const Point& p : points) {
    made.low = glm::min(made.low, p.at);
    made.high = glm::max(made.high, p.at);
  }
  if (nodes_.size() <= node) nodes_.resize(node + 1);
  nodes_[node] = made;
  if (points.size() <= kLeafPoints) return;
  const glm::dvec2 size = made.high - made.low;
  const int axis = size.x >= size.y ? 0 : 1;
  const std::size_t mid = middle(range.first, range.second);
  std::ranges::nth_element(points, points.begin() + static_cast<std::ptrdiff_t>(mid - range.first),
                           {}, [axis](const Point& p) { return p.at[axis]; });
  build(2 * node + 1, {range.first, mid});
  build(2 * node + 2, {mid, range.second});
}

std::optional<std::uint32_t> PointTree::find_in(const glm::dvec2& a, const glm::dvec2& b,
                                                const glm::dvec2& c) {
  if (nodes_.empty()) return std::nullopt;
  // Push a node on the stack when the triangle may reach its remaining points.
  const Target target(a, b, c);
  open_.clear();
  const auto look_at = [&](std::size_t node, Range range) {
    if (nodes_[node].left == 0) return;
    ++looks_;
    if (!target.misses(nodes_[node].low, nodes_[node].high)) open_.emplace_back(node, range);
  };

  // Take nodes off the stack; a random bit decides which child is searched first.
  look_at(0, {0, points_.size()});
  while (!open_.empty()) {
    const auto [node, range] = open_.back();
    const auto [begin, end] = range;
    open_.pop_back();
    if (end - begin > kLeafPoints) {
      const std::size_t mid = middle(begin, end);
      const bool swapped = random_bit();
      if (swapped) look_at(2 * node + 2, {mid, end});
      look_at(2 * node + 1, {begin, mid});
      if (!swapped) look_at(2 * node + 2, {mid, end});
      continue;
    }
    for (const Point& p : std::span(points_).subspan(begin, nodes_[node].left)) {
      ++looks_;
      if (lies_in(a, b, c, p.at)) return p.name;
    }
  }
  return std::nullopt;
}

void PointTree::remove(std::uint32_t point) {
  std::size_t node = 0;
  Range range{0, points_.size()};
  for (;;) {
    const std::size_t left = --nodes_[node].left;
    const auto [begin, end] = range;
    if (end - begin <= kLeafPoints) {
      Point& last = points_[begin + left];
      std::swap(place_[point], place_[last.name]);
      std::swap(points_[place_[last.name]], last);
      return;
    }
    const std::size_t mid = middle(begin, end);
    const bool second = place_[point] >= mid;
    range = second ? Range{mid, end} : Range{begin, mid};
    node = 2 * node + (second ? 2 : 1);
  }
}

// Returns the top bit of a linear congruential generator. Source: Knuth, MMIX.
bool PointTree::random_bit() noexcept {
  random_ = random_ * 6364136223846793005U + 1442695040888963407U;
  return random_ >> 63 != 0;
}

}  // namespace ptc
