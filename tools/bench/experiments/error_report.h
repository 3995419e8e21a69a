// What an error run found: JSON, CSV, words, a chart.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/error_knob.h"

namespace ptc::bench {

/// {"rows": [...], "ladder": [...], "slopes": {scene: ...}}; what was not measured is null.
[[nodiscard]] nlohmann::ordered_json facts_of(const std::vector<SceneErrors>& scenes);

/// Measured against asked; error against time over the ladder.
[[nodiscard]] Chart chart_of(const std::vector<SceneErrors>& scenes);

/// Writes error.json, error.csv, ladder.csv, error.svg and error.png.
/// @param scenes  one or more
/// @throws std::system_error
void write_reports(const std::filesystem::path& directory, const std::vector<SceneErrors>& scenes);

/// A table of all rows and one of the ladder, with slopes.
[[nodiscard]] std::string error_text(const std::vector<SceneErrors>& scenes);

}  // namespace ptc::bench
