#include "engine/scene/sampling/spacing_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/numbers.h"

namespace ptc {
namespace {

constexpr std::size_t kFewCells = 8;  // all of them are looked at
constexpr double kNone = std::numeric_limits<double>::infinity();

}  // namespace

std::size_t SpacingMap::Hash::operator()(const Cell& cell) const noexcept {
  std::uint64_t hash = 0;
  for (const std::int64_t at : cell) hash = splitmix64(hash ^ static_cast<std::uint64_t>(at));
  return hash;
}

SpacingMap::Cell SpacingMap::cell_at(const glm::dvec3& point, double width) {
  Cell cell;
  for (int axis = 0; axis < 3; ++axis) {
    cell[static_cast<std::size_t>(axis)] =
        static_cast<std::int64_t>(std::floor(point[axis] / width));
  }
  return cell;
}

SpacingMap::SpacingMap(std::span<const Wish> wishes, double cell) : cell_(cell), levels_(1) {
  const auto ask = [](Level& level, const Cell& at, double spacing) {
    double& least = level.try_emplace(at, spacing).first->second;
    least = std::min(least, spacing);
  };
  for (const Wish& wish : wishes) ask(levels_[0], cell_at(wish.place, cell_), wish.spacing);
  while (levels_.back().size() > kFewCells) {
    Level wider;
    for (const auto& [at, spacing] : levels_.back())
      ask(wider, {at[0] >> 1, at[1] >> 1, at[2] >> 1}, spacing);
    levels_.push_back(std::move(wider));
  }
}

double SpacingMap::finest(const glm::dvec3& centre, double radius) const {
  std::size_t level = 0;
  double width = cell_;
  for (; width < 2 * radius && level + 1 < levels_.size(); ++level) width *= 2;
  double least = kNone;
  if (width < 2 * radius) {
    for (const auto& [at, spacing] : levels_[level]) least = std::min(least, spacing);
    return least;
  }
  // A ball no wider than a cell touches 8 of them at most
  const Cell low = cell_at(centre - radius, width), high = cell_at(centre + radius, width);
  for (Cell at = low; at[0] <= high[0]; ++at[0]) {
    for (at[1] = low[1]; at[1] <= high[1]; ++at[1]) {
      for (at[2] = low[2]; at[2] <= high[2]; ++at[2]) {
        const auto found = levels_[level].find(at);
        if (found != levels_[level].end()) least = std::min(least, found->second);
      }
    }
  }
  return least;
}

double SpacingMap::at(const glm::dvec3& centre, double radius) const {
  double reach = radius + 0.5 * cell_, least = finest(centre, reach);
  for (; least == kNone; least = finest(centre, reach)) reach *= 2;
  return factor_ * least;
}

}  // namespace ptc
