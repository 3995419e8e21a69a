// Every task of a kind needs all tasks of the kind before it, so that three steps with a dependency
// between them say what the plan says.
#include "tools/farm_export.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/farm_retry.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxArray = 1000;  // tasks of an array: the limit of Slurm as it comes

/// Returns the tasks of a kind.
std::vector<const FarmTask*> tasks_of(const FarmPlan& plan, TaskKind kind) {
  std::vector<const FarmTask*> tasks;
  for (const FarmTask& task : plan.tasks) {
    if (task.kind == kind) tasks.push_back(&task);
  }
  return tasks;
}

constexpr TaskKind kKinds[] = {TaskKind::route, TaskKind::part, TaskKind::join};

/// Returns a word as a shell takes it.
std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// Returns the command line of a task, with another word in place of its number.
std::string line_of(const FarmTask& task, const std::string& number = {}) {
  std::string line;
  for (std::size_t i = 0; i < task.command.size(); ++i) {
    const bool is_number = i > 0 && task.command[i - 1] == "--number" && !number.empty();
    line += (line.empty() ? "" : " ") + (is_number ? number : quoted(task.command[i]));
  }
  return line;
}

/// Returns MiB that a task is given: its cap, and what a program takes besides.
std::uint64_t mebibytes(const FarmTask& task) {
  return ((task.memory_bytes + task.memory_bytes / 10) >> 20) + 64;
}

std::string for_parallel(const FarmPlan& plan) {
  std::string text = fmt::format(
      "#!/bin/sh\n# Builds {} by GNU parallel. Its options can follow: --jobs 8, --sshlogin a,b\n"
      "set -e\n",
      plan.scene.string());
  for (const TaskKind kind : kKinds) {
    const std::vector<const FarmTask*> tasks = tasks_of(plan, kind);
    text += "parallel --halt soon,fail=1 \"$@\" <<'TASKS'\n";
    for (const FarmTask* task : tasks)
      text += line_of(*task) + (tasks.size() > 1 ? " --threads 1\n" : "\n");
    text += "TASKS\n";
  }
  return text;
}

/// Returns a path as Slurm takes it in a pattern of names.
std::string without_pattern(const std::filesystem::path& path) {
  std::string text;
  for (const char c : path.string()) text += c == '%' ? std::string("%%") : std::string(1, c);
  return text;
}

/// Returns the lines that submit some tasks of a kind as one array.
/// @param after  the variables of the jobs that must be done before, as Slurm takes them
std::string array_of(const FarmPlan& plan, std::span<const FarmTask* const> tasks,
                     const std::string& name, const std::string& after) {
  const FarmTask& first = *tasks.front();
  const double seconds = (*std::ranges::max_element(tasks, {}, &FarmTask::seconds))->seconds;
  const std::string number = fmt::format("\"$((SLURM_ARRAY_TASK_ID + {}))\"", first.number);
  const std::string log = without_pattern(plan.folder() / "log" / name) + ".%a";
  return fmt::format(
      "{0}=$(sbatch --parsable --requeue --kill-on-invalid-dep=yes --job-name={1} \\\n"
      "  --array=0-{2} --mem={3}M --time={4} \\\n"
      "  --output={5}{6} <<'TASK'\n"
      "#!/bin/sh\n"
      "{7} --threads \"${{SLURM_CPUS_PER_TASK:-1}}\" && exit 0\n"
      "code=$?\n"
      "# What the machine refused may work on another one\n"
      "if {{ {8}; }} && [ \"${{SLURM_RESTART_COUNT:-0}}\" -lt {9} ]; then\n"
      "  scontrol requeue \"$SLURM_JOB_ID\" && sleep 60\n"
      "fi\n"
      "exit $code\n"
      "TASK\n"
      ")\n",
      name, quoted(plan.scene.stem().string() + "." + name), tasks.size() - 1, mebibytes(first),
      static_cast<int>(std::ceil(seconds / 6)) + 5, quoted(log),
      after.empty() ? "" : " --dependency=afterok" + after, line_of(first, number),
      shell_worth_retry("code"), kMaxRetries);
}

std::string for_slurm(const FarmPlan& plan) {
  std::string text = fmt::format(
      "#!/bin/sh\n# Submits the tasks of {} to Slurm, and prints the numbers of their jobs.\n"
      "set -e\nmkdir -p {}\n",
      plan.scene.string(), quoted((plan.folder() / "log").string()));
  std::string after, all;
  for (const TaskKind kind : kKinds) {
    const std::vector<const FarmTask*> tasks = tasks_of(plan, kind);
    std::string jobs;
    for (std::size_t at = 0; at < tasks.size(); at += kMaxArray) {
      const auto some = std::span(tasks).subspan(at, std::min(kMaxArray, tasks.size() - at));
      const std::string name = fmt::format("{}_{}", name_of(kind), at / kMaxArray);
      text += array_of(plan, some, name, after);
      jobs += ":$" + name;
      all += " $" + name;
    }
    after = jobs;
  }
  return text + "echo" + all + "\n";
}

std::string for_openjd(const FarmPlan& plan) {
  using Json = nlohmann::ordered_json;
  Json steps = Json::array();
  std::string before;
  for (const TaskKind kind : kKinds) {
    const std::vector<const FarmTask*> tasks = tasks_of(plan, kind);
    const FarmTask& first = *tasks.front();
    Json arguments = Json::array();
    for (std::size_t i = 1; i < first.command.size(); ++i) {
      const bool is_number = first.command[i - 1] == "--number";
      arguments.push_back(is_number ? "{{Task.Param.Number}}" : first.command[i]);
    }
    if (tasks.size() > 1) {  // a machine may run many beside each other
      arguments.push_back("--threads");
      arguments.push_back("1");
    }
    Json step{{"name", name_of(kind)}};
    if (!before.empty()) step["dependencies"] = Json::array({{{"dependsOn", before}}});
    step["hostRequirements"]["amounts"] =
        Json::array({{{"name", "amount.worker.memory"}, {"min", mebibytes(first)}}});
    step["parameterSpace"]["taskParameterDefinitions"] = Json::array(
        {{{"name", "Number"}, {"type", "INT"}, {"range", fmt::format("0-{}", tasks.size() - 1)}}});
    step["script"]["actions"]["onRun"] = {{"command", first.command[0]}, {"args", arguments}};
    steps.push_back(std::move(step));
    before = name_of(kind);
  }
  const Json job{{"specificationVersion", "jobtemplate-2023-09"},
                 {"name", plan.scene.stem().string()},
                 {"steps", steps}};
  return job.dump(2) + "\n";
}

}  // namespace

std::string exported(const FarmPlan& plan, Scheduler scheduler) {
  switch (scheduler) {
    case Scheduler::parallel:
      return for_parallel(plan);
    case Scheduler::slurm:
      return for_slurm(plan);
    case Scheduler::openjd:
      break;
  }
  return for_openjd(plan);
}

}  // namespace ptc
