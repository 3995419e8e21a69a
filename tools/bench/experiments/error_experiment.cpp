// The experiment `ptcbench error`: its table columns, its charts and its options.
#include <string>

#include <fmt/format.h>

#include "tools/bench/experiments/error_knob.h"
#include "tools/bench/experiments/experiment.h"

namespace ptc::bench {
namespace {

constexpr char kErrorReading[] =
    "The error that was asked for with --error, and the error that was measured. An error is the "
    "larger one of occlusion and irradiance: root mean square (RMS) over the mean, against rays at "
    "the same surfels, at receivers that had no part in choosing the setting. Errors against the "
    "mesh also contain the error of the surfels themselves. Pilots are receivers of the same run "
    "by which the setting was chosen; their share is of the CPU time of the whole run. Where the "
    "error asked was not met, the finest setting was taken. A setting is a solid angle in sr, a "
    "parallax in rad and R direction pixels along a cube edge, or a number of rays.";

/// A setting as tables show it.
std::string setting_text(float solid_angle, float parallax, unsigned resolution) {
  return fmt::format("{} sr, {} rad, R {}", solid_angle, parallax, resolution);
}

const Columns<ErrorRow>& error_columns() {
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
      {"measured_mesh", percent("measured against mesh %"),
       [](const R& r) { return r.check.mesh ? r.check.mesh->relative() : kNone; }},
      {"at_pilots", percent("measured at pilots %"),
       [](const R& r) { return r.tuning.measured.relative(); }},
      {"checked", {"receivers checked"}, [](const R& r) { return r.check.receivers; }},
      {"check_rays", {"rays/receiver"}, [](const R& r) { return r.check.rays; }},
      {"setting", {}, tuning(&TuningReport::setting)},
      {"gather",
       {"setting"},
       [](const R& r) {
         const GatherOptions& g = r.tuning.gather;
         if (r.tuning.receiver_rays > 0) return fmt::format("{} rays", r.tuning.receiver_rays);
         return setting_text(g.solid_angle, g.parallax, g.resolution);
       }},
      {"solid_angle", {}, gather(&GatherOptions::solid_angle)},
      {"parallax", {}, gather(&GatherOptions::parallax)},
      {"resolution", {}, gather(&GatherOptions::resolution)},
      {"receiver_rays", {}, tuning(&TuningReport::receiver_rays)},
      {"receivers", {"receivers shaded"}, &R::receivers},
      {"us_per_receiver", {"CPU us/receiver", "{:.1f}"}, &R::us_per_receiver},
      {"wall_us_per_receiver", {"wall us/receiver", "{:.1f}"}, &R::wall_us_per_receiver},
      {"pilots", {"pilots"}, tuning(&TuningReport::pilots)},
      {"pilot_rays", {}, tuning(&TuningReport::rays)},
      {"pilot_share", percent("pilots, CPU share %", "{:.1f}"), &R::pilot_share}};
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
      {"setting", {"setting no."}, &R::setting},
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
       {"CPU us/receiver", "{:.1f}"},
       [](const R& r) { return r.measured.us_per_receiver; }},
      {"occlusion", percent("occlusion RMS %"),
       [](const R& r) {
         const CheckError& e = r.measured.error;
         return e.occlusion_mean > 0 ? e.occlusion_rms / e.occlusion_mean : 0.0;
       }},
      {"irradiance", percent("irradiance RMS %"),
       [](const R& r) { return r.measured.error.irradiance_rms; }},
      {"error", percent("larger of both %"),
       [](const R& r) { return r.measured.error.relative(); }}};
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

/// Makes the chart: measured against asked for each scene and set, and error against time for each
/// scene.
Chart chart_of(const std::vector<SceneErrors>& scenes) {
  ChartPanel asked{.title = "Measured error against error asked",
                   .x_label = "error asked, %",
                   .y_label = "error measured, %"};
  ChartPanel ladder_panel{.title = "Error against time at all settings",
                          .x_label = kTimePerReceiver,
                          .y_label = "RMS error, % of the mean"};
  ChartSeries limit{.name = "asked", .dashed = true};
  Chart chart{.title = "Measured error against the error asked with --error", .columns = 2};
  chart.note = std::string(kErrorReading) + "\n";
  for (const SceneErrors& scene : scenes) {
    // Show measured against asked, and once the line on which both are equal
    for (const char* set : kSets) {
      ChartSeries series{.name = scene.name + ", " + set};
      for (const ErrorRow& row : scene.rows) {
        if (row.set != set) continue;
        series.points.push_back({.x = 100 * row.asked, .y = 100 * row.measured()});
        if (&scene == &scenes.front() && row.set == scene.rows.front().set)
          limit.points.push_back({.x = 100 * row.asked, .y = 100 * row.asked});
      }
      if (!series.points.empty()) asked.series.push_back(std::move(series));
    }
    // Show error against time over the ladder
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
  return {
      .name = "error",
      .title = "Measured error against the error asked with --error",
      .reading = kErrorReading,
      .runs = runs,
      .tables = {tabulate<ErrorRow>({.name = "rows"}, error_columns(), rows),
                 tabulate<RungRow>({.name = "ladder",
                                    .title = "All settings that --error chooses from",
                                    .group = "scene"},
                                   rung_columns(), rungs),
                 tabulate<SceneErrors>(
                     {.name = "slopes", .title = "How the error falls with time over all settings"},
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
    d.integer("--check-rays", options->rays, 16, 1 << 20, "Rays for each checked receiver");
    d.words("--set", options->sets,
            "Shade only these receivers: pixels of a picture, or points of the scene, all of them "
            "or some far apart; repeatable");
    d.for_experts("--set");
    d.quick(options->scene.width, 320);
    d.quick(options->scene.height, 180);
    d.quick(options->scene.sparse_points, 1'000);
  };
  const auto run = [=](const Bench& b) {
    return measure_scenes(*scenes, 1, b, [&](const SceneChoice& choice) {
      return measure_errors(choice, *options, b.work, b.run, b.progress);
    });
  };
  return {
      .name = "error",
      .purpose =
          "Measured error against the error asked with --error, for points, points far apart and "
          "a picture; error against time at all settings that --error chooses from",
      .quick = "50k points, a picture of 320 x 180, 400 receivers checked of each run",
      .declare = declare,
      .run = run,
      .check = [scenes] { scenes->check(); }};
}

}  // namespace ptc::bench
