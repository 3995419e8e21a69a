// The shadows of groups of lights at receivers (spec/shading.md#shadows).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/pipeline/light/receiver_light.h"
#include "engine/scene/light/direct_light.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Returns the suns, point and spot lights of each group, with those of all others switched off.
/// @param groups  kRestGroup stands for the lights in no group
/// @throws RequestError when a group has no sun, point or spot light that shines, or is named twice
[[nodiscard]] std::vector<LightRig> rigs_of_groups(const LightRig& rig,
                                                   std::span<const std::string> groups);

/// Finds the shadows of groups of lights by rays at the discs of a container.
/// Memory: bytes().
class DiscShadows {
 public:
  /// Returns the bytes of memory that shadows take.
  /// @param rigs  of rigs_of_groups()
  [[nodiscard]] static std::uint64_t bytes(const ContainerReader& scene,
                                           std::span<const LightRig> rigs, unsigned threads,
                                           BackEnd back_end);

  /// @param scene, executor  must outlive this
  DiscShadows(const ContainerReader& scene, const std::vector<LightRig>& rigs, Sides sides,
              BackEnd back_end, const Executor& executor);

  /// Finds the shadows at receivers: for each the shadow of every group, as hidden_share(). Results
  /// depend on the receivers and on how many came before.
  /// @param receivers  neighbours side by side
  /// @return           receiver after receiver, valid until the next call
  /// @throws FormatError when a page is damaged; std::system_error
  std::span<const float> at(std::span<const Receiver> receivers);

 private:
  ReceiverLight light_;     ///< a set of lights for each group
  std::uint64_t done_ = 0;  ///< receivers so far
  std::vector<float> shadows_;
  std::vector<glm::vec3> arrives_, open_;
};

}  // namespace ptc
