// A task leaves SCENE.parts/done/NAME with the identity of the plan behind everything that it has
// written, or SCENE.parts/failed/NAME with the text of its error.
#include "engine/pipeline/farm/tasks.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/temporary_name.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/farm/build_tasks.h"
#include "engine/pipeline/farm/tuning_file.h"
#include "engine/pipeline/light/light_container.h"
#include "engine/pipeline/parts/join_parts.h"
#include "engine/pipeline/parts/part_edges.h"
#include "engine/pipeline/shade/shade_ranges.h"
#include "engine/scene/light/sky_map.h"
#include "engine/store/reader.h"

namespace ptc {
namespace {

/// Removes what a task wrote, when its last users are done. A second process of a user may still
/// need it: its task ends well for all that (run_task()).
void remove_output(const FarmTask& task) {
  if (task.step.kind == TaskKind::tune) return;  // it says which error the points have
  std::error_code gone;
  const std::filesystem::path& output = task.outputs.at(0);
  std::filesystem::remove(output, gone);
  if (task.step.kind == TaskKind::part || task.step.kind == TaskKind::bounce)
    std::filesystem::remove(edges_path(output), gone);
}

/// Says whether what others wrote may be spent by a task: it joins or collects, it makes a part or
/// a range again behind one that does, or it renders the last picture.
bool may_spend(const FarmPlan& plan, const FarmTask& task, TaskMarks& marks) {
  const auto is_done = [&](const TaskStep& step) {
    const auto found = std::ranges::find(plan.tasks, step, &FarmTask::step);
    return found != plan.tasks.end() && marks.is_done(*found);
  };
  switch (task.step.kind) {
    case TaskKind::join:
    case TaskKind::join_light:
    case TaskKind::collect:
      return true;
    case TaskKind::part:
      return is_done({TaskKind::join});
    case TaskKind::light:
      return is_done({TaskKind::join_light});
    case TaskKind::shade:
      return plan.has_tiles() && is_done({TaskKind::collect});
    case TaskKind::frame: {
      if (!plan.renders_bounces()) return false;
      const auto bounce =
          std::ranges::find(plan.tasks, TaskStep{TaskKind::bounce, 1}, &FarmTask::step);
      return bounce != plan.tasks.end() && marks.is_spent(*bounce);
    }
    default:
      return false;
  }
}

/// Removes what nobody needs any more behind a task, and temporary files that killed tasks have
/// left.
void remove_leftovers(const FarmPlan& plan, const FarmTask& task) {
  TaskMarks marks(plan);
  // A second process of a task may come later than those who need its output
  if (marks.is_spent(task)) remove_output(task);
  if (may_spend(plan, task, marks)) remove_spent(plan);
}

/// Joins the parts that have points.
void join(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress) {
  std::vector<std::filesystem::path> parts;
  for (const FarmTask& part : plan.tasks) {
    if (part.step == task.after && has_output(plan, task, part))
      parts.push_back(part.outputs.at(0));
  }
  static_cast<void>(join_parts(parts, task.outputs.at(0), run, progress));
}

/// Returns the index of a plan's part among those of a scene; nothing when it has no points.
/// @param step  whose tasks wrote the parts
std::optional<std::size_t> index_of(const FarmPlan& plan, const TaskStep& step, std::size_t number,
                                    const std::filesystem::path& scene) {
  const std::string name = plan.output(step, number).filename();
  const PartList list = ContainerReader(scene, ContainerReader::OpenParts::no).read_parts();
  const auto found = std::ranges::find_if(list.parts(), [&](const PartRecord& part) {
    return std::filesystem::path(part.name).filename() == name;
  });
  if (found == list.parts().end()) return std::nullopt;
  return static_cast<std::size_t>(found - list.parts().begin());
}

/// Lights a part. @return  whether it has points
bool light(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress) {
  LightRequest request = plan.lighting.value();
  request.scene = plan.output({TaskKind::join}, 0);
  request.run = run;
  const std::filesystem::path& target = task.outputs.at(0);
  const std::optional<std::size_t> part =
      index_of(plan, {TaskKind::part}, task.number, request.scene);
  if (!part) {
    remove_part(target);
    return false;
  }
  Sky& sky = request.lights.value().sky;
  const auto store = texture_store(run, target);
  if (load_sky_map(sky, directory_of(plan.file), *store) == SkyMap::changed)
    throw DataError(sky.map_path + ": the picture changed since it was planned: plan again");
  static_cast<void>(light_part(request, *part, target, progress));
  return true;
}

/// Completes a request for bounces, of which tasks have made all but the last.
void use_bounces(const FarmPlan& plan, const RunOptions& run, LightingRequest& request) {
  request.scene = plan.scene;
  request.run = run;
  if (request.bounces > 1) request.bounced = plan.bounced(request.bounces);
}

/// Returns the request for the shading of a plan.
ShadeRequest shading_of(const FarmPlan& plan, const RunOptions& run) {
  ShadeRequest request = plan.shading.value().request;
  use_bounces(plan, run, request);
  return request;
}

/// Adds a bounce to the light of a part. @return  whether it has points
bool bounce(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress) {
  ShadeRequest request{plan.bounce_settings()};
  request.bounces = task.step.wave;
  use_bounces(plan, run, request);
  const TaskStep parts{plan.lighting ? TaskKind::light : TaskKind::part};
  const std::optional<std::size_t> part = index_of(plan, parts, task.number, request.scene);
  if (!part) {
    remove_part(task.outputs.at(0));
    return false;
  }
  shade_part(request, *part, task.outputs.at(0), progress);
  return true;
}

/// Chooses the settings that meet the error.
void tune(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress) {
  write_tuning(plan, choose_settings(shading_of(plan, run), task.outputs.at(0), progress));
}

/// Returns the request that shades with the settings that were chosen.
ShadeRequest tuned_shading_of(const FarmPlan& plan, const RunOptions& run) {
  ShadeRequest request = shading_of(plan, run);
  if (!request.error) return request;
  const TuningReport tuning = read_tuning(plan);
  request.error.reset();
  request.receiver_rays = tuning.receiver_rays;
  GatherOptions& gather = request.gather;
  gather.solid_angle = tuning.gather.solid_angle;
  gather.parallax = tuning.gather.parallax;
  gather.inflation = tuning.gather.inflation;
  gather.resolution = tuning.gather.resolution;
  return request;
}

/// Shades a range. @return  whether it has written a file
bool shade(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress) {
  const ShadeRequest request = tuned_shading_of(plan, run);
  const RangeNumber range{task.number, plan.shading->ranges};
  const std::filesystem::path& target = task.outputs.at(0);
  if (plan.has_tiles()) {
    if (shade_tile(request, range, target, progress)) return true;
    std::filesystem::remove(target);  // of an earlier plan
    return false;
  }
  shade_range(request, range, plan.id, target, progress);
  return true;
}

/// Writes the shaded points.
void collect(const FarmPlan& plan, const RunOptions& run, Progress& progress) {
  std::vector<std::filesystem::path> results;
  for (std::size_t i = 0; i < plan.shading->ranges; ++i)
    results.push_back(plan.output({TaskKind::shade}, i));
  collect_shading(tuned_shading_of(plan, run), results, plan.id, plan.shading->target, progress);
}

/// Does a task. @return  whether it has written its output
bool perform(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress,
             const RenderFrame& frame) {
  std::filesystem::create_directories(plan.folder());
  switch (task.step.kind) {
    case TaskKind::route:
      route_input(plan, task, run, progress);
      break;
    case TaskKind::part:
      return build_part(plan, task, run, progress);
    case TaskKind::light:
      return light(plan, task, run, progress);
    case TaskKind::bounce:
      return bounce(plan, task, run, progress);
    case TaskKind::join:
    case TaskKind::join_light:
    case TaskKind::join_bounce:
      join(plan, task, run, progress);
      break;
    case TaskKind::tune:
      tune(plan, task, run, progress);
      break;
    case TaskKind::shade:
      return shade(plan, task, run, progress);
    case TaskKind::collect:
      if (!plan.has_tiles()) collect(plan, run, progress);
      return !plan.has_tiles();
    case TaskKind::frame:
      if (!frame) throw std::invalid_argument("run_task: nothing renders the picture");
      frame(task);
      break;
  }
  return true;
}

/// Refuses a task before its time.
void require_forerunners(const FarmPlan& plan, const FarmTask& task, TaskMarks& marks) {
  for (const FarmTask& before : plan.tasks) {
    if (before.step == task.after && !marks.is_done(before)) fail_unseen(plan, task, before.name());
  }
}

}  // namespace

void remove_spent(const FarmPlan& plan) {
  TaskMarks marks(plan);
  for (const FarmTask& task : plan.tasks) {
    if (marks.is_spent(task)) remove_output(task);
  }
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator(plan.folder())) {
    if (is_leftover(entry.path())) std::filesystem::remove(entry.path(), gone);
  }
}

bool run_task(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress,
              const RenderFrame& frame) {
  bool performed = false;
  try {
    TaskMarks marks(plan);
    if (marks.is_done(task)) {
      const bool is_last = task.step.kind == TaskKind::collect || task.step.kind == TaskKind::frame;
      if (is_last) remove_leftovers(plan, task);  // one that was killed could not
      return false;
    }
    require_forerunners(plan, task, marks);
    forget_failure(plan, task);
    forget_other_plans(plan, task);
    const bool has_output = perform(plan, task, run, progress, frame);
    performed = true;
    mark_done(plan, task, has_output);
  } catch (const NotYet&) {
    throw;
  } catch (const std::exception& error) {
    // Another process may have done the task in the meantime, and join removed what this one needed
    if (!performed && TaskMarks(plan).is_done(task)) return false;
    note_failure(plan, task, error.what());
    throw;
  }
  remove_leftovers(plan, task);
  return true;
}

}  // namespace ptc
