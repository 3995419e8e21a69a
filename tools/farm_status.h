// How far a plan is, on this machine or under Slurm.
#pragma once

#include "engine/pipeline/farm/plan.h"
#include "tools/common.h"

namespace ptc {

/// Notes that tasks of a plan begin to run now: the rate of farm_status() counts from here.
void note_begin(const FarmPlan& plan);

/// Returns how far a plan is. What stands on the disk decides what is done; Slurm is asked for
/// tasks that were submitted to it.
[[nodiscard]] Outcome farm_status(const FarmPlan& plan);

/// Adds the settings that a plan has chosen, and the error that they have, to the outcome of a run
/// or a status; nothing where no error is asked for, or they are not chosen yet.
void tell_tuning(const FarmPlan& plan, Outcome& outcome);

}  // namespace ptc
