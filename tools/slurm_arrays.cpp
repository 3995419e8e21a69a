#include "tools/slurm_arrays.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "tools/farm_retry.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxArray = 1000;  // tasks of an array: the limit of Slurm as it comes
constexpr unsigned kMaxRestarts = 10;    // of a job, by Slurm or by itself

/// Returns a path as Slurm takes it in a pattern of names.
std::string without_pattern(const std::filesystem::path& path) {
  std::string text;
  for (const char c : path.string()) text += c == '%' ? std::string("%%") : std::string(1, c);
  return text;
}

std::string name_of_array(const TaskStep& step, std::size_t number) {
  return fmt::format("{}_{}", step.name(), number / kMaxArray);
}

/// Returns ascending numbers as ranges: "0-3,7".
std::string ranges_of(const std::vector<std::size_t>& numbers) {
  std::string text;
  for (std::size_t i = 0, end = 0; i < numbers.size(); i = end) {
    while (end < numbers.size() && numbers[end] == numbers[i] + (end - i)) ++end;
    text += fmt::format("{}{}-{}", text.empty() ? "" : ",", numbers[i], numbers[end - 1]);
  }
  return text;
}

}  // namespace

std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::vector<TaskStep> steps_of(const FarmPlan& plan) {
  std::vector<TaskStep> steps;
  for (const FarmTask& task : plan.tasks) {
    if (steps.empty() || steps.back() != task.step) steps.push_back(task.step);
  }
  return steps;
}

std::vector<const FarmTask*> tasks_of(const FarmPlan& plan, const TaskStep& step) {
  std::vector<const FarmTask*> tasks;
  for (const FarmTask& task : plan.tasks) {
    if (task.step == step) tasks.push_back(&task);
  }
  return tasks;
}

std::uint64_t mebibytes(const FarmTask& task) {
  return ((task.memory_bytes + task.memory_bytes / 10) >> 20) + 64;
}

std::string line_of(const FarmTask& task, const std::string& number) {
  std::string line;
  for (std::size_t i = 0; i < task.command.size(); ++i) {
    const bool is_number = i > 0 && task.command[i - 1] == "--number" && !number.empty();
    line += (line.empty() ? "" : " ") + (is_number ? number : quoted(task.command[i]));
  }
  return line;
}

std::vector<SlurmArray> slurm_arrays(const FarmPlan& plan, const TaskStep& step,
                                     const std::function<bool(const FarmTask&)>& wanted) {
  std::vector<SlurmArray> arrays;
  for (const FarmTask* task : tasks_of(plan, step)) {
    if (wanted && !wanted(*task)) continue;
    const std::string name = name_of_array(step, task->number);
    if (arrays.empty() || arrays.back().name != name) {
      arrays.push_back({.name = name, .first = task->number / kMaxArray * kMaxArray, .task = task});
    }
    arrays.back().indices.push_back(task->number % kMaxArray);
    arrays.back().seconds = std::max(arrays.back().seconds, task->seconds);
  }
  return arrays;
}

std::vector<std::string> slurm_options(const FarmPlan& plan, const SlurmArray& array,
                                       unsigned cores) {
  const std::string log = without_pattern(plan.folder() / "log" / array.name) + ".%a";
  std::vector<std::string> options{
      "--requeue",
      "--kill-on-invalid-dep=yes",
      "--job-name=" + quoted(plan.scene.stem().string() + "." + array.name),
      "--array=" + ranges_of(array.indices),
      fmt::format("--mem={}M", mebibytes(*array.task)),
      fmt::format("--time={}", static_cast<int>(std::ceil(array.seconds / 6)) + 5),
      "--open-mode=append",
      "--output=" + quoted(log)};
  if (cores > 0) options.push_back(fmt::format("--cpus-per-task={}", cores));
  return options;
}

std::string slurm_script(const SlurmArray& array) {
  const std::string number = fmt::format("\"$((SLURM_ARRAY_TASK_ID + {}))\"", array.first);
  return fmt::format(
      "if [ \"${{SLURM_RESTART_COUNT:-0}}\" -gt {0} ]; then\n"
      "  echo \"it was begun more than {0} times\" >&2\n"
      "  exit 1\n"
      "fi\n"
      "{1} --threads \"${{SLURM_CPUS_PER_TASK:-1}}\" && exit 0\n"
      "code=$?\n"
      "# What the machine refused may work on another one\n"
      "if {{ {2}; }} && [ \"${{SLURM_RESTART_COUNT:-0}}\" -lt {3} ]; then\n"
      "  scontrol requeue \"$SLURM_JOB_ID\" && sleep 60\n"
      "fi\n"
      "exit $code\n",
      kMaxRestarts, line_of(*array.task, number), shell_worth_retry("code"), kMaxRetries);
}

std::filesystem::path slurm_log(const FarmPlan& plan, const FarmTask& task) {
  return plan.folder() / "log" /
         fmt::format("{}.{}", name_of_array(task.step, task.number), task.number % kMaxArray);
}

}  // namespace ptc
