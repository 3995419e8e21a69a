#include "tools/bench/experiments/cache_report.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "tools/bench/report/report_files.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kReading[] =
    "City, blocks of neighbours among its points, occlusion and bleeding; each run with an empty "
    "cache, and the file out of "
    "the system's. A cap is a share of the pages that have a frame. All runs over a scene in one "
    "order gave the same values "
    "to the last bit. Waiting: for a page's bytes, or for another thread that reads it.\n";

double ns(double seconds, const CacheRow& row) {
  return 1e9 * seconds / static_cast<double>(row.receivers);
}

double in_core_share(const std::vector<CacheRow>& rows, const CacheRow& row) {
  const auto whole = std::ranges::find_if(rows, [&](const CacheRow& r) {
    return r.panel == row.panel && r.method == row.method && r.threads == row.threads && r.cap == 1;
  });
  return whole == rows.end() || row.panel == "hits" ? std::nan("")
                                                    : row.wall.median / whole->wall.median;
}

Json row_facts(const std::vector<CacheRow>& rows, const CacheRow& row) {
  Json facts{{"panel", row.panel}, {"method", row.method}, {"threads", row.threads},
             {"cap", row.cap},     {"frames", row.frames}, {"receivers", row.receivers}};
  facts.update(time_facts(row.wall, row.cpu, row.receivers));
  facts.update(Json{{"wait_seconds", number(row.wait.median)},
                    {"wait_low", number(row.wait.low)},
                    {"wait_high", number(row.wait.high)},
                    {"hit_rate", row.hit_rate},
                    {"pages", number(row.pages)},
                    {"bytes", number(row.bytes)},
                    {"disk_bytes", number(row.disk_bytes)},
                    {"in_core_share", number(in_core_share(rows, row))}});
  return facts;
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

}  // namespace

Json facts_of(const std::vector<CacheRow>& rows) {
  Json list = Json::array();
  for (const CacheRow& row : rows) list.push_back(row_facts(rows, row));
  return {{"rows", list}};
}

Chart chart_of(const std::vector<CacheRow>& rows) {
  Chart chart{.title = "Page cache", .note = kReading, .columns = 3};
  const auto wall = [](const CacheRow& row) { return ns(row.wall.median, row) / 1000; };
  const auto missed = [](const CacheRow& row) { return 100 * (1 - row.hit_rate); };
  const auto bytes = [](const CacheRow& row) { return row.bytes; };
  const auto add = [&](const char* panel, const char* title, const char* y_label,
                       double (*value)(const CacheRow&)) {
    ChartPanel drawn = panel_of(rows, panel, title, y_label, value);
    if (!drawn.series.empty()) chart.panels.push_back(std::move(drawn));
  };
  add("back-end", "Time and cap, by back end", "wall time per receiver, us", wall);
  add("back-end", "Misses and cap", "lookups that miss, %", missed);
  add("back-end", "Waiting and cap", "waiting per receiver, us",
      [](const CacheRow& row) { return ns(row.wait.median, row) / 1000; });
  add("threads", "Threads, at a cap of 9 %", "bytes read per receiver", bytes);
  add("receivers", "Order of receivers", "bytes read per receiver", bytes);
  add("pages", "Order of node pages", "bytes read per receiver", bytes);
  add("sizes", "Size of pages", "wall time per receiver, us", wall);
  return chart;
}

void write_reports(const std::filesystem::path& directory, const std::vector<CacheRow>& rows) {
  write_tables(directory / "cache", facts_of(rows));
  const Chart chart = chart_of(rows);
  if (!chart.panels.empty()) write_figures(directory / "cache", chart);
}

std::string cache_text(const std::vector<CacheRow>& rows) {
  std::string text = fmt::format(
      "{:<9} {:<24} {:>3} {:>6} {:>7} {:>10} {:>22} {:>10} {:>8} {:>9} {:>9} {:>9} {:>8}\n",
      "panel", "method", "thr", "cap %", "frames", "wall ns", "[low, high]", "cpu ns", "wait ns",
      "hit %", "read B", "disk B", "in core");
  for (const CacheRow& row : rows) {
    const std::string range =
        fmt::format("[{:.1f}, {:.1f}]", ns(row.wall.low, row), ns(row.wall.high, row));
    text += fmt::format(
        "{:<9} {:<24} {:>3} {:>6.1f} {:>7} {:>10.1f} {:>22} {:>10.1f} {:>8} {:>9.4f} {:>9} {:>9} "
        "{:>8}\n",
        row.panel, row.method, row.threads, 100 * row.cap, row.frames, ns(row.wall.median, row),
        range, ns(row.cpu.median, row), or_dash(ns(row.wait.median, row), "{:.0f}"),
        100 * row.hit_rate, or_dash(row.bytes, "{:.0f}"), or_dash(row.disk_bytes, "{:.0f}"),
        or_dash(in_core_share(rows, row), "{:.2f}"));
  }
  return text;
}

}  // namespace ptc::bench
