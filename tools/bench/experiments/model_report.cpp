#include "tools/bench/experiments/model_report.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string_view>

#include <fmt/format.h>

#include "tools/bench/report/report_files.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;
using Value = std::function<double(const ModelRow&)>;
using Label = std::function<std::string(const ModelRow&)>;
using Choice = std::function<bool(const ModelRow&)>;

constexpr char kTime[] = "CPU time per receiver, \u00b5s";
constexpr char kError[] = "RMS error, % of the mean";
constexpr char kReading[] =
    "Payloads: plain gather of one receiver at a time, the same cut through the same tree, so that "
    "only what a node tells of its "
    "surfels differs; against all surfels in the same pixels. Left marker: as stored; right: as "
    "floats. Whole node: all columns, "
    "bounds too. Dashed: the sum over the node's own surfels, none in front of another, which "
    "payloads approximate. Clusters are "
    "drawn as by PTCX. Over time: solid angles from coarse to fine. Leaves and directions: PTCX "
    "at its default setting, against rays. Rounded points lie at most 0.001 of their radius from "
    "where they were.\n";

double occlusion(const ModelRow& row) {
  return 100 * row.occlusion.rms;
}
double irradiance(const ModelRow& row) {
  return 100 * row.irradiance.rms;
}
double bytes(const ModelRow& row) {
  return row.bytes;
}
double time(const ModelRow& row) {
  return row.us.median;
}
std::string variant(const ModelRow& row) {
  return row.variant;
}

/// Points of the rows chosen that have both values.
void add_series(ChartPanel& panel, const SceneModel& scene, const std::string& name,
                const Choice& chosen, const Value& x, const Value& y, const Label& label) {
  ChartSeries series{.name = name};
  for (const ModelRow& row : scene.rows) {
    if (!chosen(row) || !std::isfinite(x(row)) || !std::isfinite(y(row))) continue;
    series.points.push_back({.x = x(row), .y = y(row), .label = label(row)});
  }
  if (!series.points.empty()) panel.series.push_back(std::move(series));
}

/// The middle one of the solid angles of payloads.
double middle_angle(const SceneModel& scene) {
  std::vector<double> angles;
  for (const ModelRow& row : scene.rows) {
    if (row.axis == "payload" && std::ranges::find(angles, row.solid_angle) == angles.end())
      angles.push_back(row.solid_angle);
  }
  return angles.empty() ? ModelRow::kNone : angles[angles.size() / 2];
}

/// What series of payloads are called, in the order of rows.
std::vector<std::string> payload_names(const SceneModel& scene) {
  std::vector<std::string> names;
  for (const ModelRow& row : scene.rows) {
    if (row.axis == "payload" && row.variant != "exact" &&
        std::ranges::find(names, row.variant) == names.end()) {
      names.push_back(row.variant);
    }
  }
  return names;
}

ChartPanel payloads_over_bytes(const SceneModel& scene, const char* what, const Value& error) {
  const double angle = middle_angle(scene);
  const std::string title = fmt::format("Payload at {:.2g} sr: {}", angle, what);
  ChartPanel panel{.title = title, .x_label = "bytes of a node", .y_label = kError};
  for (const std::string& name : payload_names(scene)) {
    const auto chosen = [&](const ModelRow& r) {
      return r.axis == "payload" && r.variant == name && r.solid_angle == angle;
    };
    add_series(panel, scene, name, chosen, bytes, error,
               [](const ModelRow& r) { return r.form == "stored" ? r.variant : ""; });
  }
  const auto whole = [&](const ModelRow& r) { return r.axis == "node" && r.solid_angle == angle; };
  add_series(panel, scene, "whole node", whole, bytes, error, [](const ModelRow&) { return ""; });
  for (const ModelRow& row : scene.rows) {
    const bool exact = row.variant == "exact" && row.solid_angle == angle && error(row) > 0;
    if (exact) panel.limits.push_back({error(row), "sum over the surfels"});
  }
  return panel;
}

ChartPanel payloads_over_time(const SceneModel& scene, const char* what, const Value& error) {
  ChartPanel panel{.title = fmt::format("Payload: {}", what), .x_label = kTime, .y_label = kError};
  for (const std::string& name : payload_names(scene)) {
    const auto chosen = [&](const ModelRow& r) {
      return r.axis == "payload" && r.variant == name && r.form == "stored";
    };
    add_series(panel, scene, name, chosen, time, error, [](const ModelRow& r) {
      return r.variant == "cube" ? fmt::format("{:.2g} sr", r.solid_angle) : std::string();
    });
  }
  return panel;
}

ChartPanel gathers_over(const SceneModel& scene, const char* axis, const char* title,
                        const char* x_label, const Value& x) {
  ChartPanel panel{.title = title, .x_label = x_label, .y_label = kError};
  const auto chosen = [&](const ModelRow& r) { return r.axis == axis; };
  add_series(panel, scene, "irradiance", chosen, x, irradiance, variant);
  add_series(panel, scene, "occlusion", chosen, x, occlusion, variant);
  return panel;
}

ChartPanel pages(const SceneModel& scene) {
  ChartPanel panel{.title = "Pages",
                   .x_label = "bytes of a point or node",
                   .y_label = "CPU time to decode it, ns"};
  for (const char* form : {"points", "packed", "rounded", "nodes"}) {
    const auto chosen = [&](const ModelRow& r) { return r.axis == "pages" && r.form == form; };
    add_series(
        panel, scene, form, chosen, bytes, [](const ModelRow& r) { return r.decode_ns; }, variant);
  }
  return panel;
}

Json row_facts(const ModelRow& row) {
  return {{"scene", row.scene},
          {"axis", row.axis},
          {"variant", row.variant},
          {"form", row.form},
          {"solid_angle", number(row.solid_angle)},
          {"bytes", number(row.bytes)},
          {"per", row.per},
          {"us_per_receiver", number(row.us.median)},
          {"us_low", number(row.us.low)},
          {"us_high", number(row.us.high)},
          {"evaluate_us", number(row.evaluate_us)},
          {"decode_ns", number(row.decode_ns)},
          {"moved_radii", number(row.moved)},
          {"ao_rms", number(row.occlusion.rms)},
          {"ao_bias", number(row.occlusion.bias)},
          {"ao_p99", number(row.occlusion.percentile_99)},
          {"e_rms", number(row.irradiance.rms)},
          {"e_bias", number(row.irradiance.bias)},
          {"e_p99", number(row.irradiance.percentile_99)}};
}

std::string note_text(const SceneModel& scene) {
  return fmt::format(
      "{}: {} surfels, {} nodes; {} pixels of the camera; {} rays each are off by {:.2g} % of the "
      "mean "
      "occlusion and {:.2g} % of the mean irradiance.\n",
      scene.scene, scene.surfels, scene.nodes, scene.receivers, scene.rays,
      100 * scene.occlusion_noise, 100 * scene.irradiance_noise);
}

}  // namespace

Json facts_of(const std::vector<SceneModel>& scenes) {
  Json rows = Json::array(), notes = Json::array();
  for (const SceneModel& scene : scenes) {
    for (const ModelRow& row : scene.rows) rows.push_back(row_facts(row));
    notes.push_back({{"scene", scene.scene},
                     {"surfels", scene.surfels},
                     {"nodes", scene.nodes},
                     {"receivers", scene.receivers},
                     {"rays", scene.rays},
                     {"ao_noise", number(scene.occlusion_noise)},
                     {"e_noise", number(scene.irradiance_noise)}});
  }
  return {{"rows", rows}, {"scenes", notes}};
}

Chart chart_of(const SceneModel& scene) {
  Chart chart{.title = "What the model costs and is worth: " + scene.scene,
              .note = kReading + note_text(scene),
              .columns = 4};
  chart.panels = {
      payloads_over_bytes(scene, "irradiance", irradiance),
      payloads_over_bytes(scene, "occlusion", occlusion),
      payloads_over_time(scene, "irradiance", irradiance),
      payloads_over_time(scene, "occlusion", occlusion),
      gathers_over(scene, "leaf", "Points of a leaf", "bytes of a point, with its nodes", bytes),
      gathers_over(scene, "leaf", "Points of a leaf", kTime, time),
      gathers_over(scene, "directions", "Directions: pixels along a cube edge", kTime, time),
      pages(scene)};
  std::erase_if(chart.panels, [](const ChartPanel& panel) { return panel.series.empty(); });
  return chart;
}

void write_reports(const std::filesystem::path& directory, const std::vector<SceneModel>& scenes) {
  write_tables(directory / "model", facts_of(scenes));
  for (const SceneModel& scene : scenes)
    write_figures(directory / ("model-" + scene.scene), chart_of(scene));
}

std::string model_text(const std::vector<SceneModel>& scenes) {
  static constexpr char kHead[] = "{:<10} {:<11} {:<11} {:<7} {:>6} {:>9} {:<6}";
  static constexpr char kTail[] = " {:>9} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7}\n";
  std::string text = fmt::format(kHead, "scene", "axis", "variant", "form", "sr", "bytes", "of a") +
                     fmt::format(kTail, "us", "to see", "ns", "AO %", "E %", "bias %", "p99 %");
  for (const SceneModel& scene : scenes) {
    for (const ModelRow& row : scene.rows) {
      text +=
          fmt::format(kHead, row.scene, row.axis, row.variant, row.form,
                      or_dash(row.solid_angle, "{:.2g}"), or_dash(row.bytes, "{:.1f}"), row.per);
      text += fmt::format(kTail, or_dash(row.us.median, "{:.1f}"),
                          or_dash(row.evaluate_us, "{:.1f}"), or_dash(row.decode_ns, "{:.1f}"),
                          or_dash(occlusion(row), "{:.2f}"), or_dash(irradiance(row), "{:.2f}"),
                          or_dash(100 * row.irradiance.bias, "{:+.2f}"),
                          or_dash(100 * row.irradiance.percentile_99, "{:.1f}"));
    }
    text += note_text(scene);
  }
  return text;
}

}  // namespace ptc::bench
