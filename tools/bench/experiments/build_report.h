// What a build bench measured, as tables, text and a chart.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/build_bench.h"

namespace ptc::bench {

/// {"rows": [...]}: a BuildRow each, with nanoseconds of a point, `moved_share`, bytes moved over
/// those of the input, and `floor_share`, the floor's wall time over that of the build.
[[nodiscard]] nlohmann::ordered_json facts_of(const std::vector<BuildRow>& rows);
[[nodiscard]] std::string build_text(const std::vector<BuildRow>& rows);
[[nodiscard]] Chart chart_of(const std::vector<BuildRow>& rows);
/// build.json, .csv, .svg and .png. @throws std::system_error
void write_reports(const std::filesystem::path& directory, const std::vector<BuildRow>& rows);

}  // namespace ptc::bench
