// What a plan may not ask for.
#pragma once

#include <filesystem>

#include "engine/pipeline/farm/plan.h"

namespace ptc {

/// Refuses what a farm does not build. @throws RequestError
void check_plan_request(const BuildRequest& request);

/// Says whether a path has characters that end a line of a script or a table.
[[nodiscard]] bool has_control_characters(const std::filesystem::path& path);

/// Refuses a plan whose tasks would replace an input, or that scripts cannot name.
/// @throws RequestError that names both files; FormatError, std::system_error for inputs
void check_plan_paths(const BuildRequest& request, const FarmPlan& plan);

}  // namespace ptc
