// A hash table of cells, and lists of neighbours that are made once.
//
// Three cells in a row along x have successive keys, so that the neighbours of a cell are nine
// ranges of the sorted keys. From one cell to the next, the begin of each range only moves up.
#include "engine/scene/sampling/point_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <glm/common.hpp>

#include "engine/base/low_discrepancy.h"

namespace ptc {

PointCells::PointCells(std::span<const SurfacePoint> points, std::span<const std::uint32_t> groups,
                       std::span<const float> reach)
    : low_(points.front().position), cell_of_(points.size()), table_(1024, kNone) {
  // Measure the points, and choose the width of each level's cells. Keep cell indices within 19
  // bits on each axis: a patch that is wider than that many cells is sparse, and wider cells serve
  // it as well.
  glm::vec3 high = low_;
  for (const SurfacePoint& p : points) {
    low_ = glm::min(low_, p.position);
    high = glm::max(high, p.position);
  }
  const glm::vec3 extent = high - low_;
  const float least = std::max({extent.x, extent.y, extent.z}) / 524000;
  const float widest = *std::max_element(reach.begin(), reach.end());
  for (std::size_t level = 0; level < kLevels; ++level) {
    width_[level] = std::max(
        {std::ldexp(widest, -static_cast<int>(level)), least, std::numeric_limits<float>::min()});
  }
  // Number the cells of all points. A cell may be a little narrower than the reach.
  std::vector<std::size_t> levels(reach.size(), 0);
  for (std::size_t group = 0; group < reach.size(); ++group) {
    while (levels[group] + 1 < kLevels && width_[levels[group] + 1] >= 0.9F * reach[group])
      ++levels[group];
  }
  std::uint64_t last = ~std::uint64_t{0};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t level = levels[groups[i]];
    const std::uint64_t key = key_of(level, index_at(level, points[i].position));
    cell_of_[i] = key == last ? cell_of_[i - 1] : number_of(key);
    last = key;
  }
  sort();
  list_around();
}

std::uint32_t PointCells::find(std::size_t level, const glm::vec3& position) const {
  return table_[slot(key_of(level, index_at(level, position)))];
}

// Indices count from 1 on, so that a neighbour before the first cell is no special case.
PointCells::Index PointCells::index_at(std::size_t level, const glm::vec3& position) const {
  const glm::vec3 at = (position - low_) / width_[level];
  const auto index = [](float c) { return static_cast<std::uint64_t>(std::max(c, 0.0F)) + 1; };
  return {index(at.x), index(at.y), index(at.z)};
}

std::size_t PointCells::slot(std::uint64_t key) const {
  std::size_t i = splitmix64(key) & (table_.size() - 1);
  while (table_[i] != kNone && keys_[table_[i]] != key) i = (i + 1) & (table_.size() - 1);
  return i;
}

std::uint32_t PointCells::number_of(std::uint64_t key) {
  if (2 * keys_.size() >= table_.size()) fill_table(2 * table_.size());
  std::uint32_t& entry = table_[slot(key)];
  if (entry == kNone) {
    entry = static_cast<std::uint32_t>(keys_.size());
    keys_.push_back(key);
  }
  return entry;
}

void PointCells::fill_table(std::size_t size) {
  table_.assign(size, kNone);
  for (std::uint32_t cell = 0; cell < keys_.size(); ++cell) table_[slot(keys_[cell])] = cell;
}

// Numbers the cells by their keys.
void PointCells::sort() {
  std::vector<std::uint32_t> order(keys_.size()), place(keys_.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, {}, [&](std::uint32_t cell) { return keys_[cell]; });
  for (std::uint32_t i = 0; i < order.size(); ++i) place[order[i]] = i;
  for (std::uint32_t& cell : cell_of_) cell = place[cell];
  std::ranges::sort(keys_);
  fill_table(table_.size());
}

void PointCells::list_around() {
  const std::vector<Pair> across = across_levels();
  auto other = across.begin();
  std::array<std::uint32_t, 9> begins{};
  begins_ = {0};
  for (std::uint32_t cell = 0; cell < keys_.size(); ++cell) {
    // Move the begin of each row up to its first cell.
    const std::uint64_t above = keys_[cell] - kUpZ - kUpY - 1;
    for (std::size_t row = 0; row < begins.size(); ++row) {
      const std::uint64_t first = above + row / 3 * kUpZ + row % 3 * kUpY;
      std::uint32_t& begin = begins[row];
      while (begin < keys_.size() && keys_[begin] < first) ++begin;
      std::uint32_t end = begin;
      while (end < keys_.size() && keys_[end] <= first + 2) ++end;
      if (begin < end) around_.push_back({begin, end});
    }
    for (; other != across.end() && other->cell == cell; ++other) around_.push_back(other->range);
    begins_.push_back(static_cast<std::uint32_t>(around_.size()));
  }
}

// Looks from each cell at all coarser levels; what is found there lies around each other.
std::vector<PointCells::Pair> PointCells::across_levels() const {
  std::vector<Pair> pairs;
  for (std::uint32_t cell = 0; cell < keys_.size(); ++cell) {
    const std::size_t own = level_of(cell);
    for (std::size_t level = level_of(0); level < own; ++level) {
      // Find the cell of the level that this one lies in, by its middle.
      const double ratio = static_cast<double>(width_[own]) / static_cast<double>(width_[level]);
      const auto middle = [&](std::uint64_t up) {
        const auto at = static_cast<double>(keys_[cell] / up & kIndexMask);
        return static_cast<std::uint64_t>((at - 0.5) * ratio) + 1;
      };
      const std::uint64_t above =
          key_of(level, {middle(1), middle(kUpY), middle(kUpZ)}) - kUpZ - kUpY - 1;
      for (std::size_t row = 0; row < 9; ++row) {
        const std::uint64_t first = above + row / 3 * kUpZ + row % 3 * kUpY;
        const auto begin = std::ranges::lower_bound(keys_, first);
        const auto end = std::upper_bound(begin, keys_.end(), first + 2);
        if (begin == end) continue;
        const Range range{static_cast<std::uint32_t>(begin - keys_.begin()),
                          static_cast<std::uint32_t>(end - keys_.begin())};
        pairs.push_back({cell, range});
        for (std::uint32_t wide = range.first; wide < range.end; ++wide)
          pairs.push_back({wide, {cell, cell + 1}});
      }
    }
  }
  std::ranges::stable_sort(pairs, {}, &Pair::cell);
  return pairs;
}

}  // namespace ptc
