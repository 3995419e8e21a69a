// A scene with receivers, and how two shadings of them differ.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <vector>

#include "engine/parallel/thread_pool.h"
#include "engine/shade/shader.h"
#include "tests/support/scenes.h"

namespace ptc::test {

/// ShadeOptions::things_left for small scenes: so few that most cells leave clusters unopened.
inline constexpr std::size_t kFewLeft = 40;

/// A container of surfels, its reader, and receivers.
struct Scene {
  TemporaryDirectory dir;
  std::unique_ptr<ContainerReader> container;
  std::vector<Receiver> receivers;

  explicit Scene(const std::vector<Surfel>& surfels, const BuildOptions& options = {}) {
    write_scene(dir / "scene.ptcx", surfels, options);
    container = std::make_unique<ContainerReader>(dir / "scene.ptcx");
  }

  [[nodiscard]] std::vector<Shading> shade(ShadeOptions options = {}, unsigned threads = 1,
                                           unsigned variant = 0) const {
    const ThreadPool executor(threads);
    if (options.cache_bytes > (64U << 20)) options.cache_bytes = 64U << 20;
    Shader shader(*container, options, executor);
    std::vector<Shading> results(receivers.size());
    Progress silent;
    shader.shade(receivers, results, silent, variant);
    return results;
  }
};

inline void add_floor_receivers(std::vector<Receiver>& receivers, double spacing) {
  for (int j = 0; j < 48; ++j) {
    for (int i = 0; i < 48; ++i) {
      receivers.push_back(
          {{-1.5 + 3.0 * (i + 0.5) / 48, -1.5 + 2.9 * (j + 0.5) / 48, 0.1 * spacing}, {0, 0, 1}});
    }
  }
}

struct Errors {
  double occlusion_rms = 0, occlusion_mean = 0, irradiance_rms = 0;
};

inline Errors compare(const std::vector<Shading>& ours, const std::vector<Shading>& theirs) {
  Errors e;
  double square = 0, mean = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    e.occlusion_rms += std::pow(static_cast<double>(ours[i].occlusion - theirs[i].occlusion), 2);
    e.occlusion_mean += static_cast<double>(theirs[i].occlusion);
    square += std::pow(static_cast<double>(ours[i].irradiance.g - theirs[i].irradiance.g), 2);
    mean += static_cast<double>(theirs[i].irradiance.g);
  }
  const auto n = static_cast<double>(ours.size());
  e.occlusion_rms = std::sqrt(e.occlusion_rms / n);
  e.occlusion_mean /= n;
  e.irradiance_rms = std::sqrt(square / n) / (mean / n);
  return e;
}

}  // namespace ptc::test
