// The marks of the tasks of a plan, by which all machines know what is done.
//
//   scene.parts/done/part.3     the plan, and whether the task has written its output
//   scene.parts/failed/part.3   what it said
#pragma once

#include <map>
#include <optional>
#include <string>
#include <system_error>

#include "engine/pipeline/farm/plan.h"

namespace ptc {

/// How far a task is.
enum class TaskState { waiting, failed, done };

/// What the marks in the folder of a plan say at one time: each is read once, when it is first
/// asked for.
class TaskMarks {
 public:
  /// @param plan  must outlive this
  explicit TaskMarks(const FarmPlan& plan) : plan_(plan) {}

  /// Returns how far a task is.
  [[nodiscard]] TaskState state(const FarmTask& task);
  /// Says whether a task is done. One whose output is gone is not, unless it is spent.
  [[nodiscard]] bool is_done(const FarmTask& task);
  /// Says whether no task needs the output of a task any more, because its last users are done.
  [[nodiscard]] bool is_spent(const FarmTask& task);

 private:
  /// Says whether all tasks of a kind are done.
  bool all_done(TaskKind kind);

  const FarmPlan& plan_;
  std::map<TaskKind, bool> all_done_;  ///< of the kinds that were asked for
};

/// Returns what a failed task said last; empty when it is not failed.
[[nodiscard]] std::string failure_of(const FarmPlan& plan, const FarmTask& task);
/// Notes that a task failed. @param text  what it said
void note_failure(const FarmPlan& plan, const FarmTask& task, const std::string& text);
/// Forgets that a task failed.
void forget_failure(const FarmPlan& plan, const FarmTask& task);

/// Marks a task as done, and whether it has written its output: a part without points has none.
void mark_done(const FarmPlan& plan, const FarmTask& task, bool has_output);
/// Removes the mark of a task when it is another plan's, before the task writes its output: if it
/// were killed then, that mark would speak of this plan's file.
void forget_other_plans(const FarmPlan& plan, const FarmTask& task);

/// Thrown by a task before its time. What other machines have written may come into view late, so
/// it is worth another try.
class NotYet : public std::system_error {
 public:
  using std::system_error::system_error;
};
/// Refuses a task before its time.
/// @param needed  name of the task that must come before it
/// @throws NotYet
[[noreturn]] void fail_unseen(const FarmPlan& plan, const FarmTask& task,
                              const std::string& needed);
/// Says whether a task that another one needs has written its output, by its mark: the output may
/// not be seen from this machine yet.
/// @throws as fail_unseen() when the mark is not seen
[[nodiscard]] bool has_output(const FarmPlan& plan, const FarmTask& task, const FarmTask& needed);
/// Returns the kinds of tasks that need the output of a task last; none when it stays.
[[nodiscard]] std::vector<TaskKind> last_users(const FarmPlan& plan, const FarmTask& task);

}  // namespace ptc
