// The options, tables and charts of `ptcbench relight`.
#include <cmath>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/relight.h"

namespace ptc::bench {
namespace {

constexpr char kRelightReading[] =
    "Time per surfel to light a scene anew, against the error of irradiance. ptclight casts rays "
    "at "
    "the discs of the container, which is larger than the page cache or not, and gathers the sky; "
    "embree-mesh is single rays of Embree at the mesh in memory, as a build casts them. Errors are "
    "shares of the mean irradiance of many rays at the mesh: mean, root mean square (RMS), and RMS "
    "away from the borders of shadows, where light is even to 5 % within 2.5 radii of the surfel. "
    "Surfels inside of walls and roofs, which nothing sees from four radii away, are left out. "
    "The irradiance of a surfel is the mean over four places of its square cell for all of them. "
    "CPU times are those of rays and gather; wall times of ptclight are those of the whole run, "
    "which writes a container.";

const Columns<RelightRow>& relight_columns() {
  using R = RelightRow;
  static const Columns<R> columns{{"scene", {"scene"}, &R::scene},
                                  {"light", {"light"}, &R::light},
                                  {"method", {"method"}, &R::method},
                                  {"setting", {"setting"}, &R::setting},
                                  {"surfels", {"surfels lit"}, &R::surfels},
                                  {"threads", {"threads"}, &R::threads},
                                  {"rays", {"rays/surfel", "{:.1f}"}, &R::rays},
                                  {"us_per_surfel", {"CPU us/surfel", "{:.2f}"}, &R::us},
                                  {"wall_us_per_surfel", {"wall us/surfel", "{:.2f}"}, &R::wall_us},
                                  {"mean", percent("mean %", "{:+.2f}"), &R::mean},
                                  {"rms", percent("RMS %"), &R::rms},
                                  {"away_rms", percent("RMS away from borders %"), &R::away}};
  return columns;
}

ChartPanel panel_of(const std::vector<RelightRow>& rows, const std::string& light) {
  ChartPanel panel{.title = rows.front().scene + ", " + light,
                   .x_label = "CPU time per surfel, \u00b5s",
                   .y_label = "irradiance RMS error, %"};
  for (const RelightRow& row : rows) {
    if (row.light != light) continue;
    const ChartPoint point{.x = row.us.median, .y = 100 * row.rms, .label = row.setting};
    series_of(panel, row.method, false).points.push_back(point);
    if (std::isnan(row.away)) continue;
    series_of(panel, row.method + ", away from borders", true)
        .points.push_back({.x = row.us.median, .y = 100 * row.away});
  }
  return panel;
}

}  // namespace

Report report_of(const std::vector<std::vector<RelightRow>>& scenes, unsigned runs) {
  std::vector<RelightRow> rows;
  Chart chart{
      .title = "Time to light a scene anew against error", .note = kRelightReading, .columns = 3};
  for (const auto& scene : scenes) {
    std::string light;
    for (const RelightRow& row : scene) {
      if (row.light != light) add_panel(chart, panel_of(scene, row.light));
      light = row.light;
    }
    rows.insert(rows.end(), scene.begin(), scene.end());
  }
  return {
      .name = "relight",
      .title = "Time to light a scene anew against error",
      .reading = kRelightReading,
      .runs = runs,
      .tables = {tabulate<RelightRow>({.name = "rows", .group = "scene"}, relight_columns(), rows)},
      .figures = {{.chart = chart}}};
}

Experiment make_relight_experiment() {
  const auto options = std::make_shared<RelightOptions>();
  const auto scenes = std::make_shared<SceneList>();
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->points, "2M", 20'000);
    d.checked(options->checked, 300);
    d.repeats(options->repeats, 2);
    d.quick(options->timed, 2'000);
    d.quick(options->reference_rays, 64);
  };
  const auto run = [=](const Bench& b) {
    return measure_scenes(*scenes, options->repeats, b, [&](const SceneChoice& choice) {
      return measure_relight(choice, *options, b.work, b.run, b.progress);
    });
  };
  return {.name = "relight",
          .purpose =
              "Time to light a scene anew by ptclight against its error, next to Embree on "
              "the mesh",
          .quick = "A few seconds: 20k points of the first scene, 300 checked, 2 runs",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check_meshes(); }};
}

}  // namespace ptc::bench
