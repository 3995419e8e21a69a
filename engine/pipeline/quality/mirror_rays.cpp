#include "engine/pipeline/quality/mirror_rays.h"

#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/quality/pilot_rays.h"

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
    tuning.noise = noise_of(pilots, as_shading(traced));
    tuning.met = tuning.noise <= asked;
    if (tuning.met || tuning.rays == kMostMirrorRays || mirrors.roughness == 0) return tuning;
  }
}

}  // namespace ptc
