#include "tools/bench/experiments/rivals.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <tuple>

namespace ptc::bench {

double time_at(const std::vector<TimedError>& measured, double error) {
  const TimedError* above = nullptr;  // the point of the least error that is not smaller
  const TimedError* below = nullptr;  // the point of the greatest error that is not larger
  for (const TimedError& m : measured) {
    if (m.error >= error && (!above || m.error < above->error)) above = &m;
    if (m.error <= error && (!below || m.error > below->error)) below = &m;
  }
  if (!above || !below) return std::numeric_limits<double>::quiet_NaN();
  if (above->error <= below->error) return above->us;
  // Interpolate on the straight line through both points, in logarithms
  const double share = std::log(above->error / error) / std::log(above->error / below->error);
  return std::exp((1 - share) * std::log(above->us) + share * std::log(below->us));
}

void keep_faster_packets(std::vector<AccuracyRow>& rows) {
  using Key = std::tuple<std::string, std::string, Quantity>;
  std::map<Key, std::size_t> fastest;
  std::vector<AccuracyRow> kept;
  for (AccuracyRow& row : rows) {
    const std::string rays = row.setting.substr(0, row.setting.find(" rays,"));
    const auto [at, added] = fastest.try_emplace({row.method, rays, row.job}, kept.size());
    if (added) {
      kept.push_back(std::move(row));
    } else if (row.us_per_receiver.median < kept[at->second].us_per_receiver.median) {
      kept[at->second] = std::move(row);
    }
  }
  rows = std::move(kept);
}

void set_speedups(std::vector<AccuracyRow>& rows) {
  const auto speedup = [&](const AccuracyRow& row, const std::string& rival) {
    std::vector<TimedError> measured;
    for (const AccuracyRow& other : rows) {
      if (other.method == rival && other.job == row.job)
        measured.push_back({other.error().rms, other.us_per_receiver.median});
    }
    return time_at(measured, row.error().rms) / row.us_per_receiver.median;
  };
  for (AccuracyRow& row : rows) {
    row.speedup_discs = speedup(row, "embree-discs");
    row.speedup_mesh = speedup(row, "embree-mesh");
  }
}

}  // namespace ptc::bench
