#include "tools/bench/experiments/sort_report.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "tools/bench/report/report_files.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kReading[] =
    "Records of 40 bytes; medians of all runs. In memory: CPU time, all threads together; tbb is "
    "its parallel_sort, which like "
    "std::sort is not stable. On disk: wall time from an input file of records to an output file, "
    "under the memory cap; the floor "
    "is the time in which the same disk reads and writes these bytes twice, four blocks of 4 MB "
    "under way at once. Both go past the "
    "system's cache.\n";

double ns(double seconds, const SortRow& row) {
  return 1e9 * seconds / static_cast<double>(std::max<std::uint64_t>(1, row.points));
}

/// The row of another method beside it.
const SortRow* beside(const std::vector<SortRow>& rows, const SortRow& row, const char* method) {
  const auto found = std::ranges::find_if(rows, [&](const SortRow& r) {
    return r.panel == row.panel && r.order == row.order && r.points == row.points &&
           r.method == method;
  });
  return found == rows.end() ? nullptr : &*found;
}

double floor_share(const std::vector<SortRow>& rows, const SortRow& row) {
  const SortRow* floor = beside(rows, row, "floor");
  return floor && row.method == "ptcx" ? floor->wall.median / row.wall.median : std::nan("");
}

double speedup(const std::vector<SortRow>& rows, const SortRow& row) {
  const SortRow* other = beside(rows, row, "std::sort");
  return other && row.method != "memcpy" ? other->cpu.median / row.cpu.median : std::nan("");
}

Json row_facts(const std::vector<SortRow>& rows, const SortRow& row) {
  Json facts{{"panel", row.panel},   {"order", row.order},     {"method", row.method},
             {"points", row.points}, {"threads", row.threads}, {"memory_bytes", row.memory_bytes}};
  facts.update(time_facts(row.wall, row.cpu, row.points));
  facts.update(Json{{"moved_bytes", row.moved_bytes},
                    {"resident_bytes", row.resident_bytes},
                    {"floor_share", number(floor_share(rows, row))},
                    {"speedup", number(speedup(rows, row))}});
  return facts;
}

/// A line for each order and method of a panel.
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
    series.points.push_back({.x = static_cast<double>(row.points),
                             .y = ns(disk ? row.wall.median : row.cpu.median, row),
                             .label = std::isfinite(share)
                                          ? fmt::format("{:.0f} % of the floor's rate", 100 * share)
                                          : std::string()});
  }
  return panel;
}

}  // namespace

Json facts_of(const std::vector<SortRow>& rows) {
  Json list = Json::array();
  for (const SortRow& row : rows) list.push_back(row_facts(rows, row));
  return {{"rows", list}};
}

Chart chart_of(const std::vector<SortRow>& rows) {
  Chart chart{.title = "Sorting point records", .note = kReading, .columns = 2};
  for (const char* name : kSortPanels) {
    ChartPanel panel = panel_of(rows, name);
    if (!panel.series.empty()) chart.panels.push_back(std::move(panel));
  }
  return chart;
}

void write_reports(const std::filesystem::path& directory, const std::vector<SortRow>& rows) {
  write_tables(directory / "sort", facts_of(rows));
  write_figures(directory / "sort", chart_of(rows));
}

std::string sort_text(const std::vector<SortRow>& rows) {
  std::string text =
      fmt::format("{:<7} {:<9} {:<9} {:>10} {:>3} {:>8} {:>18} {:>8} {:>9} {:>8} {:>7} {:>7}\n",
                  "panel", "order", "method", "records", "thr", "wall s", "[low, high]", "cpu ns",
                  "moved GB", "MiB", "floor %", "x sort");
  for (const SortRow& row : rows) {
    text += fmt::format(
        "{:<7} {:<9} {:<9} {:>10} {:>3} {:>8.3f} {:>18} {:>8.1f} {:>9.2f} {:>8.0f} {:>7} {:>7}\n",
        row.panel, row.order, row.method, row.points, row.threads, row.wall.median,
        fmt::format("[{:.3f}, {:.3f}]", row.wall.low, row.wall.high), ns(row.cpu.median, row),
        static_cast<double>(row.moved_bytes) / 1e9,
        static_cast<double>(row.resident_bytes) / 1048576,
        or_dash(100 * floor_share(rows, row), "{:.0f}"), or_dash(speedup(rows, row), "{:.2f}"));
  }
  return text;
}

}  // namespace ptc::bench
