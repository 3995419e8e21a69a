#include "tools/bench/hunt/hunt.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

namespace ptc::bench {
namespace {

constexpr unsigned kShrinkRays = 4096;

/// Returns places in a list of judgements, those of the largest errors of a kind.
std::vector<std::size_t> largest(const std::vector<Judgement>& judgements, HuntError kind,
                                 std::size_t count) {
  std::vector<std::size_t> order(judgements.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return judgements[a][kind] > judgements[b][kind];
  });
  order.resize(std::min(order.size(), count));
  return order;
}

}  // namespace

Bag hunt(const HuntOptions& options, const Lab& lab, Progress& progress) {
  Bag bag;
  // Judge all scenes
  progress.begin("judge", options.scenes, "scenes");
  for (std::uint64_t i = 0; i < options.scenes; ++i) {
    const std::uint64_t seed = options.first + i;
    const HuntScene scene = draw_scene(seed);
    bag.judgements.push_back(judge(scene, lab, options.rays));
    if (!bag.judgements.back().sound) bag.unsound.push_back(seed);
    if (i % options.threads_every == 0 && !same_on_any_threads(scene, lab))
      bag.uneven.push_back(seed);
    progress.advance(1);
  }
  // Shrink the worst, and keep one of each kind
  progress.begin("shrink", kHuntErrors.size() * std::uint64_t{options.worst}, "scenes");
  for (const HuntError kind : kHuntErrors) {
    std::vector<Prey> found;
    for (const std::size_t i : largest(bag.judgements, kind, options.worst)) {
      const auto measure = [&](const HuntScene& scene) {
        return judge(scene, lab, kShrinkRays)[kind];
      };
      const HuntScene drawn = draw_scene(options.first + i);
      HuntScene small = shrink(drawn, measure, options.budget);
      found.push_back({options.first + i, kind, judge(drawn, lab, options.close_rays)[kind], small,
                       judge(small, lab, options.close_rays)[kind]});
      progress.advance(1);
    }
    std::ranges::stable_sort(found, std::greater(), &Prey::shrunk);
    std::set<std::string> seen;
    for (Prey& prey : found) {
      if (seen.insert(kinds_of(prey.scene)).second) bag.worst.push_back(std::move(prey));
    }
  }
  progress.end();
  return bag;
}

double quantile(const std::vector<double>& sorted, double share) {
  const auto place =
      static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
  return sorted[std::clamp(place, std::size_t{1}, sorted.size()) - 1];
}

}  // namespace ptc::bench
