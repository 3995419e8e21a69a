#include "engine/pipeline/quality/point_error.h"

#include <algorithm>
#include <span>

#include "engine/base/memory_budget.h"
#include "engine/base/progress.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/receivers.h"
#include "engine/shade/lift.h"
#include "engine/trace/ray_shader.h"

namespace ptc {
namespace {

constexpr std::uint64_t kSeed = std::uint64_t{1} << 53;  // far from the seeds of runs

}  // namespace

PointJudge::PointJudge(const ContainerReader& exact, const RunOptions& run,
                       const std::filesystem::path& target, const Executor& executor)
    : exact_(exact), run_(run), target_(target), executor_(executor) {
  std::vector<Surfel> points(selected_of(exact, kPlaces));
  points.resize(PointCursor(exact, {}, points.size()).next(points));
  for (const Surfel& point : points)
    receivers_.push_back(lifted(point, LightingRequest{}.lift, exact.header().frame));
  truth_ = trace(exact);
}

std::vector<Shading> PointJudge::trace(const ContainerReader& scene) const {
  Progress silent;
  const LightRig lights = recorded_lights(exact_, run_, target_, silent);
  MemoryBudget budget = budget_of(run_.memory_bytes, "comparing containers");
  charge_directory(budget, exact_);
  if (&scene != &exact_) charge_directory(budget, scene);
  charge_sky(budget, lights.sky);
  const std::uint64_t least =
      RayShader::least_bytes(scene, executor_.threads(), RayOptions{}.back_end);
  RayShader discs(scene,
                  {.sky = [&](const glm::vec3& way) { return lights.sky.at(way); },
                   .emission = !lit_by_emitters(scene),
                   .memory_bytes = budget.rest("the page cache", least)},
                  executor_);
  const std::vector<Receiver> twice = two_of_each(receivers_);
  std::vector<Shading> traced(twice.size());
  discs.trace(twice, kRays, kSeed, traced, silent);
  return traced;
}

BoundedError PointJudge::measure(const ContainerReader& other) {
  const std::vector<Shading> traced = trace(other);
  std::vector<ErrorSums> errors(receivers_.size());
  for (std::size_t i = 0; i < errors.size(); ++i)
    errors[i].add(traced[2 * i], truth_[2 * i], traced[2 * i + 1], truth_[2 * i + 1]);
  return bounded_error(errors);
}

}  // namespace ptc
