#include "tools/bench/experiments/error_report.h"

#include <limits>

#include <fmt/format.h>

#include "tools/bench/report/report_files.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

double mesh_error(const ErrorRow& row) {
  return row.check.mesh ? row.check.mesh->relative() : std::numeric_limits<double>::quiet_NaN();
}

Json facts_of(const ErrorRow& row) {
  const GatherOptions& g = row.tuning.gather;
  return {{"scene", row.scene},
          {"set", row.set},
          {"asked", row.asked},
          {"met", row.tuning.met},
          {"measured", number(row.measured())},
          {"measured_mesh", number(mesh_error(row))},
          {"at_pilots", number(row.tuning.measured.relative())},
          {"checked", row.check.receivers},
          {"check_rays", row.check.rays},
          {"setting", row.tuning.setting},
          {"solid_angle", g.solid_angle},
          {"parallax", g.parallax},
          {"resolution", g.resolution},
          {"receivers", row.receivers},
          {"us_per_receiver", number(row.us_per_receiver)},
          {"pilots", row.tuning.pilots},
          {"pilot_rays", row.tuning.rays},
          {"pilot_share", number(row.pilot_share)}};
}

Json facts_of(const std::string& scene, std::size_t rung, const RungError& e) {
  return {{"scene", scene},
          {"setting", rung},
          {"solid_angle", ladder()[rung].solid_angle},
          {"parallax", ladder()[rung].parallax},
          {"resolution", ladder()[rung].resolution},
          {"us_per_receiver", number(e.us_per_receiver)},
          {"occlusion",
           number(e.error.occlusion_mean > 0 ? e.error.occlusion_rms / e.error.occlusion_mean : 0)},
          {"irradiance", number(e.error.irradiance_rms)},
          {"error", number(e.error.relative())}};
}

}  // namespace

nlohmann::ordered_json facts_of(const std::vector<SceneErrors>& scenes) {
  Json rows = Json::array(), rungs = Json::array(), slopes = Json::object();
  for (const SceneErrors& scene : scenes) {
    for (const ErrorRow& row : scene.rows) rows.push_back(facts_of(row));
    for (std::size_t i = 0; i < scene.rungs.size(); ++i)
      rungs.push_back(facts_of(scene.name, i, scene.rungs[i]));
    slopes[scene.name] = number(scene.slope());
  }
  return {{"rows", rows}, {"ladder", rungs}, {"slopes", slopes}};
}

Chart chart_of(const std::vector<SceneErrors>& scenes) {
  ChartPanel asked{.title = "Measured and asked", .x_label = "asked, %", .y_label = "measured, %"};
  ChartPanel ladder_panel{.title = "The settings, points of the scene",
                          .x_label = "CPU time per receiver, \u00b5s",
                          .y_label = "RMS error, % of the mean"};
  ChartSeries limit{.name = "asked", .dashed = true};
  Chart chart{.title = "The error that was asked for", .columns = 2};
  chart.note =
      "Errors: the larger of occlusion and irradiance, RMS over the mean, against rays at the same "
      "surfels at "
      "receivers that had no part in choosing the setting.\n";
  for (const SceneErrors& scene : scenes) {
    for (const char* set : {"points", "camera"}) {
      ChartSeries series{.name = scene.name + ", " + set};
      for (const ErrorRow& row : scene.rows) {
        if (row.set != set) continue;
        series.points.push_back({.x = 100 * row.asked, .y = 100 * row.measured()});
        if (&scene == &scenes.front() && row.set == "points")
          limit.points.push_back({.x = 100 * row.asked, .y = 100 * row.asked});
      }
      asked.series.push_back(std::move(series));
    }
    ChartSeries rungs{.name = scene.name + ", points"};
    for (const RungError& rung : scene.rungs) {
      rungs.points.push_back({.x = rung.us_per_receiver, .y = 100 * rung.error.relative()});
    }
    ladder_panel.series.push_back(std::move(rungs));
    chart.note += fmt::format("{}: {} surfels; error falls as time to the power {:.2f}.\n",
                              scene.name, scene.surfels, scene.slope());
  }
  asked.series.push_back(std::move(limit));
  chart.panels = {asked, ladder_panel};
  return chart;
}

void write_reports(const std::filesystem::path& directory, const std::vector<SceneErrors>& scenes) {
  const Json facts = facts_of(scenes);
  write_tables(directory / "error", facts);
  write_tables(directory / "ladder", {{"rows", facts.at("ladder")}});
  write_figures(directory / "error", chart_of(scenes));
}

std::string error_text(const std::vector<SceneErrors>& scenes) {
  std::string text =
      fmt::format("{:<10} {:<7} {:>8} {:>10} {:>8} {:>8}  {:<28} {:>8} {:>9}\n", "scene", "set",
                  "asked %", "measured %", "pilots %", "mesh %", "setting", "us", "pilots'");
  for (const SceneErrors& scene : scenes) {
    for (const ErrorRow& row : scene.rows) {
      const GatherOptions& g = row.tuning.gather;
      const std::string mesh = row.check.mesh ? fmt::format("{:.2f}", 100 * mesh_error(row)) : "-";
      text += fmt::format(
          "{:<10} {:<7} {:>8.4g} {:>10.2f} {:>8.2f} {:>8}  {:<28} {:>8.1f} {:>7.1f} %\n", row.scene,
          row.set, 100 * row.asked, 100 * row.measured(), 100 * row.tuning.measured.relative(),
          mesh,
          fmt::format("{} sr, {} rad, R {}{}", g.solid_angle, g.parallax, g.resolution,
                      row.tuning.met ? "" : " (floor)"),
          row.us_per_receiver, 100 * row.pilot_share);
    }
  }
  for (const SceneErrors& scene : scenes) {
    text += fmt::format("\n{}, points: error falls as time to the power {:.2f}\n", scene.name,
                        scene.slope());
    for (std::size_t i = 0; i < scene.rungs.size(); ++i) {
      const Rung& rung = ladder()[i];
      text += fmt::format(
          "  {:<28} {:>8.1f} us {:>7.2f} %\n",
          fmt::format("{} sr, {} rad, R {}", rung.solid_angle, rung.parallax, rung.resolution),
          scene.rungs[i].us_per_receiver, 100 * scene.rungs[i].error.relative());
    }
  }
  return text;
}

}  // namespace ptc::bench
