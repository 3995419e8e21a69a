// Two neighbours of the sample lie in different children of the smallest cell that holds both. If
// that cell holds more than leaf_points points, it is split in any tree over more points, too, and
// no leaf goes across the border of the child that the second one lies in:
//
//   sample   k0   k1   k2   k3   k4      leaf_points = 4: k0 to k4 lie in one cell of level 3
//   level       5    3    4    3         cuts: before k2 and before k4
#include "engine/pipeline/farm/cuts.h"

#include <algorithm>
#include <optional>

namespace ptc {
namespace {

/// Keys of a sample, all different.
class Sample {
 public:
  Sample(std::span<const MortonKey> keys, std::uint32_t leaf_points)
      : keys_(keys.begin(), keys.end()), leaf_points_(leaf_points) {
    keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());
  }

  [[nodiscard]] std::size_t size() const noexcept { return keys_.size(); }

  /// Returns the key of a cut between a key and the one before, if no leaf can go across it.
  [[nodiscard]] std::optional<MortonKey> cut_before(std::size_t at) const {
    const int level = common_level(keys_[at - 1], keys_[at]);
    // Count what the cell around both holds, as far as it must be known
    const auto inside = [&](std::size_t i) { return common_level(keys_[i], keys_[at]) >= level; };
    std::size_t begin = at, end = at;
    while (begin > 0 && end - begin <= leaf_points_ && inside(begin - 1)) --begin;
    while (end < size() && end - begin <= leaf_points_ && inside(end)) ++end;
    if (end - begin <= leaf_points_) return std::nullopt;
    return cell_of(keys_[at], level + 1);
  }

 private:
  std::vector<MortonKey> keys_;
  std::uint32_t leaf_points_;
};

}  // namespace

std::vector<MortonKey> choose_cuts(std::span<const MortonKey> keys, std::size_t parts,
                                   std::uint32_t leaf_points) {
  const Sample sample(keys, leaf_points);
  std::vector<MortonKey> cuts;
  for (std::size_t i = 1; i < parts; ++i) {
    // Look for the nearest cut around the place that divides the sample evenly
    const std::size_t wanted = sample.size() * i / parts;
    std::optional<MortonKey> found;
    for (std::size_t away = 0; away <= sample.size() / (2 * parts) && !found; ++away) {
      if (wanted + away > 0 && wanted + away < sample.size())
        found = sample.cut_before(wanted + away);
      if (!found && away < wanted) found = sample.cut_before(wanted - away);
    }
    if (found && (cuts.empty() || cuts.back() < *found)) cuts.push_back(*found);
  }
  return cuts;
}

std::vector<MortonKey> choose_borders(std::span<const MortonKey> sample,
                                      std::span<const MortonKey> cuts, std::size_t per_part) {
  std::vector<MortonKey> borders;
  const auto add = [&](const MortonKey& border) {
    if (borders.empty() || borders.back() < border) borders.push_back(border);
  };
  auto begin = sample.begin();
  for (std::size_t part = 0; part <= cuts.size(); ++part) {
    const bool is_last = part == cuts.size();
    const auto end =
        is_last ? sample.end() : std::ranges::lower_bound(begin, sample.end(), cuts[part]);
    const std::span<const MortonKey> own(begin, end);
    for (std::size_t i = 1; i < per_part && !own.empty(); ++i) add(own[own.size() * i / per_part]);
    if (!is_last) add(cuts[part]);
    begin = end;
  }
  return borders;
}

}  // namespace ptc
