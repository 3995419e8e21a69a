#include "tools/bench/hunt/judge.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/quality/error_sums.h"

namespace ptc::bench {
namespace {

/// Occlusion, and light of any channel, beyond which a result is not what it may be: rounding, and
/// what parallax adds to or takes from a sum.
constexpr double kRounding = 1e-5, kParallax = 0.1;

/// Says whether a receiver lies on a disc, in its plane: then half of its hemisphere may be covered
/// or not, by whatever rounding.
bool lies_on_a_disc(const Receiver& receiver, std::span<const Surfel> surfels) {
  return std::ranges::any_of(surfels, [&](const Surfel& surfel) {
    const glm::dvec3 to = surfel.position - receiver.position;
    const auto radius = static_cast<double>(surfel.radius);
    return std::abs(glm::dot(to, glm::dvec3(surfel.normal))) < 1e-3 * radius &&
           glm::length(to) < 1.001 * radius;
  });
}

}  // namespace

const char* name_of(HuntError error) {
  switch (error) {
    case HuntError::occlusion:
      return "occlusion, largest error";
    case HuntError::light:
      return "light, largest error";
    case HuntError::mean:
      return "light, RMS error over its mean";
  }
  return "";
}

bool is_sound(const Shading& shading) {
  const auto occlusion = static_cast<double>(shading.occlusion);
  bool sound = occlusion >= 0 && occlusion <= 1 + kRounding;
  const float length = glm::length(shading.bent_normal);
  sound = sound && std::abs(length - 1) < 1e-3F;
  const glm::vec3 light = brightness(shading);
  for (int c = 0; c < 3; ++c) {
    const auto value = static_cast<double>(light[c]);
    sound = sound && value >= -kParallax && value <= 1 + kParallax;
  }
  return sound;
}

Judgement judge(const HuntScene& scene, const Lab& lab, unsigned rays) {
  Judgement found;
  const std::vector<Surfel> surfels = surfels_of(scene);
  std::vector<Receiver> receivers = receivers_of(scene);
  std::erase_if(receivers, [&](const Receiver& r) { return lies_on_a_disc(r, surfels); });
  if (surfels.empty() || receivers.empty()) return found;
  const SmallScene built(lab, surfels);
  const SkyLight sky = sky_of(scene);
  const auto ours = built.shade(receivers, sky);
  const auto traced = built.trace(two_of_each(receivers), rays, sky);
  // Keep the largest squared errors, and sum
  std::array<double, 2> largest{};
  double square = 0, noise = 0, mean = 0;
  const auto keep = [&](std::size_t i, std::size_t kind, double squared) {
    if (squared <= largest[kind]) return;
    largest[kind] = squared;
    found.worst[kind] = i;
  };
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const Shading &a = traced[2 * i], &b = traced[2 * i + 1];
    found.sound = found.sound && is_sound(ours[i]);
    const auto product = [](float o, float p, float q) {
      return (static_cast<double>(o) - static_cast<double>(p)) *
             (static_cast<double>(o) - static_cast<double>(q));
    };
    keep(i, 0, product(ours[i].occlusion, a.occlusion, b.occlusion));
    const glm::vec3 light = brightness(ours[i]), light_a = brightness(a), light_b = brightness(b);
    for (int c = 0; c < 3; ++c) {
      const double squared = product(light[c], light_a[c], light_b[c]);
      keep(i, 1, squared);
      square += squared;
      noise += std::pow(static_cast<double>(light_a[c]) - static_cast<double>(light_b[c]), 2) / 4;
      mean += static_cast<double>(light_a[c] + light_b[c]) / 2;
    }
  }
  const double count = 3 * static_cast<double>(ours.size());
  mean /= count;
  found.errors = {std::sqrt(largest[0]), std::sqrt(largest[1]),
                  mean >= kLeastLight ? std::sqrt(std::max(0.0, square / count)) / mean : 0};
  found.noise = std::sqrt(noise / count);
  return found;
}

bool same_on_any_threads(const HuntScene& scene, const Lab& lab) {
  constexpr std::size_t kReceivers = 9000;  // three blocks of a shader
  const std::vector<Surfel> surfels = surfels_of(scene);
  const std::vector<Receiver> given = receivers_of(scene);
  std::vector<Receiver> receivers;
  for (std::size_t i = 0; i < kReceivers; ++i) {
    const Receiver &a = given[i % given.size()], &b = given[i / given.size() % given.size()];
    const double share = static_cast<double>(splitmix64(i) >> 11) * 0x1p-53;
    receivers.push_back({glm::mix(a.position, b.position, share * share), a.normal});
  }
  std::vector<std::vector<Shading>> results;
  for (const unsigned threads : {1U, 3U}) {
    const ThreadPool executor(threads);
    results.push_back(SmallScene({lab.work, executor}, surfels).shade(receivers, sky_of(scene)));
  }
  return std::ranges::equal(results[0], results[1], [](const Shading& a, const Shading& b) {
    return a.occlusion == b.occlusion && a.bent_normal == b.bent_normal &&
           a.irradiance == b.irradiance && a.sky == b.sky;
  });
}

}  // namespace ptc::bench
