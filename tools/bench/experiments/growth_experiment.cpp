#include <cmath>

#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/growth.h"

namespace ptc::bench {
namespace {

constexpr char kTime[] = "CPU time per receiver, \u00b5s";
constexpr char kReading[] =
    "Receivers are the scene's own points in blocks of neighbours, spread evenly. Errors are RMS "
    "over the mean of rays at the same discs, in the same run; where there is none, nothing was "
    "checked against rays. Embree: how much longer it takes for the error of PTCX, with single "
    "rays or packets, whichever is faster. A cap is the share of all pages, decoded, that the "
    "page cache has frames for; the cache is empty when a run begins, and the files are in the "
    "system's cache. In charts the errors of irradiance, or the cache's hit rates, stand beside "
    "the markers.";

const Columns<GrowthRow>& columns() {
  using R = GrowthRow;
  static const Columns<R> columns{{"panel", {"over"}, &R::panel},
                                  {"x", {"at", "{:.5g}"}, &R::x},
                                  {"scene", {"scene"}, &R::scene},
                                  {"surfels", {"surfels"}, &R::surfels},
                                  {"threads", {"threads"}, &R::threads},
                                  {"receivers", {"receivers"}, &R::receivers},
                                  {"us_per_receiver", {"CPU us each", "{:.1f}"}, &R::us},
                                  {"wall_us_per_receiver", {"wall us each", "{:.1f}"}, &R::wall_us},
                                  {"ao_rms", percent("occlusion RMS %"), &R::occlusion_rms},
                                  {"e_rms", percent("irradiance RMS %"), &R::irradiance_rms},
                                  {"speedup_discs", {"times, discs", "{:.1f}"}, &R::speedup_discs},
                                  {"speedup_mesh", {"times, mesh", "{:.1f}"}, &R::speedup_mesh},
                                  {"hit_rate", percent("hits %", "{:.3f}"), &R::hit_rate},
                                  {"pages_per_receiver", {"pages read each", "{:.4f}"}, &R::pages},
                                  {"bytes_per_receiver", {"bytes read each", "{:.1f}"}, &R::bytes}};
  return columns;
}

/// Adds a point where there is a value.
void add_point(ChartPanel& panel, const std::string& name, double x, double y,
               const std::string& label = {}) {
  if (std::isfinite(y))
    series_of(panel, name, false).points.push_back({.x = x, .y = y, .label = label});
}

/// Time of PTCX, and of Embree at its error.
ChartPanel time_panel(const std::vector<GrowthRow>& rows, const std::string& name,
                      const char* title, const char* x_label) {
  ChartPanel panel{.title = title, .x_label = x_label, .y_label = kTime};
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

/// A line for each number of threads.
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
  Chart chart{.title = "How the time of a receiver grows", .note = kReading, .columns = 3};
  add_panel(chart, time_panel(rows, "surfels", "Surfels", "surfels of the city"));
  add_panel(chart, time_panel(rows, "solid-angle", "Solid angle", "solid angle, sr"));
  add_panel(chart, time_panel(rows, "depth", "Depth complexity", "sheets above the ground"));
  add_panel(chart,
            cap_panel(rows, "Memory", kTime, [](const GrowthRow& r) { return r.us.median; }));
  add_panel(chart, cap_panel(rows, "Memory, wall time", "wall time per receiver, \u00b5s",
                             [](const GrowthRow& r) { return r.wall_us.median; }));
  add_panel(chart, cap_panel(rows, "Reading", "bytes read per receiver",
                             [](const GrowthRow& r) { return r.bytes; }));
  return chart;
}

}  // namespace

Report report_of(const std::vector<GrowthRow>& rows, unsigned runs) {
  return {.name = "growth",
          .title = "How the time of a receiver grows",
          .reading = kReading,
          .runs = runs,
          .tables = {tabulate<GrowthRow>({.name = "rows", .title = "Over", .group = "panel"},
                                         columns(), rows)},
          .figures = {{.chart = chart_of(rows)}}};
}

Experiment make_growth_experiment() {
  const auto options = std::make_shared<GrowthOptions>();
  const auto declare = [options](Declaration& d) {
    d.points(
        options->points,
        "Surfels of a city, in place of 500k, 2M, 6M and 20M; repeatable; the greatest is also "
        "shaded under caps. Above 40M without a check by rays",
        {50'000, 150'000, 500'000});
    d.words("--panel", options->panels, "Measure against this, not all; repeatable");
    d.checked(options->checked, 100);
    d.repeats(options->repeats, 3);
    d.quick(options->middle_points, 50'000);
    d.quick(options->solid_angles, {0.1F, 0.01F, 0.001F});
    d.quick(options->layers, {1, 4, 16});
    d.quick(options->caps, {1, 0.29, 0.09});  // so few pages have nothing to spare below that
    d.quick(options->own_points, 8'192);
    d.quick(options->reference_rays, 4096);
  };
  return {.name = "growth",
          .purpose =
              "Time per receiver against surfels, solid angle, depth complexity and memory, "
              "with its error",
          .quick =
              "Under a minute on two cores: at most 500k surfels, 8k receivers, 100 of them "
              "checked, 3 runs, no cap below 9 %",
          .declare = declare,
          .run = [options](const Bench& b) { return measure_rows(measure_growth, *options, b); }};
}

}  // namespace ptc::bench
