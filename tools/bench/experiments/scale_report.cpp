#include "tools/bench/experiments/scale_report.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "tools/bench/report/report_files.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr char kReading[] =
    "The procedural city under one memory cap; medians of all runs. build: generated, sorted, "
    "built into a container. verify: "
    "every byte read and checked (level 2). shade: occlusion and bleeding of some of its points, "
    "evenly spread, beside them the "
    "share of page lookups that hit; these two with the file out of the system's cache. Dashed, "
    "the limits: the same disk moving "
    "the bytes of build and verify with nothing done to them, past the system's cache; one thread "
    "copying the records once.\n";

double each_ns(double seconds, const ScaleRow& row) {
  return 1e9 * seconds / static_cast<double>(row.items());
}

double hit_rate(const ScaleRow& row) {
  const auto lookups = static_cast<double>(row.hits + row.misses);
  return lookups > 0 ? static_cast<double>(row.hits) / lookups : kNone;
}

double floor_share(const std::vector<ScaleRow>& rows, const ScaleRow& row) {
  const auto found = std::ranges::find_if(rows, [&](const ScaleRow& r) {
    return r.points == row.points && r.stage == row.stage + " floor";
  });
  return found == rows.end() ? kNone : found->wall.median / row.wall.median;
}

double mebibytes(std::uint64_t bytes) {
  return static_cast<double>(bytes) / 1048576;
}

double per_point(std::uint64_t bytes, const ScaleRow& row) {
  return static_cast<double>(bytes) / static_cast<double>(row.points);
}

Json row_facts(const std::vector<ScaleRow>& rows, const ScaleRow& row) {
  const auto only = [&](const char* stage, const Json& value) {
    return row.stage == stage ? value : Json(nullptr);
  };
  Json facts{{"stage", row.stage},
             {"points", row.points},
             {"receivers", only("shade", row.receivers)},
             {"threads", row.threads},
             {"memory_bytes", row.memory_bytes},
             {"wall_ns_each", each_ns(row.wall.median, row)}};
  facts.update(time_facts(row.wall, row.cpu, row.items()));
  facts.update(Json{{"resident_bytes", row.resident_bytes},
                    {"moved_bytes", row.moved_bytes},
                    {"disk_bytes", row.disk_bytes},
                    {"spilled_bytes", only("build", row.spilled_bytes)},
                    {"file_bytes", only("build", row.file_bytes)},
                    {"nodes", only("build", row.nodes)},
                    {"bytes_per_point", only("build", row.bytes_per_point)},
                    {"bytes_per_node", only("build", row.bytes_per_node)},
                    {"rebuilt", only("verify", row.rebuilt)},
                    {"hits", only("shade", row.hits)},
                    {"misses", only("shade", row.misses)},
                    {"hit_rate", number(hit_rate(row))},
                    {"cap_share", only("shade", row.cap_share)},
                    {"floor_share", number(floor_share(rows, row))}});
  return facts;
}

Json law_facts(const ScaleLaw& law) {
  return {{"stage", law.stage},
          {"time_exponent", number(law.time_exponent)},
          {"resident_exponent", number(law.resident_exponent)},
          {"predicted_points", kPredictedPoints},
          {"predicted_seconds", number(law.predicted_seconds)},
          {"time_ratio", number(law.time_ratio)},
          {"resident_ratio", number(law.resident_ratio)}};
}

ScaleLaw law_of(const std::vector<ScaleRow>& rows, const char* stage) {
  std::vector<const ScaleRow*> sizes;
  for (const ScaleRow& row : rows) {
    if (row.stage == stage) sizes.push_back(&row);
  }
  std::vector<std::pair<double, double>> times, residents;
  for (const ScaleRow* row : sizes) {
    times.emplace_back(row->points, row->wall.median);
    residents.emplace_back(row->points, row->resident_bytes);
  }
  const PowerLaw time = fit_power_law(times);
  ScaleLaw law{.stage = stage,
               .time_exponent = time.exponent,
               .resident_exponent = fit_power_law(residents).exponent,
               .predicted_seconds = kNone,
               .time_ratio = kNone,
               .resident_ratio = kNone};
  const ScaleRow& greatest = *sizes.back();
  if (greatest.points < kPredictedPoints)
    law.predicted_seconds = time.at(static_cast<double>(kPredictedPoints));
  const auto least =
      std::ranges::find_if(sizes, [](const ScaleRow* row) { return row->points >= kLargePoints; });
  if (least == sizes.end() || (*least)->points == greatest.points) return law;
  law.time_ratio =
      each_ns(greatest.wall.median, greatest) / each_ns((*least)->wall.median, **least);
  law.resident_ratio =
      static_cast<double>(greatest.resident_bytes) / static_cast<double>((*least)->resident_bytes);
  return law;
}

std::string law_text(const std::vector<ScaleRow>& rows) {
  std::string text =
      fmt::format("{:<12} {:>14} {:>14} {:>16} {:>14} {:>14}\n", "law", "time ~ points^",
                  "MiB ~ points^", "s at 1.7 billion", "x time each", "x MiB");
  for (const ScaleLaw& law : laws_of(rows)) {
    text +=
        fmt::format("{:<12} {:>14} {:>14} {:>16} {:>14} {:>14}\n", law.stage,
                    or_dash(law.time_exponent, "{:.3f}"), or_dash(law.resident_exponent, "{:.3f}"),
                    or_dash(law.predicted_seconds, "{:.0f}"), or_dash(law.time_ratio, "{:.3f}"),
                    or_dash(law.resident_ratio, "{:.3f}"));
  }
  return text + "x: of the greatest size over that of the least of 20 million or more\n";
}

void add_point(ChartPanel& panel, const std::string& name, bool dashed, const ScaleRow& row,
               double y, const std::string& label = {}) {
  series_of(panel, name, dashed)
      .points.push_back({.x = static_cast<double>(row.points), .y = y, .label = label});
}

}  // namespace

double PowerLaw::at(double x) const {
  return factor * std::pow(x, exponent);
}

PowerLaw fit_power_law(const std::vector<std::pair<double, double>>& points) {
  const auto count = static_cast<double>(points.size());
  double mean_x = 0, mean_y = 0;
  for (const auto& [x, y] : points) {
    mean_x += std::log(x) / count;
    mean_y += std::log(y) / count;
  }
  double xx = 0, xy = 0;
  for (const auto& [x, y] : points) {
    xx += (std::log(x) - mean_x) * (std::log(x) - mean_x);
    xy += (std::log(x) - mean_x) * (std::log(y) - mean_y);
  }
  const bool equal = std::ranges::all_of(
      points, [&](const auto& point) { return point.first == points.front().first; });
  if (equal) return {kNone, kNone};
  return {std::exp(mean_y - xy / xx * mean_x), xy / xx};
}

std::vector<ScaleLaw> laws_of(const std::vector<ScaleRow>& rows) {
  return {law_of(rows, "build"), law_of(rows, "verify"), law_of(rows, "shade")};
}

Json facts_of(const std::vector<ScaleRow>& rows) {
  Json list = Json::array(), laws = Json::array();
  for (const ScaleRow& row : rows) list.push_back(row_facts(rows, row));
  for (const ScaleLaw& law : laws_of(rows)) laws.push_back(law_facts(law));
  return {{"rows", list}, {"laws", laws}};
}

Chart chart_of(const std::vector<ScaleRow>& rows) {
  ChartPanel time{
      .title = "Time of a point", .x_label = "points", .y_label = "wall time per point, ns"};
  ChartPanel shade{
      .title = "Time of a receiver", .x_label = "points", .y_label = "wall time per receiver, us"};
  ChartPanel memory{.title = "Memory", .x_label = "points", .y_label = "most resident, MiB"};
  ChartPanel bytes{.title = "Bytes", .x_label = "points", .y_label = "bytes per point"};
  memory.limits.push_back({.y = mebibytes(rows.front().memory_bytes), .label = "cap"});
  for (const ScaleRow& row : rows) {
    const bool limit = row.memory_bytes == 0;
    const double each = each_ns(row.wall.median, row);
    if (row.stage == "shade") {
      const double rate = hit_rate(row);
      add_point(shade, row.stage, false, row, each / 1000,
                std::isfinite(rate) ? fmt::format("{:.2f} % hits", 100 * rate) : "");
      add_point(bytes, "read by shade", false, row, per_point(row.moved_bytes, row));
    } else {
      add_point(time, row.stage, limit, row, each);
    }
    if (!limit) add_point(memory, row.stage, false, row, mebibytes(row.resident_bytes));
    if (row.stage != "build") continue;
    add_point(bytes, "moved by build", false, row, per_point(row.moved_bytes, row));
    add_point(bytes, "container", false, row, per_point(row.file_bytes, row));
  }
  return {.title = "From a city to shaded receivers",
          .note = kReading,
          .panels = {time, shade, memory, bytes},
          .columns = 2};
}

void write_reports(const std::filesystem::path& directory, const std::vector<ScaleRow>& rows) {
  write_tables(directory / "scale", facts_of(rows));
  write_figures(directory / "scale", chart_of(rows));
}

std::string scale_text(const std::vector<ScaleRow>& rows) {
  std::string text = fmt::format(
      "{:<12} {:>10} {:>3} {:>9} {:>20} {:>9} {:>9} {:>6} {:>9} {:>9} {:>8} {:>8} {:>6} {:>8} "
      "{:>9} {:>7}\n",
      "stage", "points", "thr", "wall s", "[low, high]", "ns each", "cpu ns", "MiB", "moved GB",
      "disk GB", "B/point", "B/node", "cap %", "hit %", "misses", "floor %");
  for (const ScaleRow& row : rows) {
    const bool build = row.stage == "build", shade = row.stage == "shade";
    text += fmt::format(
        "{:<12} {:>10} {:>3} {:>9.3f} {:>20} {:>9.1f} {:>9.1f} {:>6.0f} {:>9.3f} {:>9.3f} {:>8} "
        "{:>8} {:>6} {:>8} {:>9} {:>7}\n",
        row.stage, row.points, row.threads, row.wall.median,
        fmt::format("[{:.3f}, {:.3f}]", row.wall.low, row.wall.high), each_ns(row.wall.median, row),
        each_ns(row.cpu.median, row), mebibytes(row.resident_bytes),
        static_cast<double>(row.moved_bytes) / 1e9, static_cast<double>(row.disk_bytes) / 1e9,
        or_dash(build ? row.bytes_per_point : kNone, "{:.2f}"),
        or_dash(build ? row.bytes_per_node : kNone, "{:.2f}"),
        or_dash(shade ? 100 * row.cap_share : kNone, "{:.1f}"),
        or_dash(100 * hit_rate(row), "{:.2f}"), shade ? fmt::format("{}", row.misses) : "-",
        or_dash(100 * floor_share(rows, row), "{:.0f}"));
  }
  return text + '\n' + law_text(rows);
}

}  // namespace ptc::bench
