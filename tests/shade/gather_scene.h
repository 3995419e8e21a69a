// A scene with receivers, and how two shadings of them differ.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "engine/parallel/thread_pool.h"
#include "engine/shade/shader.h"
#include "tests/support/scenes.h"

namespace ptc::test {

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

/// A floor, a red wall and some balls: contacts, occlusion, colour.
inline std::vector<Surfel> small_scene(double spacing) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, spacing, glm::vec3(0.5F));
  add_rectangle(surfels, {-2, 1.5, 0}, {4, 0, 0}, {0, 0, 2}, spacing, {0.8F, 0.1F, 0.1F});
  for (int i = 0; i < 8; ++i) {
    add_sphere(surfels, {-1.5 + 0.4 * i, -1 + 0.3 * (i * 5 % 8), 0.3 + 0.1 * (i % 3)},
               0.2 + 0.03 * (i % 4), spacing, {0.2F + 0.08F * static_cast<float>(i), 0.6F, 0.3F});
  }
  return surfels;
}

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
