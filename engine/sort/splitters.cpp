// The splitters are quantiles of a sample. A key that is two quantiles fills a range of its own.
#include "engine/sort/splitters.h"

#include <stdexcept>

namespace ptc {

Splitters::Splitters(std::vector<MortonKey> sample, std::size_t ranges) {
  if (sample.empty() || ranges < 3 || ranges > 0xffff)
    throw std::invalid_argument("Splitters: the sample is empty, or ranges are not 3 to 65535");
  std::ranges::sort(sample);
  for (std::size_t i = 1; i < ranges; ++i) {
    const Whole key = whole(sample[i * sample.size() / ranges]);
    if (keys_.empty() || keys_.back() < key)
      keys_.push_back(key);
    else if (keys_.back() == key && key != kMax)
      keys_.push_back(key + 1);  // the key is two quantiles: end its range right after it
  }
  index();
}

Splitters::Splitters(StateReader& state) {
  const std::uint64_t count = state.get_count(0xfffe);
  state.require(count > 0, "a partition has no ranges");
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto high = state.get<std::uint64_t>(), low = state.get<std::uint64_t>();
    keys_.push_back(whole({high, low}));
    state.require(i == 0 || keys_[i - 1] < keys_[i], "the ranges of a partition do not ascend");
  }
  index();
}

void Splitters::save(StateWriter& state) const {
  state.put(std::uint64_t{keys_.size()});
  for (const Whole& key : keys_) {
    state.put(static_cast<std::uint64_t>(key >> 64));
    state.put(static_cast<std::uint64_t>(key));
  }
}

void Splitters::index() {
  // Choose the smallest cells of which there are at most 32 for each range.
  constexpr std::size_t kCellsPerRange = 32;
  const std::size_t max_cells = kCellsPerRange * size();
  const Whole extent = keys_.back() - keys_.front();
  while (extent >> shift_ >= max_cells) ++shift_;

  // Count the splitters in each cell, then sum up those below.
  below_cell_.assign(static_cast<std::size_t>(extent >> shift_) + 2, 0);
  for (const Whole key : keys_)
    ++below_cell_[static_cast<std::size_t>((key - keys_.front()) >> shift_) + 1];
  for (std::size_t cell = 1; cell < below_cell_.size(); ++cell)
    below_cell_[cell] = static_cast<std::uint16_t>(below_cell_[cell] + below_cell_[cell - 1]);
}

bool Splitters::single_key(std::size_t range) const noexcept {
  if (range == 0) return false;
  const Whole first = keys_[range - 1];
  return first == kMax || (range < keys_.size() && keys_[range] == first + 1);
}

}  // namespace ptc
