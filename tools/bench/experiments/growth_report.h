// What a growth run found: JSON, CSV, words, a chart.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/growth.h"

namespace ptc::bench {

/// {"rows": [...]}; all rows have the same members, what was not measured is null.
[[nodiscard]] nlohmann::ordered_json facts_of(const std::vector<GrowthRow>& rows);
/// A panel for time against each of what varied; under caps wall time and what was read, too.
/// @param rows  one or more
[[nodiscard]] Chart chart_of(const std::vector<GrowthRow>& rows);
/// Writes growth.json, .csv, .svg and .png into a directory. @throws std::system_error
void write_reports(const std::filesystem::path& directory, const std::vector<GrowthRow>& rows);
/// A table of all rows.
[[nodiscard]] std::string growth_text(const std::vector<GrowthRow>& rows);

}  // namespace ptc::bench
