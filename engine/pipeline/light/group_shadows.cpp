#include "engine/pipeline/light/group_shadows.h"

#include <algorithm>
#include <deque>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/scene/light/light_rays.h"

namespace ptc {
namespace {

constexpr LightSampling kSampling{};  // its rays of suns; there are no emitters

/// Returns the lights of each group. There are no emitters.
std::deque<LightRays> lights_of(const std::vector<LightRig>& rigs) {
  std::deque<LightRays> lights;
  for (const LightRig& rig : rigs)
    lights.emplace_back(normalised(rig), std::vector<Emitter>(), glm::dvec3(0), 0);
  return lights;
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
  return ReceiverLight::bytes(scene, rigs, kSampling, threads, back_end);
}

DiscShadows::DiscShadows(const ContainerReader& scene, const std::vector<LightRig>& rigs,
                         Sides sides, BackEnd back_end, const Executor& executor)
    : light_(scene, lights_of(rigs), kSampling, sides, back_end, executor) {}

std::span<const float> DiscShadows::at(std::span<const Receiver> receivers) {
  arrives_.resize(receivers.size());
  open_.resize(receivers.size());
  shadows_.resize(receivers.size() * light_.size());
  for (std::size_t group = 0; group < light_.size(); ++group) {
    light_.irradiance(group, receivers, done_, arrives_, open_);
    for (std::size_t i = 0; i < receivers.size(); ++i)
      shadows_[i * light_.size() + group] = hidden_share(arrives_[i], open_[i]);
  }
  done_ += receivers.size();
  return shadows_;
}

}  // namespace ptc
