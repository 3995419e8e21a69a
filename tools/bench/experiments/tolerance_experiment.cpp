// The experiment `ptcbench tolerance`: its table, its chart and its options.
#include <memory>
#include <string>

#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/tolerance.h"

namespace ptc::bench {
namespace {

constexpr char kToleranceReading[] =
    "What --tolerance saves of the bytes of a container. The first row of a scene is the profile "
    "compact; bytes are for each point of the exact container. Errors are root mean square over "
    "the mean, at 2,048 points: of occlusion or light that arrives, whichever is larger, by rays "
    "at what is stored against rays at the exact discs along the same directions, with the bounds "
    "of 90 % of resamples; and of the light that leaves. No gather is part of them. The time is "
    "CPU time of the gather, with default settings, of the same receivers from each container: "
    "median, least and greatest. Choosing is the time of all trials.";

const Columns<ToleranceRow>& tolerance_columns() {
  using R = ToleranceRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"tolerance",
       {"tolerance"},
       [](const R& r) {
         return r.tolerance > 0 ? fmt::format("{:.4g} %", 100 * r.tolerance)
                                : std::string("compact");
       }},
      {"points", {"points"}, &R::points},
      {"bytes_per_point", {"bytes a point", "{:.2f}"}, &R::bytes_per_point},
      {"ratio", {"of compact", "{:.2f}"}, &R::ratio},
      {"error", percent("arrives %"), [](const R& r) { return r.found.found.error.relative(); }},
      {"low", percent("from %"), [](const R& r) { return r.found.found.low; }},
      {"high", percent("to %"), [](const R& r) { return r.found.found.high; }},
      {"light", percent("leaves %"), [](const R& r) { return r.found.light_error; }},
      {"shading", {"us of a receiver", "{:.2f}"}, &R::shading},
      {"choosing", {"choosing, s", "{:.1f}"}, &R::choosing}};
  return columns;
}

}  // namespace

Report report_of(const std::vector<ToleranceScene>& scenes, unsigned runs) {
  std::vector<ToleranceRow> rows;
  Chart chart{.title = "Bytes of a point by the error of what is stored", .columns = 2};
  ChartPanel bytes{.title = "Bytes",
                   .x_label = "greatest error, % of the mean",
                   .y_label = "bytes of a point of the exact container"};
  ChartPanel times{.title = "Time",
                   .x_label = "greatest error, % of the mean",
                   .y_label = "CPU time of a receiver, us"};
  for (const ToleranceScene& scene : scenes) {
    for (const ToleranceRow& row : scene.rows) {
      rows.push_back(row);
      const double error = 100 * row.found.error();
      series_of(bytes, row.scene, false).points.push_back({.x = error, .y = row.bytes_per_point});
      series_of(times, row.scene, false).points.push_back({.x = error, .y = row.shading.median});
    }
  }
  add_panel(chart, bytes);
  add_panel(chart, times);
  return {.name = "tolerance",
          .title = "Fewer bytes within a tolerance",
          .reading = kToleranceReading,
          .runs = runs,
          .tables = {tabulate<ToleranceRow>({.name = "rows"}, tolerance_columns(), rows)},
          .figures = {{.chart = chart}}};
}

Experiment make_tolerance_experiment() {
  const auto options = std::make_shared<ToleranceOptions>();
  const auto scenes =
      std::make_shared<SceneList>(std::vector<std::string>{"fractal", "window", "cornell", "city"});
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->points, "1M", 100'000);
    d.count("--receivers", options->receivers, "Number of points that are shaded, spread evenly",
            "50k");
    d.quick("--receivers", options->receivers, 10'000);
    d.repeats(options->repeats, 1);
  };
  const auto run = [=](const Bench& b) {
    return measure_scenes(*scenes, options->repeats, b, [&](const SceneChoice& choice) {
      return measure_tolerance(choice, *options, b.work, b.run, b.progress);
    });
  };
  return {.name = "tolerance",
          .purpose = "Bytes and shading time of containers by the error that they may have",
          .quick = "100k points of the first scene, shaded once",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check_meshes(); }};
}

}  // namespace ptc::bench
