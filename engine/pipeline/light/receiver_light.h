// The light that reaches receivers straight from suns, lamps and emitters, by shadow rays at the
// discs of a container: for receivers that no other rays light (spec/shading.md#emission).
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/cache/page_cache.h"
#include "engine/pipeline/light/disc_light.h"
#include "engine/scene/light/light_rays.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Lights receivers by one or more sets of lights, each apart.
/// Memory: bytes() and that of the lights.
class ReceiverLight {
 public:
  /// Returns the bytes of memory that it takes beside the lights.
  /// @param rigs  of the lights of each set
  [[nodiscard]] static std::uint64_t bytes(const ContainerReader& scene,
                                           std::span<const LightRig> rigs,
                                           const LightSampling& sampling, unsigned threads,
                                           BackEnd back_end);

  /// @param scene, executor  must outlive this
  /// @param sets             lights of each set
  ReceiverLight(const ContainerReader& scene, std::deque<LightRays> sets,
                const LightSampling& sampling, Sides sides, BackEnd back_end,
                const Executor& executor);

  /// Number of sets of lights.
  [[nodiscard]] std::size_t size() const noexcept { return lights_.size(); }

  /// Finds the irradiance that the lights of a set bring to receivers, W/m^2. Results depend on the
  /// receivers and their numbers.
  /// @param set        number of the set of lights
  /// @param receivers  neighbours side by side
  /// @param first      number of the first receiver
  /// @param out        for each receiver
  /// @param open       for each receiver: what would arrive if nothing hid it; may be empty
  /// @throws FormatError when a page is damaged; std::system_error
  void irradiance(std::size_t set, std::span<const Receiver> receivers, std::uint64_t first,
                  std::span<glm::vec3> out, std::span<glm::vec3> open = {});

 private:
  SceneView view_;
  PageCache cache_;
  std::deque<LightRays> sets_;
  std::deque<DiscLight> lights_;  ///< for each set
  std::vector<Surfel> surfels_;
  std::vector<float> heights_;
};

}  // namespace ptc
