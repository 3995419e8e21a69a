// The jobs of a plan under Slurm: submitted, asked for and cancelled by Slurm's own programs.
//
//   city.slurm/part_0.sh ...   what was submitted, for sbatch
//   city.slurm/jobs.json       numbers of the jobs
//
// Slurm says what waits and what runs; what is done stands on the disk (TaskMarks).
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/pipeline/farm/plan.h"

namespace ptc {

/// What Slurm says of a task.
struct SlurmTask {
  std::string job;    ///< "12_3", as its programs take it
  std::string state;  ///< "RUNNING"; empty when it is no longer in the queue
  std::string where;  ///< the reason why it waits, or the machine that it runs on
};

/// What Slurm says of the tasks of a plan, by name.
struct SlurmQueue {
  std::map<std::string, SlurmTask> tasks;  ///< those that were submitted
  std::string trouble;                     ///< why Slurm did not answer; empty when it did
};

/// Returns the folder of the scripts, "city.slurm" beside "city.json".
[[nodiscard]] std::filesystem::path slurm_folder(const FarmPlan& plan);

/// Submits the tasks that are not done: an array for each step, after the one before.
/// @return  the numbers of the jobs; none when all tasks are done
/// @throws DataError when jobs of the plan are in the queue; std::system_error with what sbatch
///         said when it fails, with the jobs before it cancelled
std::vector<std::string> submit_to_slurm(const FarmPlan& plan, unsigned cores);

/// Asks Slurm for the jobs of a plan. @return  nothing when none were submitted
[[nodiscard]] std::optional<SlurmQueue> slurm_queue(const FarmPlan& plan);

/// Asks Slurm how a job ended that is not in the queue: "OUT_OF_MEMORY". Empty when it has
/// forgotten.
[[nodiscard]] std::string slurm_end(const std::string& job);

/// Cancels the jobs of a plan and waits until they have left the queue, half a minute at most.
/// @return  the numbers of the jobs that were in the queue
/// @throws DataError when no jobs were submitted; std::system_error when Slurm does not answer, or
///         jobs do not leave
std::vector<std::string> cancel_in_slurm(const FarmPlan& plan);

}  // namespace ptc
