// The experiment `ptcbench sort`: its table columns, its charts and its options.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/sort_bench.h"

namespace ptc::bench {
namespace {

constexpr char kSortReading[] =
    "Point records of 40 bytes in several orders of their keys. In memory: CPU time of all threads "
    "together; ptcx is the core of the external sort, tbb is oneTBB's parallel_sort, which like "
    "std::sort is not stable. On disk: wall time from an input file of records to an output file, "
    "under the memory cap; the floor is the time in which the same disk reads and writes these "
    "bytes twice, four blocks of 4 MB at once. Both go past the system's cache. Floor / sort, also "
    "next to the markers of the chart, is the floor's time as a share of the sort's. Moved bytes "
    "are read or written. Peak memory is what a run adds to the program. Each order was sorted by "
    "ptcx once and checked: ascending, stable, and the same records.";

/// Nanoseconds per record.
double per_point_ns(double seconds, const SortRow& row) {
  return 1e9 * seconds / static_cast<double>(std::max<std::uint64_t>(1, row.points));
}

/// The row of another method with the same panel, order and size; null where there is none.
const SortRow* beside(const std::vector<SortRow>& rows, const SortRow& row, const char* method) {
  const auto found = std::ranges::find_if(rows, [&](const SortRow& r) {
    return r.panel == row.panel && r.order == row.order && r.points == row.points &&
           r.method == method;
  });
  return found == rows.end() ? nullptr : &*found;
}

/// The time of the floor over that of the sort; NaN for all other methods.
double floor_share(const std::vector<SortRow>& rows, const SortRow& row) {
  const SortRow* floor = beside(rows, row, "floor");
  return floor && row.method == "ptcx" ? floor->wall.median / row.wall.median : kNone;
}

/// The CPU time of std::sort over that of the row.
double speedup(const std::vector<SortRow>& rows, const SortRow& row) {
  const SortRow* other = beside(rows, row, "std::sort");
  return other && row.method != "memcpy" ? other->cpu.median / row.cpu.median : kNone;
}

Columns<SortRow> columns_of(const std::vector<SortRow>& rows) {
  using R = SortRow;
  return {{"panel", {"place"}, &R::panel},
          {"order", {"order"}, &R::order},
          {"method", {"method"}, &R::method},
          {"points", {"records"}, &R::points},
          {"threads", {"threads"}, &R::threads},
          {"memory_bytes",
           {"cap MiB", "{:.0f}", kMebi},
           [](const R& r) { return when(r.memory_bytes > 0, r.memory_bytes); }},
          {"wall_seconds", {"wall s", "{:.3f}"}, &R::wall},
          {"cpu_ns_per_point",
           {"CPU ns/record", "{:.1f}"},
           [](const R& r) { return scaled(r.cpu, per_point_ns(1, r)); }},
          {"moved_bytes",
           {"moved GB", "{:.2f}", kGiga},
           [](const R& r) { return when(r.moved_bytes > 0, r.moved_bytes); }},
          {"resident_bytes", {"peak memory MiB", "{:.0f}", kMebi}, &R::resident_bytes},
          {"floor_share", percent("floor / sort %", "{:.0f}"),
           [&rows](const R& r) { return floor_share(rows, r); }},
          {"speedup", {"CPU time, std::sort / this", "{:.2f}"}, [&rows](const R& r) {
             return speedup(rows, r);
           }}};
}

/// Makes a panel with a line for each order and method. In memory the other methods are shown for
/// two orders only.
ChartPanel panel_of(const std::vector<SortRow>& rows, const std::string& name) {
  const bool disk = name == "disk";
  ChartPanel panel{.title = disk ? "On disk" : "In memory",
                   .x_label = "records",
                   .y_label = disk ? "wall time per record, ns" : "CPU time per record, ns"};
  for (const SortRow& row : rows) {
    if (row.panel != name) continue;
    const bool compared = disk || row.order == "city" || row.order == "random";
    if (!compared && row.method != "ptcx") continue;
    ChartSeries& series = series_of(panel, row.method + ", " + row.order, row.method != "ptcx");
    const double share = floor_share(rows, row);
    series.points.push_back(
        {.x = static_cast<double>(row.points),
         .y = per_point_ns(disk ? row.wall.median : row.cpu.median, row),
         .label = std::isfinite(share) ? fmt::format("{:.0f} %", 100 * share) : std::string()});
  }
  return panel;
}

}  // namespace

Report report_of(const std::vector<SortRow>& rows, unsigned runs) {
  Chart chart{
      .title = "Sorting point records in memory and on disk", .note = kSortReading, .columns = 2};
  for (const char* name : kSortPanels) add_panel(chart, panel_of(rows, name));
  return {.name = "sort",
          .title = "Sorting point records in memory and on disk",
          .reading = kSortReading,
          .runs = runs,
          .tables = {tabulate<SortRow>(
              {.name = "rows", .title = "Place of the records", .group = "panel"}, columns_of(rows),
              rows)},
          .figures = {{.chart = chart}}};
}

Experiment make_sort_experiment() {
  const auto options = std::make_shared<SortBenchOptions>();
  const auto declare = [options](Declaration& d) {
    d.points(
        options->points,
        "Records, in place of 1M, 5M and 20M; repeatable; more than 20M are sorted only on disk",
        {200'000, 1'000'000});
    d.words("--order", options->orders,
            "Sort only records that come in this order of keys; repeatable");
    d.words("--panel", options->panels, "Sort only in this place; repeatable");
    d.repeats(options->repeats, 3);
  };
  return {.name = "sort",
          .purpose =
              "Time and bytes of the external sort compared with the disk alone, and of its core "
              "compared with std::sort and oneTBB",
          .quick = "Under a minute on two cores: 200k and 1M points, 3 runs",
          .declare = declare,
          .run = [options](const Bench& b) { return measure_rows(measure_sort, *options, b); }};
}

}  // namespace ptc::bench
