// The tasks that a plan implies.
#pragma once

#include <cstdint>

#include "engine/pipeline/farm/plan.h"

namespace ptc {

/// Adds the tasks of a plan, in an order in which each comes behind those that it needs. Their
/// command lines stay empty.
/// @param memory_bytes  the cap of each
void add_tasks(FarmPlan& plan, std::uint64_t memory_bytes);

}  // namespace ptc
