// Runs the tasks of a plan on this machine, as many at once as a cap on memory allows.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/pipeline/farm/plan.h"
#include "engine/pipeline/run.h"

namespace ptc {

/// What came of the tasks of a plan.
struct FarmRun {
  std::size_t ran = 0, skipped = 0;  ///< tasks that ran, and that were done before
  std::size_t retried = 0;           ///< runs of tasks that failed and were begun again
  std::vector<std::string> failed;   ///< names
  std::string errors;                ///< what they said, a paragraph for each
  int exit_code = 0;                 ///< of the first that failed
};

/// Runs all tasks that are not done, each as a process of its own that ends with this one. A task
/// that failed is run again as worth_retry() and kMaxRetries allow. After a failure that is not, no
/// task is started; those that run are awaited.
/// @param run  the cap on the memory of all tasks together, and the number of threads
/// @throws LimitError when the cap is smaller than the memory of a task; DataError when tasks wait
///         for such as never run; std::system_error
[[nodiscard]] FarmRun run_plan(const FarmPlan& plan, const RunOptions& run, Progress& progress);

}  // namespace ptc
