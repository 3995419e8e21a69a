// The tasks that build the parts of a scene.
#pragma once

#include <cstdint>

#include "engine/base/progress.h"
#include "engine/pipeline/farm/plan.h"
#include "engine/pipeline/run.h"

namespace ptc {

/// Checks that each task of a plan can run under a cap, with one thread.
/// @throws LimitError that names the least cap that works
void require_task_memory(const FarmPlan& plan, std::uint64_t memory_bytes);

/// Sends the points of an input to the ranges that they belong to.
/// @throws DataError when the input is not as the plan says; as reading it; std::system_error
void route_input(const FarmPlan& plan, const FarmTask& task, const RunOptions& run,
                 Progress& progress);

/// Sorts and builds the points that all routes have for a range, and writes the part's edges beside
/// it.
/// @return  whether it has points; one without has no file
/// @throws DataError when a route is damaged, or rounding moves a point out of the part;
///         std::system_error
[[nodiscard]] bool build_part(const FarmPlan& plan, const FarmTask& task, const RunOptions& run,
                              Progress& progress);

}  // namespace ptc
