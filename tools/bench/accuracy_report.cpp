#include "tools/bench/accuracy_report.h"

#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "engine/io/file.h"
#include "engine/measure/chart.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json facts_of(const AccuracyRow& row) {
  Json facts{{"scene", row.scene},
             {"set", row.set},
             {"job", name_of(row.job)},
             {"method", row.method},
             {"setting", row.setting},
             {"receivers", row.receivers},
             {"us_per_receiver", number(row.us_per_receiver.median)},
             {"us_low", number(row.us_per_receiver.low)},
             {"us_high", number(row.us_per_receiver.high)},
             {"ao_rms", number(row.occlusion.rms)},
             {"e_rms", number(row.irradiance.rms)},
             {"bias", number(row.error().bias)},
             {"p99", number(row.error().percentile_99)},
             {"flip", number(row.flip)},
             {"ao_rms_mesh", number(row.occlusion_rms_mesh)},
             {"e_rms_mesh", number(row.irradiance_rms_mesh)},
             {"speedup_discs", number(row.speedup_discs)},
             {"speedup_mesh", number(row.speedup_mesh)}};
  if (row.counts.receivers == 0) return facts;
  const auto each = [](std::uint64_t count) { return static_cast<double>(count) / 1000; };
  facts["groups"] = each(row.counts.groups);
  facts["surfel_blocks"] = each(row.counts.surfel_blocks);
  facts["clusters"] = each(row.counts.clusters);
  facts["surfels"] = each(row.counts.surfels);
  facts["retests"] = each(row.counts.retests);
  return facts;
}

Json facts_of(const ReferenceNote& note, const SceneAccuracy& scene) {
  return {{"scene", note.scene},
          {"set", note.set},
          {"surfels", scene.surfels},
          {"triangles", scene.triangles},
          {"receivers", note.receivers},
          {"rays", note.rays},
          {"ao_mean", number(note.occlusion_mean)},
          {"e_mean", number(note.irradiance_mean)},
          {"ao_noise", number(note.occlusion_noise)},
          {"e_noise", number(note.irradiance_noise)},
          {"ao_floor", number(note.occlusion_floor)},
          {"e_floor", number(note.irradiance_floor)}};
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  OutputFile file(path);
  file.append(std::as_bytes(std::span(text)));
  file.publish();
}

/// The rows' members as columns.
std::string csv_of(const Json& rows) {
  std::string text;
  if (rows.empty()) return text;
  const auto line = [&](const Json& row, bool header) {
    std::string cells;
    for (const auto& [key, first] : rows.front().items()) {
      const Json& value = header ? Json(key) : row.contains(key) ? row.at(key) : Json(nullptr);
      if (!cells.empty()) cells += ',';
      if (!value.is_null()) cells += value.dump();
    }
    return cells + "\n";
  };
  text += line(rows.front(), true);
  for (const Json& row : rows) text += line(row, false);
  return text;
}

/// What a panel shows over time.
struct Measure {
  const char* title;
  const char* label;
  Quantity job;
  bool log_scale;
  std::function<double(const AccuracyRow&)> value;
};

constexpr unsigned kMeasures = 5;

const std::array<Measure, kMeasures>& measures() {
  static const std::array<Measure, kMeasures> all{
      {{"occlusion", "RMS error, % of the mean", Quantity::occlusion, true, [](const AccuracyRow& r) { return 100 * r.occlusion.rms; }},
       {"irradiance", "RMS error, % of the mean", Quantity::bleeding, true, [](const AccuracyRow& r) { return 100 * r.irradiance.rms; }},
       {"irradiance, bias", "mean error, % of the mean", Quantity::bleeding, false, [](const AccuracyRow& r) { return 100 * r.irradiance.bias; }},
       {"irradiance, worst", "99th percentile, % of the mean", Quantity::bleeding, true, [](const AccuracyRow& r) { return 100 * r.irradiance.percentile_99; }},
       {"picture", "mean FLIP", Quantity::bleeding, true, [](const AccuracyRow& r) { return r.flip; }}}};
  return all;
}

ChartPanel panel_of(const std::vector<AccuracyRow>& rows, const std::string& scene, const std::string& set, const Measure& measure) {
  ChartPanel panel{.title = fmt::format("{}, {}: {}", scene, set, measure.title),
                   .x_label = "CPU time, us a receiver",
                   .y_label = measure.label,
                   .log_x = true,
                   .log_y = measure.log_scale};
  for (const char* method : {"ptcx", "plain", "embree-discs", "embree-mesh"}) {
    ChartSeries series{.name = method};
    for (const AccuracyRow& row : rows) {
      if (row.scene != scene || row.set != set || row.method != method || row.job != measure.job) continue;
      const Spread& us = row.us_per_receiver;
      series.points.push_back({.x = us.median, .y = measure.value(row), .x_low = us.low, .x_high = us.high});
    }
    if (!series.points.empty()) panel.series.push_back(std::move(series));
  }
  return panel;
}

std::string note_of(const SceneAccuracy& scene) {
  std::string text;
  for (const ReferenceNote& note : scene.references) {
    text += fmt::format("{}, {}: {} surfels, {} receivers checked with {} rays each, whose own error is {:.2f} % of occlusion, "
                        "{:.2f} % of irradiance", note.scene, note.set, scene.surfels, note.receivers, note.rays,
                        100 * note.occlusion_noise, 100 * note.irradiance_noise);
    if (std::isfinite(note.occlusion_floor)) {
      text += fmt::format("; discs differ from the mesh by {:.1f} % and {:.1f} %", 100 * note.occlusion_floor, 100 * note.irradiance_floor);
    }
    text += ". ";
  }
  return text;
}

void write_both(const std::filesystem::path& directory, const std::string& name, const Chart& chart) {
  write_chart(directory / (name + ".svg"), chart);
  write_chart(directory / (name + ".png"), chart);
}

}  // namespace

nlohmann::ordered_json facts_of(const std::vector<SceneAccuracy>& scenes) {
  Json rows = Json::array(), references = Json::array();
  for (const SceneAccuracy& scene : scenes) {
    for (const AccuracyRow& row : scene.rows) rows.push_back(facts_of(row));
    for (const ReferenceNote& note : scene.references) references.push_back(facts_of(note, scene));
  }
  return {{"rows", rows}, {"references", references}};
}

void write_reports(const std::filesystem::path& directory, const std::vector<SceneAccuracy>& scenes) {
  const Json facts = facts_of(scenes);
  write_text(directory / "accuracy.json", facts.dump(2) + "\n");
  write_text(directory / "accuracy.csv", csv_of(facts.at("rows")));
  Chart all{.title = "Time against error", .note = "Each error is against rays at the same model. ", .columns = 4};
  for (const SceneAccuracy& scene : scenes) {
    if (scene.references.empty()) continue;
    const std::string& name = scene.references.front().scene;
    Chart chart{.title = "Time against error: " + name, .note = note_of(scene), .columns = kMeasures};
    for (const ReferenceNote& note : scene.references) {
      for (const Measure& measure : measures()) {
        if (note.set != "camera" && std::string_view(measure.label) == "mean FLIP") continue;
        chart.panels.push_back(panel_of(scene.rows, name, note.set, measure));
      }
      for (const Measure& measure : {measures()[0], measures()[1]}) {
        all.panels.push_back(panel_of(scene.rows, name, note.set, measure));
      }
    }
    all.note += note_of(scene);
    write_both(directory, "accuracy-" + name, chart);
  }
  write_both(directory, "accuracy", all);
}

std::string accuracy_text(const std::vector<SceneAccuracy>& scenes) {
  const auto or_dash = [](double value, const char* suffix) {
    return std::isfinite(value) ? fmt::format("{:.1f}{}", value, suffix) : std::string("-");
  };
  std::string text = fmt::format("{:<10} {:<7} {:<10} {:<28} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n", "scene", "set", "job",
                                 "setting", "us", "RMS %", "bias %", "p99 %", "FLIP", "x discs", "x mesh");
  for (const SceneAccuracy& scene : scenes) {
    for (const AccuracyRow& row : scene.rows) {
      const ErrorStatistics& e = row.error();
      text += fmt::format("{:<10} {:<7} {:<10} {:<28} {:>9.1f} {:>8.2f} {:>+8.2f} {:>8.1f} {:>8} {:>8} {:>8}\n", row.scene, row.set,
                          name_of(row.job), row.method == "ptcx" ? row.setting : row.method + ", " + row.setting,
                          row.us_per_receiver.median, 100 * e.rms, 100 * e.bias, 100 * e.percentile_99,
                          std::isfinite(row.flip) ? fmt::format("{:.4f}", row.flip) : "-", or_dash(row.speedup_discs, "x"),
                          or_dash(row.speedup_mesh, "x"));
    }
    text += "  " + note_of(scene) + "\n";
  }
  return text;
}

}  // namespace ptc::bench
