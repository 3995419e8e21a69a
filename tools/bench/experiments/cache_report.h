// What a cache bench measured, as tables, text and a chart.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/cache_bench.h"

namespace ptc::bench {

/// {"rows": [...]}: a CacheRow each, with nanoseconds of a receiver (of a lookup in "hits"), and
/// `in_core_share`, its wall time over that with a frame for each page.
[[nodiscard]] nlohmann::ordered_json facts_of(const std::vector<CacheRow>& rows);
[[nodiscard]] std::string cache_text(const std::vector<CacheRow>& rows);
[[nodiscard]] Chart chart_of(const std::vector<CacheRow>& rows);
/// cache.json, .csv, .svg and .png. @throws std::system_error
void write_reports(const std::filesystem::path& directory, const std::vector<CacheRow>& rows);

}  // namespace ptc::bench
