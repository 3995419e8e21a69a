// A task leaves SCENE.parts/done/NAME with the identity of the plan behind everything that it has
// written, or SCENE.parts/failed/NAME with the text of its error.
#include "engine/pipeline/farm/tasks.h"

#include <algorithm>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/temporary_name.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/farm/build_tasks.h"
#include "engine/pipeline/light/light_container.h"
#include "engine/pipeline/parts/join_parts.h"
#include "engine/pipeline/parts/part_edges.h"
#include "engine/pipeline/shade/shade_ranges.h"
#include "engine/scene/light/sky_map.h"
#include "engine/store/reader.h"

namespace ptc {
namespace {

/// Removes what nobody needs when the tasks of a kind are done, and temporary files that killed
/// tasks have left. A second process of a task that is done may still need them: its task ends well
/// for all that (run_task()).
void remove_leftovers(const FarmPlan& plan, TaskKind user) {
  std::error_code gone;
  for (const FarmTask& task : plan.tasks) {
    if (last_user(plan, task) != user) continue;
    const std::filesystem::path& output = task.outputs.at(0);
    std::filesystem::remove(output, gone);
    if (task.step.kind == TaskKind::part || task.step.kind == TaskKind::bounce)
      std::filesystem::remove(edges_path(output), gone);
  }
  for (const auto& entry : std::filesystem::directory_iterator(plan.folder())) {
    if (is_leftover(entry.path())) std::filesystem::remove(entry.path(), gone);
  }
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
  if (!part) return false;
  Sky& sky = request.lights.value().sky;
  const auto store = texture_store(run, target);
  if (load_sky_map(sky, directory_of(plan.file), *store) == SkyMap::changed)
    throw DataError(sky.map_path + ": the picture changed since it was planned: plan again");
  static_cast<void>(light_part(request, *part, target, progress));
  return true;
}

ShadeRequest shading_of(const FarmPlan& plan, const RunOptions& run) {
  ShadeRequest request = plan.shading.value().request;
  request.scene = plan.scene;
  request.run = run;
  return request;
}

/// Adds a bounce to the light of a part. @return  whether it has points
bool bounce(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress) {
  ShadeRequest request = shading_of(plan, run);
  const TaskStep parts{plan.lighting ? TaskKind::light : TaskKind::part};
  const std::optional<std::size_t> part = index_of(plan, parts, task.number, request.scene);
  if (!part) return false;
  request.bounces = task.step.wave;
  if (task.step.wave > 1)
    request.bounced = plan.output({TaskKind::join_bounce, task.step.wave - 1}, 0);
  shade_part(request, *part, task.outputs.at(0), progress);
  return true;
}

void shade(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress) {
  ShadeRequest request = shading_of(plan, run);
  if (plan.waves() > 0) request.bounced = plan.output({TaskKind::join_bounce, plan.waves()}, 0);
  shade_range(request, {task.number, plan.shading->ranges}, plan.id, task.outputs.at(0), progress);
}

/// Writes the shaded points.
void collect(const FarmPlan& plan, const RunOptions& run, Progress& progress) {
  std::vector<std::filesystem::path> results;
  for (std::size_t i = 0; i < plan.shading->ranges; ++i)
    results.push_back(plan.output({TaskKind::shade}, i));
  collect_shading(shading_of(plan, run), results, plan.id, plan.shading->target, progress);
}

/// Does a task. @return  whether it has written its output
bool perform(const FarmPlan& plan, const FarmTask& task, const RunOptions& run,
             Progress& progress) {
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
      join(plan, task, run, progress);
      remove_leftovers(plan, TaskKind::part);
      break;
    case TaskKind::join_light:
      join(plan, task, run, progress);
      remove_leftovers(plan, TaskKind::light);
      break;
    case TaskKind::join_bounce:
      join(plan, task, run, progress);
      break;
    case TaskKind::shade:
      shade(plan, task, run, progress);
      break;
    case TaskKind::collect:
      collect(plan, run, progress);
      remove_leftovers(plan, TaskKind::collect);
      break;
  }
  return true;
}

/// Refuses a task before its time.
void require_forerunners(const FarmPlan& plan, const FarmTask& task) {
  for (const FarmTask& before : plan.tasks) {
    if (before.step == task.after && !is_done(plan, before)) fail_unseen(plan, task, before.name());
  }
}

}  // namespace

bool run_task(const FarmPlan& plan, const FarmTask& task, const RunOptions& run,
              Progress& progress) {
  bool performed = false;
  try {
    if (is_done(plan, task)) return false;
    require_forerunners(plan, task);
    forget_failure(plan, task);
    const bool has_output = perform(plan, task, run, progress);
    performed = true;
    mark_done(plan, task, has_output);
  } catch (const NotYet&) {
    throw;
  } catch (const std::exception& error) {
    // Another process may have done the task in the meantime, and join removed what this one needed
    if (!performed && is_done(plan, task)) return false;
    note_failure(plan, task, error.what());
    throw;
  }
  if (is_spent(plan, task))  // a second process of it was later than those who need its output
    std::filesystem::remove(task.outputs.at(0));
  return true;
}

}  // namespace ptc
