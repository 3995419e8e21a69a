// The experiment `ptcbench scan`: its table columns, its chart and its options.
#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/scan_bench.h"

namespace ptc::bench {
namespace {

constexpr char kScanReading[] =
    "Points drawn at random from a mesh, without normals and radii, and with Gaussian noise along "
    "each axis, in units of the spacing sqrt(area / points). Angles are between a normal and the "
    "line along the normal of the triangle from which the point was drawn; flipped normals point "
    "to the wrong side of it, which says something only of closed meshes. Times are CPU times of "
    "all threads together. Those of ptcx are of all it does: temporary files, normals, sides, "
    "radii and outliers; sorting is not part of them. Those of Open3D are of estimate_normals with "
    "30 neighbours and orient_normals_consistent_tangent_plane with 15, those of PCL of "
    "NormalEstimation with 30, which tells no sides. Area is the sum of 2 r^2 "
    "over that of the mesh. The result of ptcx was checked to have the same bytes under another "
    "cap and with another number of threads.";

const Columns<ScanRow>& scan_columns() {
  using R = ScanRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"noise", {"noise, spacings", "{:.2g}"}, &R::noise},
      {"method", {"method"}, &R::method},
      {"points", {"points"}, &R::points},
      {"median_degrees", {"median angle, degrees", "{:.2f}"}, &R::median},
      {"mean_degrees", {"mean", "{:.2f}"}, &R::mean},
      {"p95_degrees", {"95th percentile", "{:.1f}"}, &R::percentile_95},
      {"flipped", percent("flipped %", "{:.3f}"), &R::flipped},
      {"area", percent("area of discs %", "{:.1f}"), &R::area},
      {"outliers", {"outliers"}, [](const R& r) { return when(r.method == "ptcx", r.outliers); }},
      {"cpu_us_per_point",
       {"CPU us/point", "{:.3f}"},
       [](const R& r) { return scaled(r.cpu, 1e6 / static_cast<double>(r.points)); }},
      {"normals_us_per_point", {"of it normals", "{:.3f}"}, &R::normals_us},
      {"points_per_cpu_second",
       {"million points/CPU s", "{:.2f}", 1e6},
       [](const R& r) { return r.rate(); }},
      {"resident_bytes", {"peak memory MiB", "{:.0f}", kMebi}, &R::resident_bytes}};
  return columns;
}

Chart chart_of(const std::vector<ScanRow>& rows) {
  Chart chart{.title = "Normals of point clouds", .note = kScanReading, .columns = 2};
  for (const bool noisy : {false, true}) {
    ChartPanel panel{.title = noisy ? "With noise" : "Without noise",
                     .x_label = "CPU time per point, \u00b5s",
                     .y_label = "median angle, degrees"};
    for (const ScanRow& row : rows) {
      if ((row.noise > 0) != noisy) continue;
      series_of(panel, row.method, row.method != "ptcx")
          .points.push_back({.x = 1e6 / row.rate(), .y = row.median, .label = row.scene});
    }
    add_panel(chart, panel);
  }
  return chart;
}

}  // namespace

Report report_of(const std::vector<SceneScans>& scenes, unsigned runs) {
  std::vector<ScanRow> rows;
  std::vector<std::string> notes;
  for (const SceneScans& scene : scenes) {
    rows.insert(rows.end(), scene.rows.begin(), scene.rows.end());
    notes.push_back(fmt::format("{} has {} triangles.", scene.name, scene.triangles));
  }
  return {.name = "scan",
          .title = "Normals and radii of point clouds",
          .reading = kScanReading,
          .runs = runs,
          .tables = {tabulate<ScanRow>({.name = "rows"}, scan_columns(), rows)},
          .notes = notes,
          .figures = {{.chart = chart_of(rows)}}};
}

Experiment make_scan_experiment() {
  const auto options = std::make_shared<ScanBenchOptions>();
  const auto scenes = std::make_shared<SceneList>();
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->points, "1M", 50'000);
    d.repeats(options->repeats, 1);
    d.file("--python", options->python,
           "A Python interpreter with the package open3d, which is then measured, too");
    d.file("--pcl", options->pcl,
           "The program pcl_normals, which is built where PCL is installed; PCL is then measured, "
           "too");
  };
  const auto run = [=](const Bench& b) {
    return measure_scenes(*scenes, options->repeats, b, [&](const SceneChoice& choice) {
      return measure_scans(choice, *options, b.work, b.run, b.progress);
    });
  };
  return {.name = "scan",
          .purpose = "Errors and time of the normals of point clouds that were drawn from meshes",
          .quick = "50k points of the first scene, 1 run",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check_meshes(); }};
}

}  // namespace ptc::bench
