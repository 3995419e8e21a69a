// Files that measurements end up in.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/chart/statistics.h"

namespace ptc::bench {

/// null where there is no finite number.
[[nodiscard]] nlohmann::ordered_json number(double value);

/// Members of a row: seconds of wall time, nanoseconds of CPU time a point; medians, least and
/// greatest.
[[nodiscard]] nlohmann::ordered_json time_facts(const Spread& wall, const Spread& cpu,
                                                std::uint64_t points);

/// A number for a table that people read: by a format as "{:.1f}", or a dash where it is not
/// finite.
[[nodiscard]] std::string or_dash(double value, const char* format);

/// The series of a panel that has this name, a new one if there is none.
[[nodiscard]] ChartSeries& series_of(ChartPanel& panel, const std::string& name, bool dashed);

/// Writes NAME.json, and its "rows" as NAME.csv: their members as columns, null as an empty cell.
/// @param facts  "rows" is an array of one or more objects with the same members
/// @throws std::system_error
void write_tables(const std::filesystem::path& name, const nlohmann::ordered_json& facts);

/// Writes NAME.svg and NAME.png. @throws as write_chart()
void write_figures(const std::filesystem::path& name, const Chart& chart);

}  // namespace ptc::bench
