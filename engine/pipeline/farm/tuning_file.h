// The settings that the task `tune` of a plan has chosen, as the tasks that shade take them.
#pragma once

#include "engine/pipeline/farm/plan.h"
#include "engine/pipeline/quality/tuning.h"

namespace ptc {

/// Writes the settings of a plan, whole or not at all. @throws std::system_error
void write_tuning(const FarmPlan& plan, const TuningReport& tuning);

/// Reads the settings of a plan: of TuningReport::gather, its angles, its inflation and its
/// resolution.
/// @throws DataError when they are damaged, or of another plan; std::system_error
[[nodiscard]] TuningReport read_tuning(const FarmPlan& plan);

}  // namespace ptc
