#include "tools/bench/experiments/accuracy_chart.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <span>

#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"

namespace ptc::bench {
namespace {

/// What a panel shows over time.
struct Measure {
  const char* title;
  const char* label;
  Quantity job;
  std::function<double(const AccuracyRow&)> value;
  std::function<double(const ReferenceNote&)>
      noise;  ///< noise of the reference; empty where it is not known
};

const std::array<Measure, 4>& measures() {
  static const std::array<Measure, 4> all{
      {{"occlusion", "RMS error, % of the mean", Quantity::occlusion,
        [](const AccuracyRow& r) { return 100 * r.occlusion.rms; },
        [](const ReferenceNote& n) { return 100 * n.occlusion_noise; }},
       {"irradiance", "RMS error, % of the mean", Quantity::bleeding,
        [](const AccuracyRow& r) { return 100 * r.irradiance.rms; },
        [](const ReferenceNote& n) { return 100 * n.irradiance_noise; }},
       {"irradiance, 99th percentile",
        "99th percentile of error, % of the mean",
        Quantity::bleeding,
        [](const AccuracyRow& r) { return 100 * r.irradiance.percentile_99; },
        {}},
       {"visible difference of the picture",
        "mean FLIP, 0 to 1",
        Quantity::bleeding,
        [](const AccuracyRow& r) { return r.flip; },
        {}}}};
  return all;
}

/// The name of a method in legends.
const char* legend_name(std::string_view method) {
  if (method == "ptcx") return "PTCX";
  if (method == "ptcx-rays") return "PTCX, rays";
  if (method == "plain") return "plain gather";
  return method == "embree-discs" ? "Embree, same discs" : "Embree, mesh";
}

/// The panels of one set. A quantity that was not measured has no panel.
std::vector<ChartPanel> panels_of(const SceneAccuracy& scene, const ReferenceNote& note,
                                  const std::string& title, std::span<const Measure> shown) {
  std::vector<ChartPanel> panels;
  for (const Measure& measure : shown) {
    // Draw one curve for each method
    ChartPanel panel{
        .title = title + measure.title, .x_label = kTimePerReceiver, .y_label = measure.label};
    for (const char* method : kMethods) {
      ChartSeries series{.name = legend_name(method)};
      for (const AccuracyRow& row : scene.rows) {
        if (row.set != note.set || row.method != method || row.job != measure.job) continue;
        const double error = measure.value(row);
        if (!std::isfinite(error)) continue;
        const Spread& us = row.us_per_receiver;
        series.points.push_back({.x = us.median,
                                 .y = error,
                                 .x_low = us.low,
                                 .x_high = us.high,
                                 .label = row.setting.substr(0, row.setting.find(' '))});
      }
      if (!series.points.empty()) panel.series.push_back(std::move(series));
    }
    // Add the noise of the reference, below which errors say nothing
    if (panel.series.empty()) continue;
    if (measure.noise) panel.limits.push_back({measure.noise(note), "noise of the reference"});
    panels.push_back(std::move(panel));
  }
  return panels;
}

void append(Chart& chart, const std::vector<ChartPanel>& panels) {
  chart.panels.insert(chart.panels.end(), panels.begin(), panels.end());
}

/// A share as a percentage.
std::string percent_text(double share) {
  return std::isfinite(share) ? fmt::format("{:.2g} %", 100 * share)
                              : std::string("an unknown share");
}

constexpr char kAccuracyChartReading[] =
    "Markers are medians of all runs, bars reach from the fastest to the slowest run. Labels: "
    "solid "
    "angle in sr for PTCX and the plain gather, rays per receiver for rays.\n";

}  // namespace

std::string note_text(const ReferenceNote& note, const SceneAccuracy& scene) {
  std::string text = fmt::format(
      "{}, {}: {} surfels; errors at {} receivers against {} rays each at the same model, whose "
      "own "
      "error is {} of the mean occlusion",
      note.scene, note.set, scene.surfels, note.receivers, note.rays,
      percent_text(note.occlusion_noise));
  const bool light = note.irradiance_mean > 0;
  if (light)
    text += fmt::format(" and {} of the mean irradiance", percent_text(note.irradiance_noise));
  text += ".";
  if (!std::isfinite(note.occlusion_floor)) return text;
  text += fmt::format(" Rays at the discs and at the mesh differ by {}",
                      percent_text(note.occlusion_floor));
  if (light) text += " and " + percent_text(note.irradiance_floor);
  return text + ".";
}

Chart chart_of(const SceneAccuracy& scene) {
  Chart chart{.title = "Time per receiver against error: " + scene.name(),
              .note = kAccuracyChartReading,
              .columns = 1};
  for (const ReferenceNote& note : scene.references) {
    std::string title = note.set + ": ";
    title.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(title.front())));
    const std::vector<ChartPanel> panels = panels_of(scene, note, title, measures());
    chart.columns = std::max(chart.columns, static_cast<unsigned>(panels.size()));
    append(chart, panels);
    chart.note += note_text(note, scene) + "\n";
  }
  return chart;
}

Chart chart_of(const std::vector<SceneAccuracy>& scenes) {
  Chart chart{
      .title = "Time per receiver against error", .note = kAccuracyChartReading, .columns = 1};
  for (const SceneAccuracy& scene : scenes) {
    const std::size_t before = chart.panels.size();
    for (const ReferenceNote& note : scene.references) {
      const std::string title = fmt::format("{}, {}: ", note.scene, note.set);
      append(chart, panels_of(scene, note, title, std::span(measures()).first(2)));
      chart.note += note_text(note, scene) + "\n";
    }
    chart.columns = std::max(chart.columns, static_cast<unsigned>(chart.panels.size() - before));
  }
  return chart;
}

}  // namespace ptc::bench
