#include "engine/scan/place_index.h"

#include <algorithm>

namespace ptc {
namespace {

constexpr std::size_t kFanout = 8;  // boxes under a box of the level above

}  // namespace

void LatticeBox::add(const LatticePosition& p) noexcept {
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::min(low[k], p[k]);
    high[k] = std::max(high[k], p[k]);
  }
}

void LatticeBox::add(const LatticeBox& other) noexcept {
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::min(low[k], other.low[k]);
    high[k] = std::max(high[k], other.high[k]);
  }
}

LatticeBox LatticeBox::grown(double margin) const noexcept {
  LatticeBox box = *this;
  for (std::size_t k = 0; k < 3; ++k) {
    box.low[k] -= margin;
    box.high[k] += margin;
  }
  return box;
}

LatticePosition LatticeBox::centre() const noexcept {
  return {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2};
}

bool LatticeBox::overlaps(const LatticeBox& other) const noexcept {
  return low[0] <= other.high[0] && other.low[0] <= high[0] && low[1] <= other.high[1] &&
         other.low[1] <= high[1] && low[2] <= other.high[2] && other.low[2] <= high[2];
}

bool LatticeBox::contains(const LatticeBox& other) const noexcept {
  return low[0] <= other.low[0] && low[1] <= other.low[1] && low[2] <= other.low[2] &&
         other.high[0] <= high[0] && other.high[1] <= high[1] && other.high[2] <= high[2];
}

double LatticeBox::squared_distance(const LatticePosition& p) const noexcept {
  double squared = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double d = std::max({low[k] - p[k], p[k] - high[k], 0.0});
    squared += d * d;
  }
  return squared;
}

PlaceIndex::PlaceIndex(std::uint64_t max_bytes)
    // A seventh more for the levels above, and a vector may reserve twice what it holds.
    : max_pages_(static_cast<std::size_t>(max_bytes / (3 * sizeof(LatticeBox)))) {}

void PlaceIndex::add(const LatticePosition& position) {
  std::vector<LatticeBox>& boxes = levels_.front();
  if (places_ % page_places_ == 0) {
    if (boxes.size() == max_pages_) halve();
    if (places_ % page_places_ == 0) boxes.emplace_back();
  }
  boxes.back().add(position);
  bounds_.add(position);
  ++places_;
}

void PlaceIndex::halve() {
  std::vector<LatticeBox>& boxes = levels_.front();
  const std::size_t count = (boxes.size() + 1) / 2;
  for (std::size_t i = 0; i < count; ++i) {
    LatticeBox box = boxes[2 * i];
    if (2 * i + 1 < boxes.size()) box.add(boxes[2 * i + 1]);
    boxes[i] = box;
  }
  boxes.resize(count);
  page_places_ *= 2;
}

void PlaceIndex::finish() {
  while (levels_.back().size() > 1) {
    const std::vector<LatticeBox>& below = levels_.back();
    std::vector<LatticeBox> boxes((below.size() + kFanout - 1) / kFanout);
    for (std::size_t i = 0; i < below.size(); ++i) boxes[i / kFanout].add(below[i]);
    levels_.push_back(std::move(boxes));
  }
}

void PlaceIndex::overlapping(const LatticeBox& box, std::vector<std::uint32_t>& pages) const {
  pages.clear();
  if (places_ == 0) return;
  // Descend depth first, so that the pages come in order: each level goes on where it stopped.
  std::array<std::size_t, 32> at{}, end{};
  std::size_t level = levels_.size() - 1;
  end[level] = 1;
  while (true) {
    if (at[level] == end[level]) {
      if (++level == levels_.size()) return;
      continue;
    }
    const std::size_t i = at[level]++;
    if (!levels_[level][i].overlaps(box)) continue;
    if (level == 0) {
      pages.push_back(static_cast<std::uint32_t>(i));
      continue;
    }
    --level;
    at[level] = kFanout * i;
    end[level] = std::min(at[level] + kFanout, levels_[level].size());
  }
}

NearestPages::NearestPages(const PlaceIndex& index, const LatticePosition& position)
    : index_(index), position_(position) {
  if (index_.places() > 0) push(index_.levels_.size() - 1, 0);
}

void NearestPages::push(std::size_t level, std::size_t box) {
  entries_.push({index_.levels_[level][box].squared_distance(position_), level, box});
}

std::optional<NearestPages::Page> NearestPages::next() {
  while (!entries_.empty()) {
    const Entry entry = entries_.top();
    entries_.pop();
    if (entry.level == 0) return Page{static_cast<std::uint32_t>(entry.box), entry.squared};
    const std::size_t first = kFanout * entry.box;
    const std::size_t end = std::min(first + kFanout, index_.levels_[entry.level - 1].size());
    for (std::size_t i = first; i < end; ++i) push(entry.level - 1, i);
  }
  return {};
}

}  // namespace ptc
