// The tasks of a plan as other schedulers take them.
#pragma once

#include <string>

#include "engine/pipeline/farm/plan.h"

namespace ptc {

/// A scheduler that runs command lines.
enum class Scheduler { parallel, slurm, openjd };

/// Returns what a scheduler takes: a shell script that calls GNU parallel once for each step of a
/// plan; a shell script that submits arrays of jobs to Slurm, each after those that it needs; or a
/// job template of Open Job Description (2023-09) as JSON.
/// @param cores  that a job of Slurm asks for; 0: one
[[nodiscard]] std::string exported(const FarmPlan& plan, Scheduler scheduler, unsigned cores);

}  // namespace ptc
