#include "engine/pipeline/quality/pilot_rays.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numbers>

#include <glm/geometric.hpp>

#include "engine/pipeline/quality/error_sums.h"

namespace ptc {
namespace {

constexpr double kFall = 0.6;  // the noise of n rays falls as n^-0.6
// Rays of a result: in the first attempt, and at most
constexpr unsigned kFirstPilotRays = 256, kMostPilotRays = 16384;
// Seeds of the second attempt, which must not know the first
constexpr std::uint64_t kSecondSeed = std::uint64_t{1} << 33;

/// A compared receiver, and what it has of the noise.
struct Noisy {
  double weight = 0;
  double square = 0;  ///< squared noise of a result over the squared means of occlusion and light
};

/// Returns the sums over all compared receivers.
ErrorSums sums_of(std::span<const Pilot> pilots, std::span<const Shading> traced) {
  ErrorSums sums;
  std::size_t i = 0;
  for (const Pilot& pilot : pilots) {
    for (const Compared& one : pilot.compared) {
      sums.add(traced[2 * i], traced[2 * i], traced[2 * i + 1], one.weight);
      ++i;
    }
  }
  return sums;
}

/// Returns the noise of each receiver. Two results tell little of it, so that it is averaged with
/// those of its pilot and of all.
/// @param noise  of a result in the mean of all receivers
std::vector<Noisy> noise_of_each(std::span<const Pilot> pilots, std::span<const Shading> traced,
                                 double noise) {
  const CheckError means = sums_of(pilots, traced).error();
  const auto over = [](double square, double mean) {
    return mean > 0 ? square / (mean * mean) : 0.0;
  };
  std::vector<Noisy> all;
  double weights = 0, sum = 0;
  for (const Pilot& pilot : pilots) {
    for (const Compared& one : pilot.compared) {
      const Shading &a = traced[2 * all.size()], &b = traced[2 * all.size() + 1];
      const double occlusion = static_cast<double>(a.occlusion) - static_cast<double>(b.occlusion);
      const glm::dvec3 light = glm::dvec3(a.irradiance) - glm::dvec3(b.irradiance);
      all.push_back({one.weight, over(occlusion * occlusion / 2, means.occlusion_mean) +
                                     over(glm::dot(light, light) / 6, means.irradiance_mean)});
      weights += one.weight;
      sum += one.weight * all.back().square;
    }
  }
  // What the noise is told by may be the light of the sky, of which occlusion tells the shares
  const double scale = sum > 0 ? noise * noise * weights / sum : 0;
  std::size_t first = 0;
  for (const Pilot& pilot : pilots) {
    const auto own = std::span(all).subspan(first, pilot.compared.size());
    double own_weights = 0, own_sum = 0;
    for (const Noisy& one : own) {
      own_weights += one.weight;
      own_sum += one.weight * one.square;
    }
    for (Noisy& one : own)
      one.square = scale * (one.square + own_sum / own_weights + sum / weights) / 3;
    first += own.size();
  }
  return all;
}

/// Returns rays for each receiver that bring the noise to `asked` with as few as possible: their
/// derivatives of the noise are equal.
std::vector<unsigned> share_rays(std::span<const Noisy> receivers, double asked) {
  constexpr double kPower = 2 * kFall;  // of the rays, by which the squared noise falls
  const auto shape = [](const Noisy& one) {
    return std::pow(one.weight * one.square, 1 / (1 + kPower));
  };
  double weights = 0, sum = 0;
  for (const Noisy& one : receivers) {
    weights += one.weight;
    if (one.square > 0)
      sum += one.weight * one.square * std::pow(kFirstPilotRays / shape(one), kPower);
  }
  const double scale = std::pow(sum / (weights * asked * asked), 1 / kPower);
  std::vector<unsigned> rays;
  for (const Noisy& one : receivers) {
    const double wanted = std::clamp<double>(scale * shape(one), kFirstPilotRays, kMostPilotRays);
    // To the nearest power of 2: few numbers are traced together
    rays.push_back(std::bit_ceil(static_cast<unsigned>(wanted / std::numbers::sqrt2)));
  }
  return rays;
}

}  // namespace

double PilotRays::rays_for(double noise) const {
  return rays_of_noise_1 * std::pow(noise, -1 / kFall);
}

double noise_of(std::span<const Pilot> pilots, std::span<const Shading> traced) {
  // The noise of the sums is that of a mean of two
  return std::numbers::sqrt2 * sums_of(pilots, traced).error().relative_noise();
}

PilotRays trace_evenly(std::span<const Pilot> pilots, unsigned rays, RayShader& discs,
                       Progress& progress) {
  PilotRays result{.compared = compared_of(pilots), .rays = static_cast<double>(rays)};
  const std::vector<Receiver> twice = two_of_each(result.compared);
  result.traced.resize(twice.size());
  discs.trace(twice, rays, 0, result.traced, progress);
  result.rays_of_noise_1 = rays * std::pow(noise_of(pilots, result.traced), 1 / kFall);
  return result;
}

PilotRays trace_for(std::span<const Pilot> pilots, double asked, RayShader& discs,
                    Progress& progress) {
  PilotRays result = trace_evenly(pilots, kFirstPilotRays, discs, progress);
  const double noise = noise_of(pilots, result.traced);
  if (noise <= asked) return result;
  // All anew: those that seem to have little noise may have met it by chance
  const std::vector<unsigned> rays = share_rays(noise_of_each(pilots, result.traced, noise), asked);
  std::map<unsigned, std::vector<std::size_t>> groups;
  for (std::size_t i = 0; i < rays.size(); ++i) groups[rays[i]].push_back(i);
  result.rays = 0;
  std::uint64_t seed = kSecondSeed;
  for (const auto& [count, members] : groups) {
    std::vector<Receiver> some;
    for (const std::size_t i : members) some.insert(some.end(), 2, result.compared[i]);
    std::vector<Shading> traced(some.size());
    discs.trace(some, count, seed, traced, progress);
    seed += some.size();
    for (std::size_t k = 0; k < members.size(); ++k) {
      result.traced[2 * members[k]] = traced[2 * k];
      result.traced[2 * members[k] + 1] = traced[2 * k + 1];
    }
    result.rays += count * static_cast<double>(members.size()) / static_cast<double>(rays.size());
  }
  return result;
}

}  // namespace ptc
