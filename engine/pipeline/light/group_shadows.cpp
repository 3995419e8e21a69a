#include "engine/pipeline/light/group_shadows.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "engine/base/error.h"

namespace ptc {
namespace {

constexpr std::uint64_t kShadowCacheBytes = std::uint64_t{24} << 20;
constexpr LightSampling kSampling{};  // its rays of suns; there are no emitters

std::uint64_t cache_bytes(const ContainerReader& scene, unsigned threads, BackEnd back_end) {
  return std::max(kShadowCacheBytes, PageCache::min_bytes(scene, threads, back_end));
}

}  // namespace

std::vector<LightRig> rigs_of_groups(const LightRig& rig, std::span<const std::string> groups) {
  std::vector<LightRig> rigs;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    const std::string& group = groups[i];
    const auto before = groups.first(i);
    if (std::ranges::find(before, group) != before.end())
      throw RequestError("shadows", fmt::format("the group '{}' is named twice", group));
    rigs.push_back(only_group(rig, group == kRestGroup ? std::string() : group));
    rigs.back().sky = {};
    if (group.empty() || !has_lamps(rigs.back())) {
      throw RequestError("shadows",
                         fmt::format("no sun, point or spot light of the scene is in the "
                                     "group '{}'",
                                     group));
    }
  }
  return rigs;
}

std::uint64_t DiscShadows::bytes(const ContainerReader& scene, std::span<const LightRig> rigs,
                                 unsigned threads, BackEnd back_end) {
  std::uint64_t sum = cache_bytes(scene, threads, back_end);
  for (const LightRig& rig : rigs) sum += threads * DiscLight::thread_bytes(rig, kSampling);
  return sum;
}

DiscShadows::DiscShadows(const ContainerReader& scene, const std::vector<LightRig>& rigs,
                         Sides sides, BackEnd back_end, const Executor& executor)
    : view_(scene),
      cache_(scene, CacheOptions{.memory_bytes = cache_bytes(scene, executor.threads(), back_end),
                                 .threads = executor.threads() * static_cast<unsigned>(rigs.size()),
                                 .back_end = back_end}) {
  for (const LightRig& rig : rigs) {
    const LightRays& rays =
        rays_.emplace_back(normalised(rig), std::vector<Emitter>(), glm::dvec3(0), 0);
    lights_.emplace_back(view_, cache_, rays, kSampling, sides, executor);
  }
}

std::span<const float> DiscShadows::at(std::span<const Receiver> receivers) {
  // A surfel that has hardly any extent is lit at one place
  surfels_.assign(receivers.size(), Surfel{});
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    surfels_[i].position = receivers[i].position;
    surfels_[i].normal = receivers[i].normal;
    surfels_[i].radius = std::numeric_limits<float>::min();
  }
  heights_.assign(receivers.size(), 0);
  arrives_.resize(receivers.size());
  open_.resize(receivers.size());
  shadows_.resize(receivers.size() * lights_.size());
  for (std::size_t group = 0; group < lights_.size(); ++group) {
    lights_[group].irradiance(surfels_, heights_, done_, arrives_, open_);
    for (std::size_t i = 0; i < receivers.size(); ++i)
      shadows_[i * lights_.size() + group] = hidden_share(arrives_[i], open_[i]);
  }
  done_ += receivers.size();
  return shadows_;
}

}  // namespace ptc
