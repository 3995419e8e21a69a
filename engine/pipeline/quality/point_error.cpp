#include "engine/pipeline/quality/point_error.h"

#include "engine/base/memory_budget.h"
#include "engine/base/progress.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/quality/disc_pairs.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/receivers.h"
#include "engine/shade/lift.h"

namespace ptc {
namespace {

constexpr std::uint64_t kPointSeed = std::uint64_t{1} << 53;  // far from the seeds of runs

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
  return trace_pairs(scene, lights.sky, receivers_, {.rays = kRays, .seed = kPointSeed}, budget,
                     executor_);
}

BoundedError PointJudge::measure(const ContainerReader& other) {
  return error_of_pairs(trace(other), truth_);
}

}  // namespace ptc
