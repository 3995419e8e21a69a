// The experiment `ptcbench surfels`: its tables, its charts and its options.
#include <memory>
#include <string>

#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/surfels.h"

namespace ptc::bench {
namespace {

constexpr char kSurfelsReading[] =
    "How near surfels come to the mesh that they were made of, by their number, evenly spread and "
    "adapted to the surface (--adapt). Errors are root mean square over the mean, of rays at the "
    "surfels against rays at the mesh along the same directions, at 2,048 places of the mesh: of "
    "light from surfaces, of occlusion, and the largest one that --error of ptcbuild goes by, with "
    "the bounds of 90 % of resamples of the places. No gather is part of them. The second table "
    "has the surfels and bytes that keep the error asked, on the lines between the containers, and "
    "the CPU time of the gather of a picture of the mesh with them that has as large an error of "
    "its own.";

const char* way_of(bool adapts) {
  return adapts ? "adapted" : "even";
}

const Columns<SurfelsRow>& surfels_columns() {
  using R = SurfelsRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"way", {"surfels are"}, [](const R& r) { return std::string(way_of(r.trial.adapts)); }},
      {"points", {"surfels"}, [](const R& r) { return r.trial.points; }},
      {"bytes", {"bytes"}, [](const R& r) { return r.trial.bytes; }},
      {"e_rms", percent("irradiance %"),
       [](const R& r) { return r.trial.found.error.irradiance_rms; }},
      {"ao_rms", percent("occlusion %"),
       [](const R& r) {
         const CheckError& e = r.trial.found.error;
         return e.occlusion_mean > 0 ? e.occlusion_rms / e.occlusion_mean : 0.0;
       }},
      {"error", percent("largest %"), [](const R& r) { return r.trial.found.error.relative(); }},
      {"low", percent("from %"), [](const R& r) { return r.trial.found.low; }},
      {"high", percent("to %"), [](const R& r) { return r.trial.found.high; }},
      {"e_bias", percent("irradiance bias %", "{:+.2f}"),
       [](const R& r) { return r.trial.found.error.irradiance_bias; }},
      {"build_cpu", {"build, CPU s", "{:.1f}"}, [](const R& r) { return r.trial.cpu_seconds; }}};
  return columns;
}

const Columns<SurfelsNeeds>& need_columns() {
  using R = SurfelsNeeds;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"asked", percent("asked %", "{:.4g}"), &R::asked},
      {"even_surfels", {"even surfels", "{:.0f}"}, [](const R& r) { return r.even.surfels; }},
      {"adapted_surfels",
       {"adapted surfels", "{:.0f}"},
       [](const R& r) { return r.adapted.surfels; }},
      {"surfels_ratio",
       {"ratio", "{:.2f}"},
       [](const R& r) { return r.adapted.surfels / r.even.surfels; }},
      {"even_bytes", {"even bytes", "{:.3g}"}, [](const R& r) { return r.even.bytes; }},
      {"adapted_bytes", {"adapted bytes", "{:.3g}"}, [](const R& r) { return r.adapted.bytes; }},
      {"bytes_ratio",
       {"ratio", "{:.2f}"},
       [](const R& r) { return r.adapted.bytes / r.even.bytes; }},
      {"even_cpu",
       {"even picture, CPU s", "{:.2f}"},
       [](const R& r) { return r.even.picture_cpu; }},
      {"adapted_cpu",
       {"adapted picture, CPU s", "{:.2f}"},
       [](const R& r) { return r.adapted.picture_cpu; }},
      {"cpu_ratio", {"ratio", "{:.2f}"}, [](const R& r) {
         return r.adapted.picture_cpu.median / r.even.picture_cpu.median;
       }}};
  return columns;
}

/// Makes a panel of the errors over a cost of the containers.
template <class X>
ChartPanel panel_of(const SurfelsScene& scene, const char* x_label, const X& x) {
  ChartPanel panel{.title = scene.needs.scene,
                   .x_label = x_label,
                   .y_label = "RMS error against the mesh, % of the mean"};
  for (const SurfelsRow& row : scene.rows) {
    series_of(panel, way_of(row.trial.adapts), false)
        .points.push_back({.x = x(row.trial), .y = 100 * row.trial.found.error.relative()});
  }
  panel.limits.push_back({100 * scene.needs.asked, "asked"});
  return panel;
}

}  // namespace

Report report_of(const std::vector<SurfelsScene>& scenes, unsigned runs) {
  std::vector<SurfelsRow> rows;
  std::vector<SurfelsNeeds> needs;
  Chart chart{.title = "Error of surfels against their mesh", .columns = 2};
  for (const SurfelsScene& scene : scenes) {
    rows.insert(rows.end(), scene.rows.begin(), scene.rows.end());
    needs.push_back(scene.needs);
    add_panel(chart, panel_of(scene, "surfels",
                              [](const SurfelTrial& t) { return static_cast<double>(t.points); }));
    add_panel(chart, panel_of(scene, "bytes of the container",
                              [](const SurfelTrial& t) { return static_cast<double>(t.bytes); }));
  }
  return {.name = "surfels",
          .title = "How many surfels a mesh needs",
          .reading = kSurfelsReading,
          .runs = runs,
          .tables = {tabulate<SurfelsRow>({.name = "rows"}, surfels_columns(), rows),
                     tabulate<SurfelsNeeds>({.name = "needs"}, need_columns(), needs)},
          .figures = {{.chart = chart}}};
}

Experiment make_surfels_experiment() {
  const auto options = std::make_shared<SurfelsOptions>();
  const auto scenes = std::make_shared<SceneList>(
      std::vector<std::string>{"fractal", "window", "cornell", "box-lamp"});
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->counts, "Surfels wanted", {16'000, 64'000});
    d.repeats(options->repeats, 1);
  };
  const auto run = [=](const Bench& b) {
    return measure_scenes(*scenes, options->repeats, b, [&](const SceneChoice& choice) {
      return measure_surfels(choice, *options, b.work, b.run, b.progress);
    });
  };
  return {.name = "surfels",
          .purpose = "Error of surfels against their mesh, by their number, even and adapted",
          .quick = "16k and 64k surfels of the first scene, one picture",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check_meshes(); }};
}

}  // namespace ptc::bench
