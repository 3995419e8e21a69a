// Every task of a step needs all tasks of the step before it, so that steps with a dependency
// between them say what the plan says.
#include "tools/farm_export.h"

#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/slurm_arrays.h"

namespace ptc {
namespace {

std::string for_parallel(const FarmPlan& plan) {
  std::string text = fmt::format(
      "#!/bin/sh\n# Builds {} by GNU parallel. Its options can follow: --jobs 8, --sshlogin a,b\n"
      "set -e\n",
      plan.scene.string());
  for (const TaskStep& step : steps_of(plan)) {
    const std::vector<const FarmTask*> tasks = tasks_of(plan, step);
    text += "parallel --halt soon,fail=1 \"$@\" <<'TASKS'\n";
    for (const FarmTask* task : tasks)
      text += line_of(*task) + (tasks.size() > 1 ? " --threads 1\n" : "\n");
    text += "TASKS\n";
  }
  return text;
}

/// Returns the lines that submit an array.
/// @param after  the variables of the jobs that must be done before, as Slurm takes them
std::string lines_of(const FarmPlan& plan, const SlurmArray& array, const std::string& after,
                     unsigned cores) {
  std::string options;
  for (const std::string& option : slurm_options(plan, array, cores)) options += " " + option;
  return fmt::format("{}=$(sbatch --parsable{}{} <<'TASK'\n#!/bin/sh\n{}TASK\n)\n", array.name,
                     options, after.empty() ? "" : " --dependency=afterok" + after,
                     slurm_script(array));
}

std::string for_slurm(const FarmPlan& plan, unsigned cores) {
  std::string text = fmt::format(
      "#!/bin/sh\n# Submits the tasks of {} to Slurm, and prints the numbers of their jobs.\n"
      "set -e\nmkdir -p {}\n",
      plan.scene.string(), quoted((plan.folder() / "log").string()));
  std::string after, all;
  for (const TaskStep& step : steps_of(plan)) {
    std::string jobs;
    for (const SlurmArray& array : slurm_arrays(plan, step)) {
      text += lines_of(plan, array, after, cores);
      jobs += ":$" + array.name;
      all += " $" + array.name;
    }
    after = jobs;
  }
  return text + "echo" + all + "\n";
}

std::string for_openjd(const FarmPlan& plan) {
  using Json = nlohmann::ordered_json;
  Json steps = Json::array();
  std::string before;
  for (const TaskStep& step : steps_of(plan)) {
    const std::vector<const FarmTask*> tasks = tasks_of(plan, step);
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
    Json entry{{"name", step.name()}};
    if (!before.empty()) entry["dependencies"] = Json::array({{{"dependsOn", before}}});
    entry["hostRequirements"]["amounts"] =
        Json::array({{{"name", "amount.worker.memory"}, {"min", mebibytes(first)}}});
    entry["parameterSpace"]["taskParameterDefinitions"] = Json::array(
        {{{"name", "Number"}, {"type", "INT"}, {"range", fmt::format("0-{}", tasks.size() - 1)}}});
    entry["script"]["actions"]["onRun"] = {{"command", first.command[0]}, {"args", arguments}};
    steps.push_back(std::move(entry));
    before = step.name();
  }
  const Json job{{"specificationVersion", "jobtemplate-2023-09"},
                 {"name", plan.scene.stem().string()},
                 {"steps", steps}};
  return job.dump(2) + "\n";
}

}  // namespace

std::string exported(const FarmPlan& plan, Scheduler scheduler, unsigned cores) {
  switch (scheduler) {
    case Scheduler::parallel:
      return for_parallel(plan);
    case Scheduler::slurm:
      return for_slurm(plan, cores);
    case Scheduler::openjd:
      break;
  }
  return for_openjd(plan);
}

}  // namespace ptc
