#include "tools/bench/chart/label_placer.h"

#include <algorithm>
#include <cmath>

namespace ptc {
namespace {

constexpr double kDotDistance = 1.5;  // between the dots that stand for a line, units

bool overlap(const Box& a, const Box& b) {
  return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}

}  // namespace

void LabelPlacer::block(const Box& box) {
  blocked_.push_back(box);
}

void LabelPlacer::avoid(Spot from, Spot to) {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  const int count = static_cast<int>(std::min(length / kDotDistance, 1e4));
  for (int i = 0; i <= count; ++i) {
    const double share = count == 0 ? 0 : static_cast<double>(i) / count;
    avoided_.push_back({from.x + share * (to.x - from.x), from.y + share * (to.y - from.y)});
  }
}

std::optional<Box> LabelPlacer::place(std::span<const Box> candidates) {
  std::optional<Box> best;
  std::ptrdiff_t least = 0;
  for (const Box& box : candidates) {
    if (!is_free(box)) continue;
    const std::ptrdiff_t dots = dots_under(box);
    if (best && dots >= least) continue;
    best = box;
    least = dots;
  }
  if (best) block(*best);
  return best;
}

std::array<Box, 8> boxes_around(Spot spot, double distance, double width, double height) {
  // -1: left of or above the spot; 0: at its middle; 1: right of or below it
  struct Side {
    int x, y;
  };
  constexpr std::array<Side, 8> kSides = {
      {{1, -1}, {-1, -1}, {1, 1}, {-1, 1}, {0, -1}, {0, 1}, {1, 0}, {-1, 0}}};
  std::array<Box, 8> boxes;
  for (std::size_t i = 0; i < kSides.size(); ++i) {
    const Side side = kSides[i];
    const double away =
        side.x != 0 && side.y != 0 ? distance * 0.6 : distance;  // a corner is nearer
    const double x = spot.x + side.x * (away + width / 2);
    const double y = spot.y + side.y * (away + height / 2);
    boxes[i] = {x - width / 2, y - height / 2, x + width / 2, y + height / 2};
  }
  return boxes;
}

bool LabelPlacer::is_free(const Box& box) const {
  return box.left >= area_.left && box.right <= area_.right && box.top >= area_.top &&
         box.bottom <= area_.bottom &&
         std::ranges::none_of(blocked_, [&](const Box& other) { return overlap(box, other); });
}

std::ptrdiff_t LabelPlacer::dots_under(const Box& box) const {
  return std::ranges::count_if(avoided_, [&](const Spot& dot) {
    return dot.x > box.left && dot.x < box.right && dot.y > box.top && dot.y < box.bottom;
  });
}

}  // namespace ptc
