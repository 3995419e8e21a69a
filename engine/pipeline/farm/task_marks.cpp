#include "engine/pipeline/farm/task_marks.h"

#include <algorithm>
#include <cstdint>
#include <system_error>
#include <vector>

#include "engine/io/file/state_file.h"
#include "engine/io/file/text_file.h"

namespace ptc {
namespace {

std::filesystem::path done_mark(const FarmPlan& plan, const FarmTask& task) {
  return plan.folder() / "done" / task.name();
}

std::filesystem::path failed_mark(const FarmPlan& plan, const FarmTask& task) {
  return plan.folder() / "failed" / task.name();
}

/// Returns whether a task has written its output; nothing when it is not marked as done.
std::optional<bool> written(const FarmPlan& plan, const FarmTask& task) {
  const std::filesystem::path mark = done_mark(plan, task);
  std::vector<std::byte> bytes;
  try {
    bytes = read_state(mark);
  } catch (const std::system_error& error) {
    if (error.code() != std::errc::no_such_file_or_directory) throw;
    return std::nullopt;
  }
  StateReader state(bytes, mark.string());
  if (state.get<std::uint64_t>() != plan.id) return std::nullopt;
  return state.get<std::uint8_t>() != 0;
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

bool is_done(const FarmPlan& plan, const FarmTask& task) {
  const std::optional<bool> has_output = written(plan, task);
  if (!has_output) return false;
  if (!*has_output || std::filesystem::exists(task.outputs.at(0))) return true;
  return is_spent(plan, task);
}

bool has_output(const FarmPlan& plan, const FarmTask& task, const FarmTask& needed) {
  const std::optional<bool> has_output = written(plan, needed);
  if (!has_output) fail_unseen(plan, task, needed.name());
  return *has_output;
}

std::optional<TaskKind> last_user(const FarmPlan& plan, const FarmTask& task) {
  switch (task.step.kind) {
    case TaskKind::route:
      return TaskKind::part;
    case TaskKind::part:
    case TaskKind::join:
      return plan.lighting ? std::optional(TaskKind::light) : std::nullopt;
    case TaskKind::bounce:
    case TaskKind::join_bounce:
    case TaskKind::shade:
      return TaskKind::collect;
    case TaskKind::light:
    case TaskKind::join_light:
    case TaskKind::collect:
      break;
  }
  return std::nullopt;
}

bool is_spent(const FarmPlan& plan, const FarmTask& task) {
  const std::optional<TaskKind> user = last_user(plan, task);
  return user && std::ranges::all_of(plan.tasks, [&](const FarmTask& other) {
           return other.step.kind != *user || is_done(plan, other);
         });
}

TaskState state_of(const FarmPlan& plan, const FarmTask& task) {
  if (is_done(plan, task)) return TaskState::done;
  return std::filesystem::exists(failed_mark(plan, task)) ? TaskState::failed : TaskState::waiting;
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
