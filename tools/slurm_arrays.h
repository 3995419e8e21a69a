// The tasks of a plan as arrays of jobs of Slurm.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "engine/pipeline/farm/plan.h"

namespace ptc {

/// An array of jobs, which does tasks of one step.
struct SlurmArray {
  std::string name;                  ///< "part_0"
  std::size_t first = 0;             ///< number of the task that has index 0
  std::vector<std::size_t> indices;  ///< of the tasks, ascending
  const FarmTask* task = nullptr;    ///< one of them
  double seconds = 0;                ///< of the longest
};

/// Returns a word as a shell takes it.
[[nodiscard]] std::string quoted(const std::string& word);

/// Returns the steps of a plan, in the order in which they run.
[[nodiscard]] std::vector<TaskStep> steps_of(const FarmPlan& plan);

/// Returns the tasks of a step.
[[nodiscard]] std::vector<const FarmTask*> tasks_of(const FarmPlan& plan, const TaskStep& step);

/// Returns MiB that a task is given: its cap, and what a program takes besides.
[[nodiscard]] std::uint64_t mebibytes(const FarmTask& task);

/// Returns the command line of a task for a shell.
/// @param number  takes the place of its number; empty: the number stays
[[nodiscard]] std::string line_of(const FarmTask& task, const std::string& number = {});

/// Returns arrays for tasks of a step, as many as the limit of Slurm on the length of one asks for.
/// @param wanted  says whether a task is among them; empty: all are
[[nodiscard]] std::vector<SlurmArray> slurm_arrays(
    const FarmPlan& plan, const TaskStep& step,
    const std::function<bool(const FarmTask&)>& wanted = {});

/// Returns the options of sbatch for an array, as a shell or a line #SBATCH takes them.
/// @param cores  of a job; 0: as Slurm gives it, one
[[nodiscard]] std::vector<std::string> slurm_options(const FarmPlan& plan, const SlurmArray& array,
                                                     unsigned cores);

/// Returns the script that each job of an array runs. A job is queued again as worth_retry() and
/// kMaxRetries say, and gives up after kMaxRestarts, also when Slurm has queued it again.
[[nodiscard]] std::string slurm_script(const SlurmArray& array);

/// The file that has the messages of a task under Slurm.
[[nodiscard]] std::filesystem::path slurm_log(const FarmPlan& plan, const FarmTask& task);

}  // namespace ptc
