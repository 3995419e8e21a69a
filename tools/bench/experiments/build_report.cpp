#include "tools/bench/experiments/build_report.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "tools/bench/report/report_files.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kReading[] =
    "City, from a file of unsorted records of 40 bytes to a published container; medians of all "
    "runs, input and spilled records past the "
    "system's cache. compact: zstd, fast: LZ4. The floor is the time in which the same disk moves "
    "the bytes of the first of them with "
    "nothing done to them: input read, what is spilled written and read, as much as the container "
    "written.\n";

double ns(double seconds, const BuildRow& row) {
  return 1e9 * seconds / static_cast<double>(row.points);
}

double floor_share(const std::vector<BuildRow>& rows, const BuildRow& row) {
  if (row.method == "floor") return std::nan("");
  const auto from =
      rows.begin() + (&row - rows.data());  // the floor follows the methods of its size and cap
  const auto found = std::ranges::find(from, rows.end(), "floor", &BuildRow::method);
  return found == rows.end() ? std::nan("") : found->wall.median / row.wall.median;
}

double moved_share(const BuildRow& row) {
  return static_cast<double>(row.moved_bytes) / static_cast<double>(row.input_bytes);
}

Json row_facts(const std::vector<BuildRow>& rows, const BuildRow& row) {
  Json facts{{"panel", row.panel},
             {"method", row.method},
             {"points", row.points},
             {"threads", row.threads},
             {"memory_bytes", row.memory_bytes}};
  facts.update(time_facts(row.wall, row.cpu, row.points));
  facts.update(Json{{"input_bytes", row.input_bytes},
                    {"moved_bytes", row.moved_bytes},
                    {"moved_share", moved_share(row)},
                    {"resident_bytes", row.resident_bytes},
                    {"nodes", row.nodes},
                    {"bytes_per_point", row.bytes_per_point},
                    {"bytes_per_node", row.bytes_per_node},
                    {"floor_share", number(floor_share(rows, row))}});
  return facts;
}

double mebibytes(std::uint64_t bytes) {
  return static_cast<double>(bytes) / 1048576;
}

/// A line for each method of a panel; over points or, of the panel "cap", over the cap.
/// @param floor  whether it has a line
ChartPanel panel_of(const std::vector<BuildRow>& rows, const std::string& name, const char* title,
                    const char* y_label, bool floor, double (*value)(const BuildRow&)) {
  const bool caps = name == "cap";
  ChartPanel panel{
      .title = title, .x_label = caps ? "memory cap, MiB" : "points", .y_label = y_label};
  for (const BuildRow& row : rows) {
    if (row.panel != name || (row.method == "floor" && !floor)) continue;
    const double x = caps ? mebibytes(row.memory_bytes) : static_cast<double>(row.points);
    series_of(panel, row.method, row.method == "floor").points.push_back({.x = x, .y = value(row)});
  }
  return panel;
}

}  // namespace

Json facts_of(const std::vector<BuildRow>& rows) {
  Json list = Json::array();
  for (const BuildRow& row : rows) list.push_back(row_facts(rows, row));
  return {{"rows", list}};
}

Chart chart_of(const std::vector<BuildRow>& rows) {
  Chart chart{.title = "Sort and build", .note = kReading, .columns = 2};
  const auto wall = [](const BuildRow& row) { return ns(row.wall.median, row); };
  const auto add = [&](const char* panel, const char* title, const char* y_label, bool floor,
                       double (*value)(const BuildRow&)) {
    ChartPanel drawn = panel_of(rows, panel, title, y_label, floor, value);
    if (!drawn.series.empty()) chart.panels.push_back(std::move(drawn));
  };
  add("points", "Time and size", "wall time per point, ns", true, wall);
  add("points", "Bytes and size", "bytes moved per point", false, [](const BuildRow& row) {
    return static_cast<double>(row.moved_bytes) / static_cast<double>(row.points);
  });
  add("cap", "Time and memory", "wall time per point, ns", false, wall);
  add("cap", "Memory", "most resident, MiB", false,
      [](const BuildRow& row) { return mebibytes(row.resident_bytes); });
  return chart;
}

void write_reports(const std::filesystem::path& directory, const std::vector<BuildRow>& rows) {
  write_tables(directory / "build", facts_of(rows));
  write_figures(directory / "build", chart_of(rows));
}

std::string build_text(const std::vector<BuildRow>& rows) {
  std::string text = fmt::format(
      "{:<7} {:<8} {:>10} {:>3} {:>8} {:>8} {:>18} {:>8} {:>9} {:>7} {:>8} {:>8} {:>8} {:>8}\n",
      "panel", "method", "points", "thr", "cap MiB", "wall s", "[low, high]", "cpu ns", "moved GB",
      "x input", "MiB", "B/point", "B/node", "floor %");
  for (const BuildRow& row : rows) {
    text += fmt::format(
        "{:<7} {:<8} {:>10} {:>3} {:>8.0f} {:>8.3f} {:>18} {:>8.1f} {:>9.2f} {:>7.2f} {:>8.0f} "
        "{:>8.2f} {:>8.2f} {:>8}\n",
        row.panel, row.method, row.points, row.threads, mebibytes(row.memory_bytes),
        row.wall.median, fmt::format("[{:.3f}, {:.3f}]", row.wall.low, row.wall.high),
        ns(row.cpu.median, row), static_cast<double>(row.moved_bytes) / 1e9, moved_share(row),
        mebibytes(row.resident_bytes), row.bytes_per_point, row.bytes_per_node,
        or_dash(100 * floor_share(rows, row), "{:.0f}"));
  }
  return text;
}

}  // namespace ptc::bench
