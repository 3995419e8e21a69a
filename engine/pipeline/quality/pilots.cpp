#include "engine/pipeline/quality/pilots.h"

#include <numeric>
#include <utility>

namespace ptc {
namespace {

constexpr std::size_t kMaxBlocks = 128;      // whose receivers are in memory at once
constexpr std::size_t kLeastReceivers = 16;  // of a stretch: a small run has fewer pilots instead

/// Returns the place of the k-th of some receivers that are evenly spread over a stretch.
std::size_t place_of(std::size_t k, std::size_t count, std::size_t length, double phase) {
  const double share = static_cast<double>(length) / static_cast<double>(count);
  return std::min(static_cast<std::size_t>((static_cast<double>(k) + phase) * share), length - 1);
}

/// Shades some receivers of a pilot's block as the run does. Gather::work() tells what they took.
/// @param grid  of the pilot's variant
std::vector<Shading> shade_some(Gather& gather, const Pilot& pilot, std::span<const Compared> some,
                                const DirectionGrid& grid) {
  const std::vector<Receiver>& block = *pilot.block;
  std::vector<float> weights(block.size());
  for (const Compared& one : some) weights[one.at] = static_cast<float>(one.weight);
  std::vector<Shading> all(block.size()), results;
  gather.shade(block, all, grid, weights);
  for (const Compared& one : some) results.push_back(all[one.at]);
  return results;
}

}  // namespace

std::size_t Pilot::candidate_at(std::size_t k) const noexcept {
  return begin + place_of(k, candidates(), end - begin, phase);
}

PilotPlan plan_pilots(std::uint64_t receivers, std::size_t block) {
  if (receivers == 0) return {};
  const std::uint64_t all = (receivers + block - 1) / block;
  const auto blocks = static_cast<std::size_t>(std::min<std::uint64_t>(all, kMaxBlocks));
  return {.blocks = blocks, .stretches = (kEnoughPilots + blocks - 1) / blocks};
}

void add_pilots(std::vector<Pilot>& pilots, std::vector<Receiver> block, unsigned variant,
                std::size_t stretches, double share, double phase) {
  block.shrink_to_fit();
  const std::size_t size = block.size();
  const std::size_t most = std::max(std::min<std::size_t>(size, 2), size / kLeastReceivers);
  const std::size_t count = std::clamp<std::size_t>(stretches, 1, most);
  const auto shared = std::make_shared<const std::vector<Receiver>>(std::move(block));
  for (std::size_t i = 0; i < count; ++i) {
    Pilot pilot{.block = shared,
                .variant = variant,
                .begin = i * size / count,
                .end = (i + 1) * size / count,
                .phase = phase};
    const std::size_t length = pilot.end - pilot.begin;
    const std::size_t compared = std::min(Pilot::kCompared, length);
    pilot.weight = static_cast<double>(length) * share;
    for (std::size_t k = 0; k < compared; ++k) {
      pilot.compared.push_back({.at = pilot.begin + place_of(k, compared, length, phase),
                                .weight = pilot.weight / static_cast<double>(compared)});
    }
    pilots.push_back(std::move(pilot));
  }
}

std::vector<Receiver> compared_of(std::span<const Pilot> pilots) {
  std::vector<Receiver> compared;
  for (const Pilot& pilot : pilots) {
    for (const Compared& one : pilot.compared) compared.push_back((*pilot.block)[one.at]);
  }
  return compared;
}

std::vector<std::size_t> every_pilot(std::span<const Pilot> pilots) {
  std::vector<std::size_t> all(pilots.size());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

ShadedPilots shade_pilots(const SceneView& view, PageCache& cache, const ShadeOptions& options,
                          const GatherOptions& gather, std::span<const Pilot> pilots,
                          std::span<const std::size_t> numbers,
                          const std::function<std::span<const Compared>(std::size_t)>& some_of,
                          const Executor& executor, unsigned turn) {
  const VisibilityMaker visibility = options.visibility_of_sky();
  std::vector<std::unique_ptr<DirectionGrid>> grids;
  for (unsigned i = 0; i < std::max(1U, options.variants); ++i)
    grids.push_back(std::make_unique<DirectionGrid>(gather.resolution, options.sky, i));
  std::vector<std::unique_ptr<Gather>> gathers(executor.threads());
  ShadedPilots shaded{.results = std::vector<std::vector<Shading>>(numbers.size()),
                      .works = std::vector<GatherWork>(numbers.size())};
  executor.for_each(numbers.size(), [&](std::size_t k, unsigned thread) {
    if (!gathers[thread])
      gathers[thread] = std::make_unique<Gather>(view, cache, gather, visibility);
    const Pilot& pilot = pilots[numbers[k]];
    shaded.results[k] = shade_some(*gathers[thread], pilot, some_of(numbers[k]),
                                   *grids[(pilot.variant + turn) % grids.size()]);
    shaded.works[k] = gathers[thread]->work();
  });
  for (const auto& done : gathers) {
    if (done) shaded.receivers += done->counts().receivers;
  }
  return shaded;
}

}  // namespace ptc
