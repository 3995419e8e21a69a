#include "engine/pipeline/light/receiver_light.h"

#include <algorithm>
#include <utility>

namespace ptc {
namespace {

constexpr std::uint64_t kCacheBytes = std::uint64_t{24} << 20;

/// @param readers  a thread for each set of lights
std::uint64_t cache_bytes(const ContainerReader& scene, unsigned readers, BackEnd back_end) {
  return std::max(kCacheBytes, PageCache::min_bytes(scene, readers, back_end));
}

unsigned readers_of(std::size_t sets, unsigned threads) {
  return threads * static_cast<unsigned>(sets);
}

}  // namespace

std::uint64_t ReceiverLight::bytes(const ContainerReader& scene, std::span<const LightRig> rigs,
                                   const LightSampling& sampling, unsigned threads,
                                   BackEnd back_end) {
  std::uint64_t sum = cache_bytes(scene, readers_of(rigs.size(), threads), back_end);
  for (const LightRig& rig : rigs) sum += threads * DiscLight::thread_bytes(rig, sampling, 1);
  return sum;
}

ReceiverLight::ReceiverLight(const ContainerReader& scene, std::deque<LightRays> sets,
                             const LightSampling& sampling, Sides sides, BackEnd back_end,
                             const Executor& executor)
    : view_(scene),
      cache_(scene, CacheOptions{.memory_bytes = cache_bytes(
                                     scene, readers_of(sets.size(), executor.threads()), back_end),
                                 .threads = readers_of(sets.size(), executor.threads()),
                                 .back_end = back_end}),
      sets_(std::move(sets)) {
  for (const LightRays& rays : sets_)
    lights_.emplace_back(view_, cache_, rays, sampling, 1, sides, executor);
}

void ReceiverLight::irradiance(std::size_t set, std::span<const Receiver> receivers,
                               std::uint64_t first, std::span<glm::vec3> out,
                               std::span<glm::vec3> open) {
  surfels_.assign(receivers.size(), Surfel{});
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    surfels_[i].position = receivers[i].position;
    surfels_[i].normal = receivers[i].normal;
    surfels_[i].radius = 1;  // any: surfels without extent get no light
  }
  heights_.assign(receivers.size(), 0);
  lights_[set].irradiance(surfels_, heights_, first, out, open);
}

}  // namespace ptc
