#include "tools/farm_status.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "engine/io/file/text_file.h"
#include "engine/pipeline/farm/tasks.h"
#include "engine/pipeline/farm/tuning_file.h"
#include "tools/report.h"
#include "tools/slurm_arrays.h"
#include "tools/slurm_jobs.h"

namespace ptc {
namespace {

constexpr std::size_t kTailBytes = 2000;  // of what a failed task said

std::filesystem::path begin_file(const FarmPlan& plan) {
  return plan.folder() / "log" / "begun";
}

/// Seconds since 1970.
double now() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

double done_seconds(const FarmPlan& plan) {
  TaskMarks marks(plan);
  double seconds = 0;
  for (const FarmTask& task : plan.tasks) seconds += marks.is_done(task) ? task.seconds : 0;
  return seconds;
}

/// Returns how many of the planned seconds a second has brought since the tasks began.
std::optional<double> rate_of(const FarmPlan& plan, double done) {
  std::ifstream file(begin_file(plan));
  double begun = 0, done_then = 0;
  if (!(file >> begun >> done_then)) return std::nullopt;
  const double passed = now() - begun, more = done - done_then;
  return passed > 0 && more > 0 ? std::optional(more / passed) : std::nullopt;
}

/// Returns the end of a log; empty where there is none.
std::string tail_of(const std::filesystem::path& path) {
  const std::string text = text_of_log(path);
  if (text.size() <= kTailBytes) return text;
  const std::size_t line = text.find('\n', text.size() - kTailBytes);
  return "...\n" + text.substr(line == std::string::npos ? text.size() - kTailBytes : line + 1);
}

/// A task as it is shown.
struct Shown {
  const FarmTask* task;
  std::string state;
  std::string error;  ///< of a failed one
  SlurmTask slurm;    ///< of a submitted one
};

/// Returns the state of a task that Slurm has, in our words.
std::string word_of(const std::string& state) {
  if (state == "PENDING" || state == "REQUEUED" || state == "SUSPENDED") return "queued";
  return "running";  // or on its way out
}

/// Finds how a task is that is not done.
/// @param queue  what Slurm said before the disk was asked; null when nothing was submitted
void show_undone(const FarmPlan& plan, const SlurmQueue* queue, bool failed, Shown& shown) {
  const FarmTask& task = *shown.task;
  shown.state = failed ? "failed" : "waiting";
  if (failed) shown.error = failure_of(plan, task);
  if (queue == nullptr || !queue->tasks.contains(task.name())) return;
  shown.slurm = queue->tasks.at(task.name());
  if (!shown.slurm.state.empty()) {
    shown.state = word_of(shown.slurm.state);
    shown.error.clear();
  } else if (queue->trouble.empty()) {
    // It has left the queue undone: what it or Slurm said last is in its log
    shown.slurm.state = slurm_end(shown.slurm.job);
    if (!failed && shown.slurm.state == "CANCELLED") return;
    shown.state = "failed";
    if (const std::string tail = tail_of(slurm_log(plan, task)); !tail.empty()) shown.error = tail;
    if (!shown.slurm.state.empty()) {
      shown.error += fmt::format("{}Slurm says {}\n",
                                 shown.error.empty() || shown.error.ends_with('\n') ? "" : "\n",
                                 shown.slurm.state);
    }
  }
}

std::vector<Shown> shown_tasks(const FarmPlan& plan, const SlurmQueue* queue) {
  TaskMarks marks(plan);
  std::vector<Shown> tasks;
  for (const FarmTask& task : plan.tasks) {
    Shown& shown =
        tasks.emplace_back(Shown{.task = &task, .state = "done", .error = {}, .slurm = {}});
    const TaskState state = marks.state(task);
    if (state != TaskState::done) show_undone(plan, queue, state == TaskState::failed, shown);
  }
  return tasks;
}

/// A bar of the share that is done: "[#####.....]".
std::string bar(double share) {
  constexpr std::size_t kWidth = 30;
  const auto full = static_cast<std::size_t>(share * kWidth);
  return "[" + std::string(full, '#') + std::string(kWidth - full, '.') + "]";
}

nlohmann::ordered_json facts_of(const Shown& shown) {
  nlohmann::ordered_json facts{{"name", shown.task->name()}, {"state", shown.state}};
  if (shown.state == "failed") facts["error"] = shown.error;
  if (!shown.slurm.job.empty()) facts["job"] = shown.slurm.job;
  if (!shown.slurm.state.empty()) facts["slurm"] = shown.slurm.state;
  if (!shown.slurm.where.empty()) facts["where"] = shown.slurm.where;
  return facts;
}

}  // namespace

void note_begin(const FarmPlan& plan) {
  std::filesystem::create_directories(begin_file(plan).parent_path());
  std::ofstream(begin_file(plan)) << fmt::format("{:.3f} {:.9g}\n", now(), done_seconds(plan));
}

Outcome farm_status(const FarmPlan& plan) {
  // Ask Slurm first: a task that leaves the queue meanwhile is then found done
  const std::optional<SlurmQueue> queue = slurm_queue(plan);
  const std::vector<Shown> tasks = shown_tasks(plan, queue ? &*queue : nullptr);

  // Add up
  std::map<std::string, std::size_t> counts;
  double seconds = 0, done = 0;
  nlohmann::ordered_json states = nlohmann::ordered_json::array();
  std::string failures;
  for (const Shown& shown : tasks) {
    ++counts[shown.state];
    seconds += shown.task->seconds;
    done += shown.state == "done" ? shown.task->seconds : 0;
    states.push_back(facts_of(shown));
    if (shown.state != "failed") continue;
    failures += fmt::format("{} failed:\n{}{}", shown.task->name(), shown.error,
                            shown.error.ends_with('\n') ? "" : "\n");
  }
  const std::optional<double> rate = rate_of(plan, done);
  const double share = seconds > 0 ? done / seconds : 1, left = seconds - done;

  // Say it
  Outcome outcome{.facts = {{"plan", plan.file.string()}, {"tasks", plan.tasks.size()}},
                  .summary = {}};
  for (const char* state : {"done", "failed", "running", "queued", "waiting"})
    outcome.facts[state] = counts[state];
  outcome.facts["share"] = share;
  outcome.facts["core_seconds_left"] = left;
  if (rate) {
    outcome.facts["core_seconds_per_second"] = *rate;
    outcome.facts["seconds_left"] = left / *rate;
  }
  if (queue && !queue->trouble.empty()) outcome.facts["trouble"] = queue->trouble;
  outcome.facts["states"] = states;
  outcome.summary = fmt::format("{} {:.0f} %, {} of {} tasks done, {} failed", bar(share),
                                100 * share, counts["done"], plan.tasks.size(), counts["failed"]);
  if (queue)
    outcome.summary += fmt::format(", {} running, {} queued", counts["running"], counts["queued"]);
  outcome.summary += fmt::format(", about {:.0f} s of one core left", left);
  if (rate && left > 0)
    outcome.summary +=
        fmt::format(": {:.0f} s at {:.2g} times the speed of one core", left / *rate, *rate);
  outcome.summary += "\n" + failures;
  if (queue && !queue->trouble.empty()) outcome.summary += queue->trouble + "\n";
  tell_tuning(plan, outcome);
  return outcome;
}

void tell_tuning(const FarmPlan& plan, Outcome& outcome) {
  const auto tune = std::ranges::find(plan.tasks, TaskStep{TaskKind::tune}, &FarmTask::step);
  if (tune == plan.tasks.end() || !TaskMarks(plan).is_done(*tune)) return;
  try {
    const TuningReport tuning = read_tuning(plan);
    outcome.facts["tuning"] = facts_of(tuning);
    outcome.summary += tuning_text(tuning);
  } catch (const std::exception& error) {  // it is damaged or gone: the rest is worth telling
    outcome.summary += fmt::format("{}\n", error.what());
  }
}

}  // namespace ptc
