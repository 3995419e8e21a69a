// The tasks of a plan.
#pragma once

#include <functional>
#include <string>

#include "engine/base/progress.h"
#include "engine/pipeline/farm/plan.h"
#include "engine/pipeline/farm/task_marks.h"
#include "engine/pipeline/run.h"

namespace ptc {

/// Renders the picture of a task, and throws when it cannot.
using RenderFrame = std::function<void(const FarmTask& task)>;

/// Runs a task, unless it is done, and marks it as done or failed.
///
/// Processes that run one task at the same time, on one machine or on several, do no harm: each
/// writes under a name of its own, all publish the same bytes, and one that fails after another has
/// done the task ends well.
/// @param run    the resources of the task
/// @param frame  renders the picture of a task of that kind; null: such tasks are refused
/// @return  false when it was done before, or by another process
/// @throws std::invalid_argument for a refused picture; std::system_error (EAGAIN) when a task that
/// must be done before is not; as the task
bool run_task(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress,
              const RenderFrame& frame = {});

/// Removes what tasks wrote that no other one needs any more, and temporary files that killed tasks
/// have left. Tasks do so themselves, unless they are killed before.
void remove_spent(const FarmPlan& plan);

}  // namespace ptc
