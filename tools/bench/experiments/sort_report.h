// What a sort bench measured, as tables, text and a chart.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/sort_bench.h"

namespace ptc::bench {

/// {"rows": [...]}: a SortRow each, with nanoseconds of a point, and what it takes over its rivals:
/// of the panel "disk" `floor_share`, the floor's wall time over that of the sort; in memory
/// `speedup`, CPU time of std::sort over its own.
[[nodiscard]] nlohmann::ordered_json facts_of(const std::vector<SortRow>& rows);
[[nodiscard]] std::string sort_text(const std::vector<SortRow>& rows);
[[nodiscard]] Chart chart_of(const std::vector<SortRow>& rows);
/// sort.json, .csv, .svg and .png. @throws std::system_error
void write_reports(const std::filesystem::path& directory, const std::vector<SortRow>& rows);

}  // namespace ptc::bench
