// What an accuracy run found: JSON, CSV, words, charts.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/experiments/accuracy.h"

namespace ptc::bench {

/// {"rows": [...], "references": [...]}; all rows have the same members, what was not measured is
/// null.
[[nodiscard]] nlohmann::ordered_json facts_of(const std::vector<SceneAccuracy>& scenes);

/// Writes accuracy.json, accuracy.csv and, for each scene, accuracy-SCENE.svg and .png into a
/// directory, and accuracy.svg and .png of all scenes.
/// @param scenes  one or more, of different names
/// @throws std::system_error
void write_reports(const std::filesystem::path& directory,
                   const std::vector<SceneAccuracy>& scenes);

/// A table of all rows: time, errors, and how much longer Embree takes; and what the errors are
/// against.
[[nodiscard]] std::string accuracy_text(const std::vector<SceneAccuracy>& scenes);

}  // namespace ptc::bench
