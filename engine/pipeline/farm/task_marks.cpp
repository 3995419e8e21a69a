#include "engine/pipeline/farm/task_marks.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "engine/io/file/state_file.h"
#include "engine/io/file/text_file.h"

namespace ptc {
namespace {

/// Returns the mark of a task. Tasks of two plans that write one file have one mark, so that what
/// the other plan wrote is not taken for what this one did.
std::filesystem::path done_mark(const FarmPlan& plan, const FarmTask& task) {
  const auto mark = [&]() -> std::string {
    switch (task.step.kind) {
      case TaskKind::part:
        return fmt::format("{}.{}", plan.lighting ? "unlit" : "part", task.number);
      case TaskKind::join:
        return plan.lighting ? "unlit" : "join";
      case TaskKind::light:
        return fmt::format("part.{}", task.number);
      case TaskKind::join_light:
        return "join";
      default:
        return task.name();
    }
  };
  return plan.folder() / "done" / mark();
}

std::filesystem::path failed_mark(const FarmPlan& plan, const FarmTask& task) {
  return plan.folder() / "failed" / task.name();
}

/// Returns the plan of a mark, and whether the task has written its output; nothing without a mark.
std::optional<std::pair<std::uint64_t, bool>> read_mark(const FarmPlan& plan,
                                                        const FarmTask& task) {
  const std::filesystem::path mark = done_mark(plan, task);
  std::vector<std::byte> bytes;
  try {
    bytes = read_state(mark);
  } catch (const std::system_error& error) {
    if (error.code() != std::errc::no_such_file_or_directory) throw;
    return std::nullopt;
  }
  StateReader state(bytes, mark.string());
  const auto id = state.get<std::uint64_t>();
  return std::pair(id, state.get<std::uint8_t>() != 0);
}

/// Returns whether a task has written its output; nothing when it is not marked as done.
std::optional<bool> written(const FarmPlan& plan, const FarmTask& task) {
  const auto mark = read_mark(plan, task);
  if (!mark || mark->first != plan.id) return std::nullopt;
  return mark->second;
}

}  // namespace

void fail_unseen(const FarmPlan& plan, const FarmTask& task, const std::string& needed) {
  throw NotYet(std::make_error_code(std::errc::resource_unavailable_try_again),
               plan.file.string() + ": " + task.name() + " needs " + needed +
                   ", which is not done, or not seen from this machine yet");
}

void mark_done(const FarmPlan& plan, const FarmTask& task, bool has_output) {
  std::filesystem::create_directories(done_mark(plan, task).parent_path());
  StateWriter state;
  state.put(plan.id);
  state.put(static_cast<std::uint8_t>(has_output));
  write_shared_state(done_mark(plan, task), state.take());
}

void forget_other_plans(const FarmPlan& plan, const FarmTask& task) {
  const auto mark = read_mark(plan, task);
  if (mark && mark->first != plan.id) std::filesystem::remove(done_mark(plan, task));
}

bool TaskMarks::is_done(const FarmTask& task) {
  const std::optional<bool> has_output = written(plan_, task);
  if (!has_output) return false;
  // A range that is shaded again needs bounces, which this task removes again
  if (task.step.kind == TaskKind::collect && plan_.has_tiles()) return all_done(TaskKind::shade);
  const auto exists = [](const std::filesystem::path& path) {
    return std::filesystem::exists(path);
  };
  return !*has_output || std::ranges::all_of(task.outputs, exists) || is_spent(task);
}

bool has_output(const FarmPlan& plan, const FarmTask& task, const FarmTask& needed) {
  const std::optional<bool> has_output = written(plan, needed);
  if (!has_output) fail_unseen(plan, task, needed.name());
  return *has_output;
}

std::vector<TaskKind> last_users(const FarmPlan& plan, const FarmTask& task) {
  std::vector<TaskKind> users;
  switch (task.step.kind) {
    case TaskKind::route:
      return {TaskKind::part};
    case TaskKind::part:
    case TaskKind::join:
      if (plan.lighting) users.push_back(TaskKind::light);
      break;
    case TaskKind::shade:
      if (!plan.has_tiles()) users.push_back(TaskKind::collect);
      break;
    case TaskKind::tune:
      return {TaskKind::collect};
    case TaskKind::bounce:
    case TaskKind::join_bounce:
      if (plan.shading && plan.shading->request.bounces > 1) users.push_back(TaskKind::collect);
      if (plan.renders_bounces()) users.push_back(TaskKind::frame);
      break;
    case TaskKind::light:
    case TaskKind::join_light:
    case TaskKind::collect:
    case TaskKind::frame:
      break;
  }
  return users;
}

bool TaskMarks::is_spent(const FarmTask& task) {
  const std::vector<TaskKind> users = last_users(plan_, task);
  return !users.empty() &&
         std::ranges::all_of(users, [&](TaskKind user) { return all_done(user); });
}

bool TaskMarks::all_done(TaskKind kind) {
  if (const auto found = all_done_.find(kind); found != all_done_.end()) return found->second;
  // Tasks run in this order about, so that the last one tells soonest that not all are done
  const bool all = std::all_of(plan_.tasks.rbegin(), plan_.tasks.rend(), [&](const FarmTask& task) {
    return task.step.kind != kind || is_done(task);
  });
  return all_done_[kind] = all;
}

TaskState TaskMarks::state(const FarmTask& task) {
  if (is_done(task)) return TaskState::done;
  return std::filesystem::exists(failed_mark(plan_, task)) ? TaskState::failed : TaskState::waiting;
}

std::string failure_of(const FarmPlan& plan, const FarmTask& task) {
  return text_of_log(failed_mark(plan, task));
}

void note_failure(const FarmPlan& plan, const FarmTask& task, const std::string& text) {
  std::filesystem::create_directories(failed_mark(plan, task).parent_path());
  write_text(failed_mark(plan, task), text);
}

void forget_failure(const FarmPlan& plan, const FarmTask& task) {
  std::filesystem::remove(failed_mark(plan, task));
}

}  // namespace ptc
