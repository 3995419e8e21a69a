// Points of a scene are mirrors that the camera of its picture looks at. Those whose backs it sees
// are left out. A sky that brightens upwards is over all of them.
#include "tools/bench/experiments/glossy.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <glm/geometric.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/quality/mirror_rays.h"
#include "engine/pipeline/render/primary.h"
#include "engine/ptc.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/shade/reference/lobe_rays.h"
#include "engine/trace/ray_shader.h"
#include "tools/bench/references/timed_runs.h"

namespace ptc::bench {
namespace {

glm::vec3 sky_at(const glm::vec3& d) {
  return glm::vec3(0.6F, 0.8F, 1.0F) * (0.6F + 0.4F * d.y);
}

/// Traces mirrors by Embree at all discs.
/// @param seed  of the first mirror
void reflect_by_embree(const DiscRays& discs, std::span<const Receiver> receivers,
                       const Mirrors& mirrors, std::uint64_t seed, const Executor& executor,
                       std::span<Reflection> results) {
  executor.for_each((receivers.size() + 63) / 64, [&](std::size_t block, unsigned) {
    LobeRays lobe;
    std::vector<DiscHit> hits;
    for (std::size_t i = 64 * block; i < std::min(receivers.size(), 64 * (block + 1)); ++i) {
      const Receiver& at = receivers[i];
      lobe_directions(at.normal, glm::vec3(glm::normalize(mirrors.eye - at.position)),
                      mirrors.roughness, mirrors.rays, seed + i, lobe);
      hits.assign(lobe.directions.size(), DiscHit{});
      discs.meet(at.position, lobe.directions, hits);
      results[i] = sum_lobe(lobe, hits, sky_at);
    }
  });
}

}  // namespace

std::vector<GlossyRow> measure_glossy(const SceneChoice& choice, const GlossyOptions& options,
                                      const std::filesystem::path& work, const RunOptions& run,
                                      Progress& progress) {
  // Build the scene, and choose the mirrors that the camera sees the fronts of
  const BenchScene scene(choice,
                         {.points = options.points,
                          .shaded_width = 0,
                          .own_points = 4 * options.receivers,
                          .sparse_points = 0},
                         work, run, progress);
  const ThreadPool executor(run.threads);
  const glm::dvec3 eye = default_camera(scene.container(), {}, {}, {}).position;
  std::vector<Receiver> mirrors;
  for (const ReceiverSet& set : scene.sets()) {
    for (const Receiver& at : set.receivers) {
      if (mirrors.size() < options.receivers &&
          glm::dot(glm::dvec3(at.normal), eye - at.position) > 0)
        mirrors.push_back(at);
    }
  }
  const DiscRays discs(scene.surfels(), Sides::both, sky_at);
  std::vector<std::size_t> checked;
  const std::size_t step = std::max<std::size_t>(1, mirrors.size() / options.checked);
  for (std::size_t i = 0; i < mirrors.size(); i += step) checked.push_back(i);

  std::vector<GlossyRow> rows;
  RayShader octree(scene.container(), {.sky = sky_at, .memory_bytes = run.memory_bytes / 2},
                   executor);
  for (const double roughness : options.roughnesses) {
    // The reference: two halves, whose difference tells its noise
    Mirrors how{.eye = eye, .roughness = static_cast<float>(roughness)};
    how.rays = options.reference_rays / 2;
    std::vector<Receiver> some;
    for (const std::size_t i : checked) some.push_back(mirrors[i]);
    std::vector<Reflection> a(some.size()), b(some.size());
    progress.begin("reference", 0, "mirrors");
    reflect_by_embree(discs, some, how, 1'000'000'000, executor, a);
    reflect_by_embree(discs, some, how, 2'000'000'000, executor, b);
    progress.end();

    const std::vector<Shading> first = as_shading(a), second = as_shading(b);

    // Trace by both in turn
    const std::size_t count = options.rays.size();
    std::vector<Costs> costs(2 * count);
    std::vector<std::vector<Reflection>> results(2 * count);
    progress.begin("reflect", options.repeats * 2 * count, "runs");
    for (unsigned repeat = 0; repeat < options.repeats; ++repeat) {
      for (std::size_t k = 0; k < 2 * count; ++k) {
        how.rays = options.rays[k % count];
        results[k].resize(mirrors.size());
        costs[k].add(timed([&] {
          if (k < count) {
            octree.reflect(mirrors, how, 0, results[k]);
          } else {
            reflect_by_embree(discs, mirrors, how, 0, executor, results[k]);
          }
        }));
        progress.advance(1);
      }
    }
    progress.end();

    // Compare with the reference
    for (std::size_t k = 0; k < 2 * count; ++k) {
      const std::vector<Shading> ours = as_shading(results[k]);
      ErrorSums sums;
      for (std::size_t i = 0; i < checked.size(); ++i)
        sums.add(ours[checked[i]], first[i], second[i]);
      const CheckError error = sums.error();
      rows.push_back({.scene = scene.name(),
                      .method = k < count ? "ptcx" : "embree-discs",
                      .roughness = roughness,
                      .rays = options.rays[k % count],
                      .receivers = mirrors.size(),
                      .threads = executor.threads(),
                      .us = costs[k].cpu_us(mirrors.size()),
                      .wall_us = costs[k].wall_us(mirrors.size()),
                      .radiance = error.irradiance_rms,
                      .bias = error.irradiance_bias,
                      .occlusion = error.occlusion_rms,
                      .noise = error.irradiance_noise});
    }
  }
  return rows;
}

}  // namespace ptc::bench
