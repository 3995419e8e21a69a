#include "tools/bench/experiments/accuracy.h"

#include <optional>
#include <tuple>

#include "engine/base/error.h"
#include "tools/bench/experiments/set_run.h"

namespace ptc::bench {

const char* name_of(Quantity job) noexcept {
  return job == Quantity::occlusion ? "occlusion" : "bleeding";
}

std::vector<GatherOptions> AccuracyOptions::default_settings() {
  std::vector<GatherOptions> settings;
  for (const auto& [solid_angle, parallax, resolution] :
       std::initializer_list<std::tuple<float, float, unsigned>>{{0.2F, 0.4F, 16},
                                                                 {0.1F, 0.4F, 16},
                                                                 {0.06F, 0.3F, 32},
                                                                 {0.03F, 0.2F, 32},
                                                                 {0.01F, 0.1F, 32},
                                                                 {0.003F, 0.05F, 48}}) {
    settings.push_back(
        {.solid_angle = solid_angle, .parallax = parallax, .resolution = resolution});
  }
  return settings;
}

SceneAccuracy measure_accuracy(const BenchScene& scene, const AccuracyOptions& options,
                               const Executor& executor, Progress& progress) {
  // Prepare the rays of the scene
  SceneAccuracy accuracy{.surfels = scene.surfels().size(),
                         .triangles = scene.mesh().triangles.size()};
  constexpr Sides kSides = Sides::both;
  const DiscRays oracle(scene.surfels(), kSides, {});
  std::optional<RayBaseline> discs, mesh;
  if (options.measures("embree-discs")) discs.emplace(scene.surfels(), kSides);
  if (accuracy.triangles > 0) mesh.emplace(scene.mesh(), scene.surfels(), scene.spacing());
  const SceneRays rays{
      .oracle = &oracle, .discs = discs ? &*discs : nullptr, .mesh = mesh ? &*mesh : nullptr};
  // Measure each set of receivers
  for (const ReceiverSet& set : scene.sets()) {
    if (set.receivers.empty() || std::ranges::find(options.sets, set.name) == options.sets.end())
      continue;
    SetRun run(scene, set, options, rays, executor, progress);
    run.measure(progress);
    accuracy.references.push_back(run.note());
    const std::vector<AccuracyRow> rows = run.rows();
    accuracy.rows.insert(accuracy.rows.end(), rows.begin(), rows.end());
  }
  if (accuracy.rows.empty()) {
    throw DataError(
        scene.name() + ": nothing to measure: " +
        (accuracy.references.empty() ? "the camera sees nothing" : "a cloud has no mesh for rays"));
  }
  return accuracy;
}

}  // namespace ptc::bench
