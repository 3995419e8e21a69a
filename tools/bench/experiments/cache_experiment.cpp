#include <algorithm>

#include "tools/bench/experiments/cache_bench.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/values.h"

namespace ptc::bench {
namespace {

constexpr char kReading[] =
    "The city, blocks of neighbours among its points, occlusion and bleeding; each run begins "
    "with an empty cache, and with the file out of the system's. A cap is the share of the pages "
    "that have a frame. All runs over a scene in one order gave the same values to the last bit. "
    "Waiting: for a page's bytes, or for another thread that reads it. Each: of a receiver, or "
    "of a lookup in the part of hits.";

double each_ns(const CacheRow& row) {
  return 1e9 / static_cast<double>(row.receivers);
}

double in_core_share(const std::vector<CacheRow>& rows, const CacheRow& row) {
  const auto whole = std::ranges::find_if(rows, [&](const CacheRow& r) {
    return r.panel == row.panel && r.method == row.method && r.threads == row.threads && r.cap == 1;
  });
  return whole == rows.end() || row.panel == "hits" ? kNone : row.wall.median / whole->wall.median;
}

Columns<CacheRow> columns_of(const std::vector<CacheRow>& rows) {
  using R = CacheRow;
  return {{"panel", {"part"}, &R::panel},
          {"method", {"method"}, &R::method},
          {"threads", {"threads"}, &R::threads},
          {"cap", percent("cap %", "{:.1f}"), &R::cap},
          {"frames", {"frames"}, &R::frames},
          {"receivers", {"receivers"}, &R::receivers},
          {"wall_seconds", {}, &R::wall},
          {"wall_ns_each",
           {"wall ns each", "{:.1f}"},
           [](const R& r) { return scaled(r.wall, each_ns(r)); }},
          {"cpu_ns_each",
           {"CPU ns each", "{:.1f}"},
           [](const R& r) { return scaled(r.cpu, each_ns(r)); }},
          {"wait_seconds", {}, &R::wait},
          {"wait_ns_each",
           {"waiting ns each", "{:.0f}"},
           [](const R& r) { return each_ns(r) * r.wait.median; }},
          {"hit_rate", percent("hits %", "{:.4f}"), &R::hit_rate},
          {"pages", {"pages read each", "{:.4f}"}, &R::pages},
          {"bytes", {"bytes read each", "{:.0f}"}, &R::bytes},
          {"disk_bytes", {"by the disk", "{:.0f}"}, &R::disk_bytes},
          {"in_core_share", {"times all pages", "{:.2f}"}, [&rows](const R& r) {
             return in_core_share(rows, r);
           }}};
}

/// A line for each method, with all threads where a panel has several; over the cap or, of the
/// panel "threads", over them.
ChartPanel panel_of(const std::vector<CacheRow>& rows, const std::string& name, const char* title,
                    const char* y_label, double (*value)(const CacheRow&)) {
  const bool threads = name == "threads";
  ChartPanel panel{
      .title = title, .x_label = threads ? "threads" : "cap, % of the pages", .y_label = y_label};
  unsigned most = 0;
  for (const CacheRow& row : rows) {
    if (row.panel == name) most = std::max(most, row.threads);
  }
  for (const CacheRow& row : rows) {
    if (row.panel != name || (!threads && row.threads != most)) continue;
    series_of(panel, row.method, false)
        .points.push_back({.x = threads ? row.threads : 100 * row.cap, .y = value(row)});
  }
  return panel;
}

Chart chart_of(const std::vector<CacheRow>& rows) {
  Chart chart{.title = "Page cache", .note = kReading, .columns = 3};
  const auto wall = [](const CacheRow& row) { return row.wall.median * each_ns(row) / 1000; };
  const auto wait = [](const CacheRow& row) { return row.wait.median * each_ns(row) / 1000; };
  const auto missed = [](const CacheRow& row) { return 100 * (1 - row.hit_rate); };
  const auto bytes = [](const CacheRow& row) { return row.bytes; };
  constexpr char kWall[] = "wall time per receiver, us", kBytes[] = "bytes read per receiver";
  const auto add = [&](const char* panel, const char* title, const char* y_label,
                       double (*value)(const CacheRow&)) {
    add_panel(chart, panel_of(rows, panel, title, y_label, value));
  };
  add("back-end", "Time and cap, by back end", kWall, wall);
  add("back-end", "Misses and cap", "lookups that miss, %", missed);
  add("back-end", "Waiting and cap", "waiting per receiver, us", wait);
  add("threads", "Threads, at a cap of 9 %", kBytes, bytes);
  add("receivers", "Order of receivers", kBytes, bytes);
  add("pages", "Order of node pages", kBytes, bytes);
  add("sizes", "Size of pages", kWall, wall);
  return chart;
}

}  // namespace

Report report_of(const std::vector<CacheRow>& rows, unsigned runs) {
  return {
      .name = "cache",
      .title = "Page cache",
      .reading = kReading,
      .runs = runs,
      .tables = {tabulate<CacheRow>({.name = "rows", .group = "panel"}, columns_of(rows), rows)},
      .figures = {{.chart = chart_of(rows)}}};
}

Experiment make_cache_experiment() {
  const auto options = std::make_shared<CacheBenchOptions>();
  const auto declare = [options](Declaration& d) {
    add_count(d.command(), "--points", options->points, "Points of the city")->default_str("6M");
    d.quick("--points", options->points, 1'000'000);
    add_count(d.command(), "--receivers", options->receivers, "Of them, in blocks of neighbours")
        ->default_str("65536");
    d.quick("--receivers", options->receivers, 8'192);
    d.words("--panel", options->panels, "Measure this, not all; repeatable");
    d.repeats(options->repeats, 2);
    d.quick(options->caps, {1, 0.29, 0.09});
    d.quick(options->threads, {1, 2, 4});
  };
  return {.name = "cache",
          .purpose =
              "A page cache below the size of the scene: lookups, back ends, threads, order "
              "of receivers and of pages",
          .quick =
              "Two minutes on two cores: 1M points, 8k receivers, 2 runs, no cap below 9 %, at "
              "most 4 threads",
          .declare = declare,
          .run = [options](const Bench& b) { return measure_rows(measure_cache, *options, b); }};
}

}  // namespace ptc::bench
