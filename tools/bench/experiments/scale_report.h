// What a scale bench measured, as tables, text and a chart; and the law by which it grows.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/scale_bench.h"

namespace ptc::bench {

/// y = factor x^exponent.
struct PowerLaw {
  double factor = 0, exponent = 0;
  [[nodiscard]] double at(double x) const;
};

/// Least squares of log y against log x; NaN where all x are equal.
/// @param points  x and y, above 0
[[nodiscard]] PowerLaw fit_power_law(const std::vector<std::pair<double, double>>& points);

/// How a stage grows with the points of the city. NaN: not enough sizes.
struct ScaleLaw {
  std::string stage;
  double time_exponent = 0;      ///< of wall seconds of the whole stage, over all sizes
  double resident_exponent = 0;  ///< of most resident, likewise
  double predicted_seconds = 0;  ///< wall, of kPredictedPoints; NaN when as many were measured
  /// Of the greatest size over that of the least of kLargePoints or more: wall time of a point (of
  /// "shade", a receiver), and most resident.
  double time_ratio = 0, resident_ratio = 0;
};

inline constexpr std::uint64_t kLargePoints = 20'000'000, kPredictedPoints = 1'700'000'000;

/// One for each of build, verify and shade. @param rows  of one or more sizes, ascending
[[nodiscard]] std::vector<ScaleLaw> laws_of(const std::vector<ScaleRow>& rows);

/// {"rows": [...], "laws": [...]}: a ScaleRow each, with `floor_share`, the floor's wall time over
/// that of the stage; a ScaleLaw each. Rows have the same members, null where a stage has none.
[[nodiscard]] nlohmann::ordered_json facts_of(const std::vector<ScaleRow>& rows);
[[nodiscard]] std::string scale_text(const std::vector<ScaleRow>& rows);
[[nodiscard]] Chart chart_of(const std::vector<ScaleRow>& rows);
/// scale.json, .csv (its rows), .svg and .png. @throws std::system_error
void write_reports(const std::filesystem::path& directory, const std::vector<ScaleRow>& rows);

}  // namespace ptc::bench
