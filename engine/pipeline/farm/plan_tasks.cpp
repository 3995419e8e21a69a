#include "engine/pipeline/farm/plan_tasks.h"

#include <algorithm>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace ptc {
namespace {

// Seconds of one core for a point, and bytes of a point in a container: those of a city of 20
// million points, doubled for slower machines and for channels.
constexpr double kRouteSeconds = 2.2e-7, kPartSeconds = 7e-7;
constexpr double kShadowRaySeconds = 1e-6, kSkySeconds = 1.8e-4, kBounceSeconds = 1e-4;
constexpr double kReadSeconds = 1e-7;  // of a point that may emit
constexpr double kShadeSeconds = 1.8e-4, kCollectSeconds = 1e-6;
constexpr double kTuneSeconds = 300;  // of the task: its pilots are as many for any scene
constexpr std::uint64_t kFrameBytes = 10'000'000;
constexpr std::uint64_t kStoredBytes = 26, kResultBytes = 40;

/// Returns what decides how the points of a scene are lit before the last bounce.
auto bounce_settings_of(const LightingRequest& request) {
  const GatherOptions& gather = request.gather;
  return std::tuple(gather.solid_angle, gather.parallax, gather.inflation, gather.resolution,
                    gather.sides, request.lift);
}

/// Returns the files of all parts that a step writes: "unlit.*.ptcx".
std::filesystem::path all_parts(const FarmPlan& plan, const TaskStep& step) {
  const std::string first = plan.output(step, 0).filename().string();
  return plan.folder() / (first.substr(0, first.rfind("0.ptcx")) + "*.ptcx");
}

/// Adds the files of a scene of parts to those that a task reads.
/// @param parts, join  the steps that write them
void add_scene(const FarmPlan& plan, const TaskStep& parts, const TaskStep& join,
               std::vector<std::filesystem::path>& inputs) {
  inputs.push_back(plan.output(join, 0));
  inputs.push_back(all_parts(plan, parts));
}

/// Adds the files of the scene of a plan, lit if it is.
void add_final_scene(const FarmPlan& plan, std::vector<std::filesystem::path>& inputs) {
  if (plan.lighting) {
    add_scene(plan, {TaskKind::light}, {TaskKind::join_light}, inputs);
  } else {
    add_scene(plan, {TaskKind::part}, {TaskKind::join}, inputs);
  }
}

/// Adds the files of the scene with the light of all bounces but the last, if there is more than
/// one.
void add_bounced(const FarmPlan& plan, unsigned bounces,
                 std::vector<std::filesystem::path>& inputs) {
  if (bounces < 2) return;
  const unsigned wave = bounces - 1;
  add_scene(plan, {TaskKind::bounce, wave}, {TaskKind::join_bounce, wave}, inputs);
}

/// Adds a task for each part of the scene, and one that joins what they write.
/// @param inputs   of each
/// @param after    whose tasks they need
/// @param seconds  of a point
void add_parts(FarmPlan& plan, const TaskStep& step, const TaskStep& join, const TaskStep& after,
               const std::vector<std::filesystem::path>& inputs, std::uint64_t memory_bytes,
               double seconds) {
  const std::uint64_t points = plan.points / plan.parts();
  for (std::size_t i = 0; i < plan.parts(); ++i) {
    plan.tasks.push_back({.step = step,
                          .number = i,
                          .after = after,
                          .inputs = inputs,
                          .outputs = {plan.output(step, i)},
                          .memory_bytes = memory_bytes,
                          .disk_bytes = points * kStoredBytes,
                          .seconds = static_cast<double>(points) * seconds});
  }
  plan.tasks.push_back({.step = join,
                        .after = step,
                        .inputs = {all_parts(plan, step)},
                        .outputs = {plan.output(join, 0)},
                        .memory_bytes = memory_bytes,
                        .disk_bytes = plan.parts() * 4096,
                        .seconds = 0.01 * static_cast<double>(plan.parts())});
}

/// Returns what it takes to light a point, seconds of one core.
double light_seconds(const FarmPlan& plan) {
  const LightRig& rig = plan.lighting.value().lights.value();
  const LightSampling& sampling = plan.lighting->light_sampling;
  const auto rays = static_cast<double>(rig.suns.size() * sampling.sun_rays + rig.points.size() +
                                        rig.spots.size() + (plan.emits ? sampling.area_rays : 0));
  double seconds = (1 + rays) * kShadowRaySeconds;
  if (rig.sky.radiance != glm::vec3(0)) seconds += kSkySeconds;
  // Each task reads all points twice to find those that emit
  if (plan.emits) seconds += 2 * static_cast<double>(plan.parts()) * kReadSeconds;
  return seconds;
}

/// Adds the tasks that light the points, and those that add bounces to their light.
/// @return  after which tasks they can be shaded
TaskStep add_light(FarmPlan& plan, std::uint64_t memory_bytes) {
  TaskStep last{TaskKind::join};
  if (plan.lighting) {
    std::vector<std::filesystem::path> inputs;
    add_scene(plan, {TaskKind::part}, last, inputs);
    const Sky& sky = plan.lighting->lights.value().sky;
    if (!sky.map_path.empty()) inputs.emplace_back(sky.map_path);
    add_parts(plan, {TaskKind::light}, {TaskKind::join_light}, last, inputs, memory_bytes,
              light_seconds(plan));
    last = {TaskKind::join_light};
  }
  for (unsigned wave = 1; wave <= plan.waves(); ++wave) {
    const TaskStep step{TaskKind::bounce, wave}, join{TaskKind::join_bounce, wave};
    std::vector<std::filesystem::path> inputs;
    add_final_scene(plan, inputs);
    add_bounced(plan, wave, inputs);
    add_parts(plan, step, join, last, inputs, memory_bytes, kBounceSeconds);
    last = join;
  }
  return last;
}

/// Adds the tasks that shade ranges of the scene, one that chooses the settings where an error is
/// asked for, and one that collects the results.
void add_shading(FarmPlan& plan, const TaskStep& after, std::uint64_t memory_bytes) {
  // Choose the settings
  TaskStep before = after;
  std::vector<std::filesystem::path> seen;
  add_final_scene(plan, seen);
  add_bounced(plan, plan.shading->request.bounces, seen);
  if (plan.shading->request.error) {
    before = {TaskKind::tune};
    plan.tasks.push_back({.step = before,
                          .after = after,
                          .inputs = seen,
                          .outputs = {plan.output(before, 0)},
                          .memory_bytes = memory_bytes,
                          .disk_bytes = 256,
                          .seconds = kTuneSeconds});
    seen.push_back(plan.output(before, 0));
  }

  // Shade the ranges, and collect their results
  const std::size_t ranges = plan.shading->ranges;
  const std::uint64_t points = plan.shaded_points() / ranges;
  FarmTask collect{.step = {TaskKind::collect},
                   .after = TaskStep{TaskKind::shade},
                   .inputs = {plan.scene, plan.folder() / "shade.*"},
                   .outputs = {plan.shading->target},
                   .memory_bytes = memory_bytes,
                   .disk_bytes = plan.shaded_points() * 2 * kResultBytes,
                   .seconds = static_cast<double>(plan.shaded_points()) * kCollectSeconds};
  std::uint64_t result_bytes = kResultBytes;
  if (plan.has_tiles()) {  // there is nothing to collect, but bounces may go
    result_bytes = 2 * kResultBytes;
    collect.inputs = {plan.shading->target};
    collect.disk_bytes = 0;
    collect.seconds = 0.01;
  }
  for (std::size_t i = 0; i < ranges; ++i) {
    FarmTask& task = plan.tasks.emplace_back(FarmTask{.step = {TaskKind::shade}, .number = i});
    task.after = before;
    task.inputs = seen;
    task.outputs = {plan.output(task.step, i)};
    task.memory_bytes = memory_bytes;
    task.disk_bytes = points * result_bytes;
    task.seconds = static_cast<double>(points) * kShadeSeconds;
  }
  plan.tasks.push_back(std::move(collect));
}

/// Adds the tasks that render pictures, behind all others.
void add_frames(FarmPlan& plan, std::uint64_t memory_bytes) {
  std::vector<std::filesystem::path> inputs;
  add_final_scene(plan, inputs);
  if (plan.renders_bounces()) add_bounced(plan, plan.frames->lighting.bounces, inputs);
  const TaskStep after = plan.tasks.back().step;
  for (std::size_t i = 0; i < plan.frames->count(); ++i) {
    plan.tasks.push_back({.step = {TaskKind::frame},
                          .number = i,
                          .after = after,
                          .inputs = inputs,
                          .outputs = plan.pictures(i),
                          .memory_bytes = memory_bytes,
                          .disk_bytes = kFrameBytes,
                          .seconds = plan.frames->seconds});
  }
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
    case TaskKind::tune:
      return "tune";
    case TaskKind::shade:
      return "shade";
    case TaskKind::collect:
      return "collect";
    case TaskKind::frame:
      break;
  }
  return "frame";
}

std::string TaskStep::name() const {
  return wave == 0 ? name_of(kind) : fmt::format("{}_{}", name_of(kind), wave);
}

std::string FarmTask::name() const {
  const bool one = step.kind == TaskKind::join || step.kind == TaskKind::join_light ||
                   step.kind == TaskKind::join_bounce || step.kind == TaskKind::tune ||
                   step.kind == TaskKind::collect;
  return one ? step.name() : fmt::format("{}.{}", step.name(), number);
}

bool has_same_bounces(const LightingRequest& a, const LightingRequest& b) {
  return a.bounces == b.bounces && bounce_settings_of(a) == bounce_settings_of(b);
}

std::filesystem::path FarmPlan::folder() const {
  return scene.parent_path() / (scene.stem().string() + ".parts");
}

bool FarmPlan::is_divided(std::size_t input) const {
  return inputs[input].first > 0 || (input + 1 < inputs.size() && inputs[input + 1].first > 0);
}

std::vector<std::filesystem::path> FarmPlan::pictures(std::size_t number) const {
  const FarmFrames& all = frames.value();
  std::vector<std::filesystem::path> named = all.targets;
  for (std::filesystem::path& target : named) {
    if (all.range) target = frame_name(target, (*all.range)[number]).value_or(target);
  }
  return named;
}

bool FarmPlan::has_tiles() const {
  return shading && frame_name(shading->target, 0).has_value();
}

std::uint64_t FarmPlan::shaded_points() const {
  const std::uint64_t wanted = shading.value().request.count;
  return wanted == 0 ? points : std::min(wanted, points);
}

unsigned FarmPlan::waves() const noexcept {
  const unsigned shaded = shading ? shading->request.bounces : 0;
  const unsigned bounces = renders_bounces() ? std::max(shaded, frames->lighting.bounces) : shaded;
  return bounces > 1 ? bounces - 1 : 0;
}

bool FarmPlan::renders_bounces() const noexcept {
  if (!frames || frames->lighting.bounces < 2) return false;
  return !shading || shading->request.bounces < 2 ||
         bounce_settings_of(shading->request) == bounce_settings_of(frames->lighting);
}

const LightingRequest& FarmPlan::bounce_settings() const noexcept {
  return shading && shading->request.bounces > 1 ? shading->request : frames->lighting;
}

std::filesystem::path FarmPlan::bounced(unsigned bounces) const {
  return output({TaskKind::join_bounce, bounces - 1}, 0);
}

std::filesystem::path FarmPlan::output(const TaskStep& step, std::size_t number) const {
  switch (step.kind) {
    case TaskKind::shade:
      if (has_tiles()) return *frame_name(shading->target, static_cast<std::int64_t>(number));
      [[fallthrough]];
    case TaskKind::route:
      return folder() / fmt::format("{}.{}", step.name(), number);
    case TaskKind::part:
      return folder() / fmt::format("{}{}.ptcx", lighting ? "unlit." : "", number);
    case TaskKind::light:
      return folder() / fmt::format("{}.ptcx", number);
    case TaskKind::bounce:
      return folder() / fmt::format("{}.{}.ptcx", step.name(), number);
    case TaskKind::join_bounce:
      return folder() / (TaskStep{TaskKind::bounce, step.wave}.name() + ".ptcx");
    case TaskKind::tune:
      return folder() / "tune";
    case TaskKind::collect:
      return shading.value().target;
    case TaskKind::frame:
      return pictures(number).front();
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

  // Build each part of all of them, join the parts, and light and shade what they are
  add_parts(plan, {TaskKind::part}, {TaskKind::join}, {TaskKind::route},
            {plan.folder() / "route.*"}, memory_bytes, kPartSeconds);
  const TaskStep lit = add_light(plan, memory_bytes);
  if (plan.shading) add_shading(plan, lit, memory_bytes);
  if (plan.frames) add_frames(plan, memory_bytes);
}

}  // namespace ptc
