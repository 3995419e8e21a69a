#include <string>

#include <fmt/format.h>

#include "tools/bench/experiments/error_knob.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/values.h"

namespace ptc::bench {
namespace {

constexpr char kReading[] =
    "What was asked of --error, and what came of it. Errors are the larger of occlusion and "
    "irradiance, RMS over the mean, against rays at the same surfels at receivers that had no "
    "part in choosing the setting; against the mesh they have the surfels' own error in them. "
    "Where what was asked was not met, the finest setting was taken. Pilots: receivers of the "
    "same run that chose the setting; their share is of the CPU time of the whole run. The "
    "ladder has every setting that --error chooses from.";

std::string setting_text(float solid_angle, float parallax, unsigned resolution) {
  return fmt::format("{} sr, {} rad, R {}", solid_angle, parallax, resolution);
}

const Columns<ErrorRow>& columns() {
  using R = ErrorRow;
  const auto gather = [](auto member) {
    return [member](const R& r) { return r.tuning.gather.*member; };
  };
  const auto tuning = [](auto member) { return [member](const R& r) { return r.tuning.*member; }; };
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"set", {"receivers"}, &R::set},
      {"asked", percent("asked %", "{:.4g}"), &R::asked},
      {"met", {"met"}, tuning(&TuningReport::met)},
      {"measured", percent("measured %"), &R::measured},
      {"measured_mesh", percent("to the mesh %"),
       [](const R& r) { return r.check.mesh ? r.check.mesh->relative() : kNone; }},
      {"at_pilots", percent("at pilots %"),
       [](const R& r) { return r.tuning.measured.relative(); }},
      {"checked", {"checked"}, [](const R& r) { return r.check.receivers; }},
      {"check_rays", {"rays each"}, [](const R& r) { return r.check.rays; }},
      {"setting", {}, tuning(&TuningReport::setting)},
      {"gather",
       {"setting"},
       [](const R& r) {
         const GatherOptions& g = r.tuning.gather;
         return setting_text(g.solid_angle, g.parallax, g.resolution);
       }},
      {"solid_angle", {}, gather(&GatherOptions::solid_angle)},
      {"parallax", {}, gather(&GatherOptions::parallax)},
      {"resolution", {}, gather(&GatherOptions::resolution)},
      {"receivers", {"shaded"}, &R::receivers},
      {"us_per_receiver", {"CPU us each", "{:.1f}"}, &R::us_per_receiver},
      {"wall_us_per_receiver", {"wall us each", "{:.1f}"}, &R::wall_us_per_receiver},
      {"pilots", {"pilots"}, tuning(&TuningReport::pilots)},
      {"pilot_rays", {}, tuning(&TuningReport::rays)},
      {"pilot_share", percent("pilots' share %", "{:.1f}"), &R::pilot_share}};
  return columns;
}

/// One setting of the ladder at one scene.
struct RungRow {
  std::string scene;
  std::size_t setting;
  RungError measured;
};

const Columns<RungRow>& rung_columns() {
  using R = RungRow;
  const auto rung = [](auto member) {
    return [member](const R& r) { return ladder()[r.setting].*member; };
  };
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"setting", {"number"}, &R::setting},
      {"gather",
       {"setting"},
       [](const R& r) {
         const Rung& g = ladder()[r.setting];
         return setting_text(g.solid_angle, g.parallax, g.resolution);
       }},
      {"solid_angle", {}, rung(&Rung::solid_angle)},
      {"parallax", {}, rung(&Rung::parallax)},
      {"resolution", {}, rung(&Rung::resolution)},
      {"us_per_receiver",
       {"CPU us each", "{:.1f}"},
       [](const R& r) { return r.measured.us_per_receiver; }},
      {"occlusion", percent("occlusion %"),
       [](const R& r) {
         const CheckError& e = r.measured.error;
         return e.occlusion_mean > 0 ? e.occlusion_rms / e.occlusion_mean : 0.0;
       }},
      {"irradiance", percent("irradiance %"),
       [](const R& r) { return r.measured.error.irradiance_rms; }},
      {"error", percent("error %"), [](const R& r) { return r.measured.error.relative(); }}};
  return columns;
}

const Columns<SceneErrors>& slope_columns() {
  using R = SceneErrors;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::name},
      {"surfels", {"surfels"}, &R::surfels},
      {"slope", {"error falls as time to the power", "{:.2f}"}, &R::slope}};
  return columns;
}

Chart chart_of(const std::vector<SceneErrors>& scenes) {
  ChartPanel asked{.title = "Measured and asked", .x_label = "asked, %", .y_label = "measured, %"};
  ChartPanel ladder_panel{.title = "The settings, points of the scene",
                          .x_label = "CPU time per receiver, \u00b5s",
                          .y_label = "RMS error, % of the mean"};
  ChartSeries limit{.name = "asked", .dashed = true};
  Chart chart{.title = "The error that was asked for", .columns = 2};
  chart.note = std::string(kReading) + "\n";
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

}  // namespace

Report report_of(const std::vector<SceneErrors>& scenes, unsigned runs) {
  std::vector<ErrorRow> rows;
  std::vector<RungRow> rungs;
  for (const SceneErrors& scene : scenes) {
    rows.insert(rows.end(), scene.rows.begin(), scene.rows.end());
    for (std::size_t i = 0; i < scene.rungs.size(); ++i)
      rungs.push_back({scene.name, i, scene.rungs[i]});
  }
  return {.name = "error",
          .title = "The error that was asked for",
          .reading = kReading,
          .runs = runs,
          .tables = {tabulate<ErrorRow>({.name = "rows"}, columns(), rows),
                     tabulate<RungRow>({.name = "ladder", .title = "The ladder", .group = "scene"},
                                       rung_columns(), rungs),
                     tabulate<SceneErrors>({.name = "slopes", .title = "Slopes of the ladder"},
                                           slope_columns(), scenes)},
          .figures = {{.chart = chart_of(scenes)}}};
}

Experiment make_error_experiment() {
  const auto options = std::make_shared<ErrorOptions>();
  const auto scenes = std::make_shared<SceneList>();
  options->scene.points = 500'000;
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->scene.points, "500k", 50'000);
    d.checked(options->checked, 400);
    add_integer(d.command(), "--check-rays", options->rays, 16, 1 << 20, "Rays for each of them");
    d.quick(options->scene.width, 320);
    d.quick(options->scene.height, 180);
  };
  const auto run = [=](const Bench& b) {
    return measure_scenes(*scenes, 1, b, [&](const SceneChoice& choice) {
      return measure_errors(choice, *options, b.work, b.run, b.progress);
    });
  };
  return {.name = "error",
          .purpose =
              "Error measured against --error asked, of points and of a picture; error "
              "against time over the settings that --error chooses from",
          .quick = "Small: 50k points, a picture of 320 x 180, 400 receivers checked of each run",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check(); }};
}

}  // namespace ptc::bench
