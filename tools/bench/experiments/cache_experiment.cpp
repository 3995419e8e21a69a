// The experiment `ptcbench cache`: its table columns, its charts and its options.
#include <algorithm>

#include "tools/bench/experiments/cache_bench.h"
#include "tools/bench/experiments/experiment.h"

namespace ptc::bench {
namespace {

constexpr char kCacheReading[] =
    "Shading of the procedural city with a page cache that holds only a share of its pages. "
    "Receivers are points of the city in blocks of neighbours; they get occlusion and irradiance. "
    "Each run begins with an empty cache, and with the file out of the system's cache. Cap: frames "
    "of the cache, as a share of the pages. Item: a receiver, or a lookup in the part \"hits\", "
    "which looks up pages that are in the cache. Waiting: for a page's bytes, or for another "
    "thread that reads the page; all threads together. Disk bytes are what the system read for "
    "this process. All runs over one scene and order of receivers gave the same values to the last "
    "bit. Charts show the largest number of threads.";

/// The factor from seconds of a run to nanoseconds per item.
double each_ns(const CacheRow& row) {
  return 1e9 / static_cast<double>(row.receivers);
}

/// The wall time of a row over that of the row with frames for all pages.
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
          {"receivers", {"items"}, &R::receivers},
          {"wall_seconds", {}, &R::wall},
          {"wall_ns_each",
           {"wall ns/item", "{:.1f}"},
           [](const R& r) { return scaled(r.wall, each_ns(r)); }},
          {"cpu_ns_each",
           {"CPU ns/item", "{:.1f}"},
           [](const R& r) { return scaled(r.cpu, each_ns(r)); }},
          {"wait_seconds", {}, &R::wait},
          {"wait_ns_each",
           {"waiting ns/item", "{:.0f}"},
           [](const R& r) { return each_ns(r) * r.wait.median; }},
          {"hit_rate", percent("cache hits %", "{:.4f}"), &R::hit_rate},
          {"pages", {"pages read/item", "{:.4f}"}, &R::pages},
          {"bytes", {"bytes read/item", "{:.0f}"}, &R::bytes},
          {"disk_bytes", {"disk bytes/item", "{:.0f}"}, &R::disk_bytes},
          {"in_core_share", {"wall time / at cap 100 %", "{:.2f}"}, [&rows](const R& r) {
             return in_core_share(rows, r);
           }}};
}

/// Makes a panel with a line for each method at the largest number of threads, over the cap or, for
/// the panel "threads", over the threads.
ChartPanel panel_of(const std::vector<CacheRow>& rows, const std::string& name, const char* title,
                    const char* y_label, double (*value)(const CacheRow&)) {
  const bool threads = name == "threads";
  ChartPanel panel{.title = title,
                   .x_label = threads ? "threads" : "page cache, % of the pages",
                   .y_label = y_label};
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
  Chart chart{.title = "Shading with a page cache smaller than the scene",
              .note = kCacheReading,
              .columns = 3};
  const auto wall = [](const CacheRow& row) { return row.wall.median * each_ns(row) / 1000; };
  const auto wait = [](const CacheRow& row) { return row.wait.median * each_ns(row) / 1000; };
  const auto missed = [](const CacheRow& row) { return 100 * (1 - row.hit_rate); };
  const auto bytes = [](const CacheRow& row) { return row.bytes; };
  constexpr char kWall[] = "wall time per receiver, \u00b5s", kBytes[] = "bytes read per receiver";
  const auto add = [&](const char* panel, const char* title, const char* y_label,
                       double (*value)(const CacheRow&)) {
    add_panel(chart, panel_of(rows, panel, title, y_label, value));
  };
  add("back-end", "Time by back end", kWall, wall);
  add("back-end", "Cache misses by back end", "lookups that miss, %", missed);
  add("back-end", "Waiting for pages by back end", "waiting per receiver, \u00b5s", wait);
  add("threads", "Threads and replacement, cache of 9 %", kBytes, bytes);
  add("receivers", "Order of receivers", kBytes, bytes);
  add("pages", "Order of node pages", kBytes, bytes);
  add("sizes", "Size of pages", kWall, wall);
  return chart;
}

}  // namespace

Report report_of(const std::vector<CacheRow>& rows, unsigned runs) {
  return {.name = "cache",
          .title = "Shading with a page cache smaller than the scene",
          .reading = kCacheReading,
          .runs = runs,
          .tables = {tabulate<CacheRow>({.name = "rows", .title = "Part", .group = "panel"},
                                        columns_of(rows), rows)},
          .figures = {{.chart = chart_of(rows)}}};
}

Experiment make_cache_experiment() {
  const auto options = std::make_shared<CacheBenchOptions>();
  const auto declare = [options](Declaration& d) {
    d.city_points(options->points, "6M", 1'000'000);
    d.block_receivers(options->receivers, "65536", 8'192);
    d.words("--panel", options->panels, "Measure only this part; repeatable");
    d.repeats(options->repeats, 2);
    d.quick(options->caps, {1, 0.29, 0.09});
    d.quick(options->threads, {1, 2, 4});
  };
  return {.name = "cache",
          .purpose =
              "Time and bytes read with a page cache smaller than the scene, by back end, threads, "
              "replacement, order of receivers, order and size of pages; time of a lookup",
          .quick =
              "Two minutes on two cores: 1M points, 8k receivers, 2 runs, no cap below 9 %, at "
              "most 4 threads",
          .declare = declare,
          .run = [options](const Bench& b) { return measure_rows(measure_cache, *options, b); }};
}

}  // namespace ptc::bench
