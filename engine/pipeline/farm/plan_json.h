// A plan as JSON.
#pragma once

#include <filesystem>
#include <string>

#include "engine/pipeline/farm/plan.h"

namespace ptc {

/// Returns a plan as JSON.
[[nodiscard]] std::string plan_to_json(const FarmPlan& plan);

/// Reads a plan. Its tasks lack what follows from the plan: command, files, and tasks before them.
/// @param file  the plan's file
/// @throws DataError that names the file
[[nodiscard]] FarmPlan plan_from_json(const std::string& text, const std::filesystem::path& file);

}  // namespace ptc
