#include "engine/pipeline/farm/plan_tasks.h"

#include <string>
#include <utility>

#include <fmt/format.h>

namespace ptc {
namespace {

// Seconds of one core for a point, and bytes of a point in a container: those of a city of 20
// million points, doubled for slower machines and for channels.
constexpr double kRouteSeconds = 2.2e-7, kPartSeconds = 7e-7;
constexpr double kLightSeconds = 1.8e-4, kBounceSeconds = 1e-4;
constexpr double kShadeSeconds = 1.8e-4, kCollectSeconds = 1e-6;
constexpr std::uint64_t kStoredBytes = 26, kResultBytes = 40;

/// Adds a task for each part of the scene, and one that joins what they write.
/// @param after    whose tasks they need
/// @param seconds  of a point
void add_parts(FarmPlan& plan, const TaskStep& step, const TaskStep& join, const TaskStep& after,
               std::uint64_t memory_bytes, double seconds) {
  const std::uint64_t points = plan.points / plan.parts();
  for (std::size_t i = 0; i < plan.parts(); ++i) {
    FarmTask& task = plan.tasks.emplace_back(FarmTask{.step = step, .number = i});
    task.after = after;
    task.inputs = {step.kind == TaskKind::part ? plan.folder() / "route.*" : plan.output(after, 0)};
    if (step.wave > 1) task.inputs.push_back(plan.scene);
    task.outputs = {plan.output(step, i)};
    task.memory_bytes = memory_bytes;
    task.disk_bytes = points * kStoredBytes;
    task.seconds = static_cast<double>(points) * seconds;
  }
  const std::string first = plan.output(step, 0).filename().string();  // "unlit.0.ptcx"
  const std::string all = first.substr(0, first.rfind("0.ptcx")) + "*.ptcx";
  plan.tasks.push_back({.step = join,
                        .after = step,
                        .inputs = {plan.folder() / all},
                        .outputs = {plan.output(join, 0)},
                        .memory_bytes = memory_bytes,
                        .disk_bytes = plan.parts() * 4096,
                        .seconds = 0.01 * static_cast<double>(plan.parts())});
}

/// Adds the tasks that light the points, and those that add bounces to their light.
/// @return  after which tasks they can be shaded
TaskStep add_light(FarmPlan& plan, std::uint64_t memory_bytes) {
  TaskStep last{TaskKind::join};
  if (plan.lighting) {
    add_parts(plan, {TaskKind::light}, {TaskKind::join_light}, last, memory_bytes, kLightSeconds);
    last = {TaskKind::join_light};
  }
  for (unsigned wave = 1; wave <= plan.waves(); ++wave) {
    const TaskStep join{TaskKind::join_bounce, wave};
    add_parts(plan, {TaskKind::bounce, wave}, join, last, memory_bytes, kBounceSeconds);
    last = join;
  }
  return last;
}

/// Adds the tasks that shade ranges of the scene, and one that collects their results.
void add_shading(FarmPlan& plan, const TaskStep& after, std::uint64_t memory_bytes) {
  const std::size_t ranges = plan.shading->ranges;
  const std::uint64_t points = plan.points / ranges;
  FarmTask collect{.step = {TaskKind::collect},
                   .after = TaskStep{TaskKind::shade},
                   .inputs = {plan.scene, plan.folder() / "shade.*"},
                   .outputs = {plan.shading->target},
                   .memory_bytes = memory_bytes,
                   .disk_bytes = plan.points * 2 * kResultBytes,
                   .seconds = static_cast<double>(plan.points) * kCollectSeconds};
  for (std::size_t i = 0; i < ranges; ++i) {
    FarmTask& task = plan.tasks.emplace_back(FarmTask{.step = {TaskKind::shade}, .number = i});
    task.after = after;
    task.inputs = {plan.scene};
    if (plan.waves() > 0) task.inputs.push_back(plan.output(after, 0));
    task.outputs = {plan.output(task.step, i)};
    task.memory_bytes = memory_bytes;
    task.disk_bytes = points * kResultBytes;
    task.seconds = static_cast<double>(points) * kShadeSeconds;
  }
  plan.tasks.push_back(std::move(collect));
}

}  // namespace

const char* name_of(TaskKind kind) noexcept {
  switch (kind) {
    case TaskKind::route:
      return "route";
    case TaskKind::part:
      return "part";
    case TaskKind::join:
      return "join";
    case TaskKind::light:
      return "light";
    case TaskKind::join_light:
      return "join_light";
    case TaskKind::bounce:
      return "bounce";
    case TaskKind::join_bounce:
      return "join_bounce";
    case TaskKind::shade:
      return "shade";
    case TaskKind::collect:
      break;
  }
  return "collect";
}

std::string TaskStep::name() const {
  return wave == 0 ? name_of(kind) : fmt::format("{}_{}", name_of(kind), wave);
}

std::string FarmTask::name() const {
  const bool one = step.kind == TaskKind::join || step.kind == TaskKind::join_light ||
                   step.kind == TaskKind::join_bounce || step.kind == TaskKind::collect;
  return one ? step.name() : fmt::format("{}.{}", step.name(), number);
}

std::filesystem::path FarmPlan::folder() const {
  return scene.parent_path() / (scene.stem().string() + ".parts");
}

unsigned FarmPlan::waves() const noexcept {
  return shading && shading->request.bounces > 1 ? shading->request.bounces - 1 : 0;
}

std::filesystem::path FarmPlan::output(const TaskStep& step, std::size_t number) const {
  switch (step.kind) {
    case TaskKind::route:
    case TaskKind::shade:
      return folder() / fmt::format("{}.{}", step.name(), number);
    case TaskKind::part:
      return folder() / fmt::format("{}{}.ptcx", lighting ? "unlit." : "", number);
    case TaskKind::light:
      return folder() / fmt::format("{}.ptcx", number);
    case TaskKind::bounce:
      return folder() / fmt::format("{}.{}.ptcx", step.name(), number);
    case TaskKind::join_bounce:
      return folder() / (TaskStep{TaskKind::bounce, step.wave}.name() + ".ptcx");
    case TaskKind::collect:
      return shading.value().target;
    case TaskKind::join:
      if (lighting) return folder() / "unlit.ptcx";
      break;
    case TaskKind::join_light:
      break;
  }
  return scene;
}

void add_tasks(FarmPlan& plan, std::uint64_t memory_bytes) {
  // Route each input
  const std::uint64_t row = plan.row().bytes();
  for (std::size_t i = 0; i < plan.inputs.size(); ++i) {
    const FarmInput& input = plan.inputs[i];
    FarmTask& task = plan.tasks.emplace_back(FarmTask{.step = {TaskKind::route}, .number = i});
    if (!input.path.empty()) task.inputs = {input.path};
    task.outputs = {plan.output(task.step, i)};
    task.memory_bytes = memory_bytes;
    task.disk_bytes = input.points * row;
    task.seconds = static_cast<double>(input.points) * kRouteSeconds;
  }

  // Build each range of all of them, join the parts, and light and shade what they are
  add_parts(plan, {TaskKind::part}, {TaskKind::join}, {TaskKind::route}, memory_bytes,
            kPartSeconds);
  const TaskStep lit = add_light(plan, memory_bytes);
  if (plan.shading) add_shading(plan, lit, memory_bytes);
}

}  // namespace ptc
