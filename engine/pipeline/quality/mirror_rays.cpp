#include "engine/pipeline/quality/mirror_rays.h"

#include <cmath>
#include <numbers>

#include "engine/pipeline/quality/error_sums.h"

namespace ptc {

std::vector<Shading> as_shading(std::span<const Reflection> reflections) {
  std::vector<Shading> shading;
  for (const Reflection& r : reflections)
    shading.push_back({.occlusion = r.occlusion, .irradiance = r.radiance});
  return shading;
}

MirrorTuning tune_mirrors(RayShader& shader, std::span<const Pilot> pilots, Mirrors mirrors,
                          double asked) {
  constexpr unsigned kLeast = 16;
  MirrorTuning tuning{.rays = kLeast};
  if (pilots.empty()) return tuning;
  const std::vector<Receiver> twice = two_of_each(compared_of(pilots));
  std::vector<Reflection> traced(twice.size());
  for (;; tuning.rays *= 2) {
    mirrors.rays = tuning.rays;
    shader.reflect(twice, mirrors, 0, traced);
    const std::vector<Shading> results = as_shading(traced);
    ErrorSums sums;
    std::size_t i = 0;
    for (const Pilot& pilot : pilots) {
      for (const Compared& one : pilot.compared) {
        sums.add(results[2 * i], results[2 * i], results[2 * i + 1], one.weight);
        ++i;
      }
    }
    // The noise of the sums is that of a mean of two
    tuning.noise = std::numbers::sqrt2 * sums.error().relative_noise();
    tuning.met = tuning.noise <= asked;
    if (tuning.met || tuning.rays == kMostMirrorRays || mirrors.roughness == 0) return tuning;
  }
}

}  // namespace ptc
