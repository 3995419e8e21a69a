#include "engine/pipeline/quality/candidates.h"

#include <array>
#include <cmath>

#include <glm/geometric.hpp>

namespace ptc {
namespace {

constexpr double kAlike = 0.25;  // share of the chances that is alike for all

using Signs = std::array<double, 3>;

/// Returns what tells that a receiver may be off by much.
Signs signs_of(const Shading& coarse, const Shading& fine) {
  const glm::dvec3 irradiance(fine.irradiance), other(coarse.irradiance);
  return {std::abs(static_cast<double>(fine.occlusion) - static_cast<double>(coarse.occlusion)),
          glm::length(irradiance - other), glm::length(irradiance)};
}

/// Scales chances so that their sum is `wanted`, with none above 1.
void limit_chances(std::vector<double>& chances, double wanted) {
  std::vector<bool> sure(chances.size());
  double scale = 0;
  for (bool again = true; again;) {
    double sum = 0, left = wanted;
    for (std::size_t i = 0; i < chances.size(); ++i) {
      if (sure[i]) {
        left -= 1;
      } else {
        sum += chances[i];
      }
    }
    scale = sum > 0 ? left / sum : 0;
    again = false;
    for (std::size_t i = 0; i < chances.size(); ++i) {
      if (sure[i] || chances[i] * scale < 1) continue;
      sure[i] = again = true;
    }
  }
  for (std::size_t i = 0; i < chances.size(); ++i) chances[i] = sure[i] ? 1 : chances[i] * scale;
}

/// Returns the chance of each candidate to be compared, up to a factor.
std::vector<double> chances_of(std::span<const Compared> candidates, std::span<const Signs> signs) {
  Signs sums{};
  double weights = 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    weights += candidates[i].weight;
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += candidates[i].weight * signs[i][k];
  }
  std::vector<double> chances;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    double more = 0;
    for (std::size_t k = 0; k < sums.size(); ++k)
      more += sums[k] > 0 ? signs[i][k] * weights / sums[k] : 1;
    const double share = kAlike + (1 - kAlike) * more / static_cast<double>(sums.size());
    chances.push_back(candidates[i].weight * share);
  }
  return chances;
}

}  // namespace

std::vector<Compared> candidates_of(const Pilot& pilot) {
  const std::size_t count = pilot.candidates();
  std::vector<Compared> candidates;
  for (std::size_t k = 0; k < count; ++k)
    candidates.push_back({pilot.candidate_at(k), pilot.weight / static_cast<double>(count)});
  return candidates;
}

void choose_compared(std::span<Pilot> pilots, std::span<const std::vector<Shading>> coarse,
                     std::span<const std::vector<Shading>> fine) {
  // Give each candidate its chance
  std::vector<Compared> candidates;
  std::vector<Signs> signs;
  std::size_t wanted = 0;
  for (std::size_t i = 0; i < pilots.size(); ++i) {
    wanted += pilots[i].compared.size();
    const std::vector<Compared> some = candidates_of(pilots[i]);
    candidates.insert(candidates.end(), some.begin(), some.end());
    for (std::size_t k = 0; k < some.size(); ++k)
      signs.push_back(signs_of(coarse[i][k], fine[i][k]));
  }
  std::vector<double> chances = chances_of(candidates, signs);
  limit_chances(chances, static_cast<double>(wanted));

  // Choose one whenever the chances that were passed add up to another 1
  double passed = pilots.empty() ? 0 : pilots.front().phase;
  std::size_t i = 0;
  for (Pilot& pilot : pilots) {
    const std::size_t end = i + pilot.candidates();
    pilot.compared.clear();
    for (; i < end; ++i) {
      passed += chances[i];
      if (passed < 1) continue;
      passed -= 1;
      pilot.compared.push_back({candidates[i].at, candidates[i].weight / chances[i]});
    }
  }
}

}  // namespace ptc
