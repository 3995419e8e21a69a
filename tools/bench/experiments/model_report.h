// What a study of the model found: JSON, CSV, words, charts.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/model.h"

namespace ptc::bench {

/// {"rows": [...], "scenes": [...]}; all rows have the same members, what was not measured is null.
[[nodiscard]] nlohmann::ordered_json facts_of(const std::vector<SceneModel>& scenes);
/// Payloads over bytes and over time; leaves over both; directions over time; pages.
/// @param scene  with rows
[[nodiscard]] Chart chart_of(const SceneModel& scene);
/// Writes model.json, .csv and, for each scene, model-SCENE.svg and .png into a directory. @throws
/// std::system_error
void write_reports(const std::filesystem::path& directory, const std::vector<SceneModel>& scenes);
/// A table of all rows.
[[nodiscard]] std::string model_text(const std::vector<SceneModel>& scenes);

}  // namespace ptc::bench
