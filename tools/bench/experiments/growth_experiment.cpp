// The experiment `ptcbench growth`: its table columns, its charts and its options.
#include <cmath>

#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/growth.h"

namespace ptc::bench {
namespace {

constexpr char kGrowthReading[] =
    "Time per receiver of PTCX, against the number of surfels, the solid angle of the gather, the "
    "sheets that lie behind each other, and the size of the page cache. Receivers are points of "
    "the scene in blocks of neighbours, spread evenly; they get occlusion and irradiance. Errors "
    "are root mean square (RMS) over the mean of rays at the same discs; where a row has none, "
    "nothing was checked against rays. A time ratio is the time that Embree takes, on the same "
    "discs or on the mesh, for the error of irradiance of PTCX, divided by the time of PTCX; the "
    "faster of single rays and packets counts. Cap: frames of the page cache, as a share of all "
    "pages; the cache is empty when a run begins, and the file is in the system's cache. Labels in "
    "the charts are the error of irradiance, or the hit rate of the page cache.";

const Columns<GrowthRow>& growth_columns() {
  using R = GrowthRow;
  static const Columns<R> columns{
      {"panel", {"varied"}, &R::panel},
      {"x", {"value", "{:.8g}"}, &R::x},
      {"scene", {"scene"}, &R::scene},
      {"surfels", {"surfels"}, &R::surfels},
      {"threads", {"threads"}, &R::threads},
      {"receivers", {"receivers"}, &R::receivers},
      {"us_per_receiver", {"CPU us/receiver", "{:.1f}"}, &R::us},
      {"wall_us_per_receiver", {"wall us/receiver", "{:.1f}"}, &R::wall_us},
      {"ao_rms", percent("occlusion RMS %"), &R::occlusion_rms},
      {"e_rms", percent("irradiance RMS %"), &R::irradiance_rms},
      {"speedup_discs", {"Embree discs, time ratio", "{:.1f}"}, &R::speedup_discs},
      {"speedup_mesh", {"Embree mesh, time ratio", "{:.1f}"}, &R::speedup_mesh},
      {"hit_rate", percent("cache hits %", "{:.3f}"), &R::hit_rate},
      {"pages_per_receiver", {"pages read/receiver", "{:.4f}"}, &R::pages},
      {"bytes_per_receiver", {"bytes read/receiver", "{:.1f}"}, &R::bytes}};
  return columns;
}

/// Adds a point to a series unless y is NaN.
void add_point(ChartPanel& panel, const std::string& name, double x, double y,
               const std::string& label = {}) {
  if (std::isfinite(y))
    series_of(panel, name, false).points.push_back({.x = x, .y = y, .label = label});
}

/// Makes a panel of the time of PTCX, and of the time of Embree at the same error.
ChartPanel time_panel(const std::vector<GrowthRow>& rows, const std::string& name,
                      const char* title, const char* x_label) {
  ChartPanel panel{.title = title, .x_label = x_label, .y_label = kTimePerReceiver};
  for (const GrowthRow& row : rows) {
    if (row.panel != name) continue;
    const std::string error =
        std::isfinite(row.irradiance_rms) ? fmt::format("{:.1f} %", 100 * row.irradiance_rms) : "";
    add_point(panel, "PTCX", row.x, row.us.median, error);
    add_point(panel, "Embree, same discs", row.x, row.us.median * row.speedup_discs);
    add_point(panel, "Embree, mesh", row.x, row.us.median * row.speedup_mesh);
  }
  return panel;
}

/// Makes a panel over the size of the page cache, with a line for each number of threads.
ChartPanel cap_panel(const std::vector<GrowthRow>& rows, const char* title, const char* y_label,
                     double (*value)(const GrowthRow&)) {
  ChartPanel panel{.title = title, .x_label = "page cache, % of all pages", .y_label = y_label};
  for (const GrowthRow& row : rows) {
    if (row.panel != "cap") continue;
    add_point(panel, fmt::format("{} thread{}", row.threads, row.threads > 1 ? "s" : ""),
              100 * row.x, value(row), fmt::format("{:.2f} %", 100 * row.hit_rate));
  }
  return panel;
}

Chart chart_of(const std::vector<GrowthRow>& rows) {
  Chart chart{.title = "Time per receiver against surfels, solid angle, depth and memory",
              .note = kGrowthReading,
              .columns = 3};
  add_panel(chart, time_panel(rows, "surfels", "Surfels", "surfels of the city"));
  add_panel(chart, time_panel(rows, "solid-angle", "Solid angle", "solid angle, sr"));
  add_panel(chart, time_panel(rows, "depth", "Depth complexity", "sheets above the ground"));
  add_panel(chart, cap_panel(rows, "Page cache: CPU time", kTimePerReceiver,
                             [](const GrowthRow& r) { return r.us.median; }));
  add_panel(chart, cap_panel(rows, "Page cache: wall time", "wall time per receiver, \u00b5s",
                             [](const GrowthRow& r) { return r.wall_us.median; }));
  add_panel(chart, cap_panel(rows, "Page cache: bytes read", "bytes read per receiver",
                             [](const GrowthRow& r) { return r.bytes; }));
  return chart;
}

}  // namespace

Report report_of(const std::vector<GrowthRow>& rows, unsigned runs) {
  return {.name = "growth",
          .title = "Time per receiver against surfels, solid angle, depth and memory",
          .reading = kGrowthReading,
          .runs = runs,
          .tables = {tabulate<GrowthRow>({.name = "rows", .title = "Varied", .group = "panel"},
                                         growth_columns(), rows)},
          .figures = {{.chart = chart_of(rows)}}};
}

Experiment make_growth_experiment() {
  const auto options = std::make_shared<GrowthOptions>();
  const auto declare = [options](Declaration& d) {
    d.points(options->points,
             "Surfels of the city, in place of 500k, 2M, 6M and 20M; repeatable; the largest city "
             "is also "
             "shaded with small page caches. Above 40M errors are not measured",
             {50'000, 150'000, 500'000});
    d.words("--panel", options->panels, "Vary only this; repeatable");
    d.checked(options->checked, 100);
    d.repeats(options->repeats, 3);
    d.quick(options->middle_points, 50'000);
    d.quick(options->solid_angles, {0.1F, 0.03F, 0.01F, 0.003F, 0.001F});
    d.quick(options->layers, {1, 2, 4, 8, 16});
    d.quick(options->caps, {1, 0.29, 0.09});  // the pages are too few for smaller shares
    d.quick(options->own_points, 8'192);
    d.quick(options->reference_rays, 4096);
  };
  return {
      .name = "growth",
      .purpose =
          "Time per receiver, with its error, against surfels, solid angle, depth complexity and "
          "memory",
      .quick =
          "Under a minute on two cores: at most 500k surfels, 8k receivers, 100 of them "
          "checked, 3 runs, no cap below 9 %",
      .declare = declare,
      .run = [options](const Bench& b) { return measure_rows(measure_growth, *options, b); }};
}

}  // namespace ptc::bench
