// The experiment `ptcbench scale`: its table columns, its laws, its charts and its options.
#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/scale_law.h"
#include "tools/parse.h"

namespace ptc::bench {
namespace {

constexpr char kScaleReading[] =
    "The procedural city at growing sizes under one memory cap. Stages: build generates, sorts and "
    "builds the city into a container; verify reads and checks every byte of it (level 2); shade "
    "computes occlusion and irradiance of some of its points, evenly spread. Verify and shade "
    "begin with the file out of the system's cache. Limits: build floor and verify floor are the "
    "same disk moving the bytes of build and verify, without any work on them, past the system's "
    "cache; memcpy is one thread that copies the records once. Item: a point, or a receiver for "
    "shade. Floor / stage is the floor's time as a share of the stage's. Moved bytes are read or "
    "written; for shade they are what the page cache read. Peak memory is what a stage adds to the "
    "program. All runs of a size gave the same container and the same finite values.";

/// The factor from seconds of a run to nanoseconds per item.
double each_ns(const ScaleRow& row) {
  return 1e9 / static_cast<double>(row.items());
}

double hit_rate(const ScaleRow& row) {
  const auto lookups = static_cast<double>(row.hits + row.misses);
  return lookups > 0 ? static_cast<double>(row.hits) / lookups : kNone;
}

/// The time of a stage's floor over the time of the stage; NaN for stages without a floor.
double floor_share(const std::vector<ScaleRow>& rows, const ScaleRow& row) {
  const auto found = std::ranges::find_if(rows, [&](const ScaleRow& r) {
    return r.points == row.points && r.stage == row.stage + " floor";
  });
  return found == rows.end() ? kNone : found->wall.median / row.wall.median;
}

Columns<ScaleRow> columns_of(const std::vector<ScaleRow>& rows) {
  using R = ScaleRow;
  const auto only = [](const char* stage, auto member) {
    return [stage, member](const R& r) { return when(r.stage == stage, r.*member); };
  };
  return {{"stage", {"stage"}, &R::stage},
          {"points", {"points"}, &R::points},
          {"receivers", {"receivers"}, only("shade", &R::receivers)},
          {"threads", {"threads"}, &R::threads},
          {"memory_bytes",
           {"cap MiB", "{:.0f}", kMebi},
           [](const R& r) { return when(r.memory_bytes > 0, r.memory_bytes); }},
          {"wall_seconds", {"wall s", "{:.3f}"}, &R::wall},
          {"wall_ns_each",
           {"wall ns/item", "{:.1f}"},
           [](const R& r) { return each_ns(r) * r.wall.median; }},
          {"cpu_ns_each",
           {"CPU ns/item", "{:.1f}"},
           [](const R& r) { return scaled(r.cpu, each_ns(r)); }},
          {"resident_bytes", {"peak memory MiB", "{:.0f}", kMebi}, &R::resident_bytes},
          {"moved_bytes", {"moved GB", "{:.3f}", kGiga}, &R::moved_bytes},
          {"disk_bytes", {"read from disk GB", "{:.3f}", kGiga}, &R::disk_bytes},
          {"spilled_bytes", {"spilled GB", "{:.2f}", kGiga}, only("build", &R::spilled_bytes)},
          {"file_bytes", {"file GB", "{:.2f}", kGiga}, only("build", &R::file_bytes)},
          {"nodes", {"nodes"}, only("build", &R::nodes)},
          {"bytes_per_point", {"stored bytes/point", "{:.2f}"}, only("build", &R::bytes_per_point)},
          {"bytes_per_node", {"stored bytes/node", "{:.2f}"}, only("build", &R::bytes_per_node)},
          {"rebuilt", {"tree rebuilt (level 4)"}, only("verify", &R::rebuilt)},
          {"cap_share", percent("frames / pages %", "{:.1f}"), only("shade", &R::cap_share)},
          {"hits", {}, only("shade", &R::hits)},
          {"hit_rate", percent("hits %"), hit_rate},
          {"misses", {"misses"}, only("shade", &R::misses)},
          {"floor_share", percent("floor / stage %", "{:.0f}"),
           [&rows](const R& r) { return floor_share(rows, r); }}};
}

const Columns<ScaleLaw>& law_columns() {
  using R = ScaleLaw;
  static const Columns<R> columns{
      {"stage", {"stage"}, &R::stage},
      {"time_exponent", {"time grows as points to the power", "{:.3f}"}, &R::time_exponent},
      {"resident_exponent",
       {"peak memory grows as points to the power", "{:.3f}"},
       &R::resident_exponent},
      {"predicted_points", {}, [](const ScaleLaw&) { return kPredictedPoints; }},
      {"predicted_seconds",
       {"predicted wall s at 1.7 billion points", "{:.0f}"},
       &R::predicted_seconds},
      {"time_ratio", {"ratio of time/item", "{:.3f}"}, &R::time_ratio},
      {"resident_ratio", {"ratio of peak memory", "{:.3f}"}, &R::resident_ratio}};
  return columns;
}

/// Fits the law of one stage to the rows of all sizes.
ScaleLaw law_of(const std::vector<ScaleRow>& rows, const char* stage) {
  // Collect time and memory of all sizes
  std::vector<const ScaleRow*> sizes;
  for (const ScaleRow& row : rows) {
    if (row.stage == stage) sizes.push_back(&row);
  }
  std::vector<std::pair<double, double>> times, residents;
  for (const ScaleRow* row : sizes) {
    times.emplace_back(row->points, row->wall.median);
    residents.emplace_back(row->points, row->resident_bytes);
  }
  // Fit the power laws, and predict the time of a size that was not measured
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
  // Compare the largest size with the smallest large one
  const auto least =
      std::ranges::find_if(sizes, [](const ScaleRow* row) { return row->points >= kLargePoints; });
  if (least == sizes.end() || (*least)->points == greatest.points) return law;
  law.time_ratio =
      each_ns(greatest) * greatest.wall.median / (each_ns(**least) * (*least)->wall.median);
  law.resident_ratio =
      static_cast<double>(greatest.resident_bytes) / static_cast<double>((*least)->resident_bytes);
  return law;
}

void add_point(ChartPanel& panel, const std::string& name, bool dashed, const ScaleRow& row,
               double y, const std::string& label = {}) {
  series_of(panel, name, dashed)
      .points.push_back({.x = static_cast<double>(row.points), .y = y, .label = label});
}

/// Makes the chart: time per point, time per receiver, memory, bytes.
Chart chart_of(const std::vector<ScaleRow>& rows) {
  ChartPanel time{.title = "Time per point: build, verify and their limits",
                  .x_label = "points",
                  .y_label = "wall time per point, ns"};
  ChartPanel shade{.title = "Time per receiver: shade",
                   .x_label = "points",
                   .y_label = "wall time per receiver, \u00b5s"};
  ChartPanel memory{.title = "Peak memory", .x_label = "points", .y_label = "peak memory, MiB"};
  ChartPanel bytes{
      .title = "Bytes moved and stored", .x_label = "points", .y_label = "bytes per point"};
  memory.limits.push_back({.y = mebibytes(rows.front().memory_bytes), .label = "cap"});
  const auto per_point = [](std::uint64_t count, const ScaleRow& row) {
    return static_cast<double>(count) / static_cast<double>(row.points);
  };
  for (const ScaleRow& row : rows) {
    const bool limit = row.memory_bytes == 0;
    const double each = each_ns(row) * row.wall.median;
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
  return {.title = "From a procedural city to shaded receivers at growing sizes",
          .note = kScaleReading,
          .panels = {time, shade, memory, bytes},
          .columns = 2};
}

}  // namespace

std::vector<ScaleLaw> laws_of(const std::vector<ScaleRow>& rows) {
  return {law_of(rows, "build"), law_of(rows, "verify"), law_of(rows, "shade")};
}

Report report_of(const std::vector<ScaleRow>& rows, unsigned runs) {
  const std::vector<ScaleLaw> laws = laws_of(rows);
  return {
      .name = "scale",
      .title = "From a procedural city to shaded receivers at growing sizes",
      .reading = kScaleReading,
      .runs = runs,
      .tables = {tabulate<ScaleRow>({.name = "rows"}, columns_of(rows), rows),
                 tabulate<ScaleLaw>(
                     {.name = "laws", .title = "Power laws by which the stages grow with points"},
                     law_columns(), laws)},
      .notes = {"A ratio compares the largest size with the smallest one of at least 20 million "
                "points; there is none where fewer than two such sizes were measured."},
      .figures = {{.chart = chart_of(rows)}}};
}

Experiment make_scale_experiment() {
  const auto options = std::make_shared<ScaleOptions>();
  const auto declare = [options](Declaration& d) {
    d.points(options->points,
             "Points of the city, in place of 1M, 5M and 20M; repeatable; 1000 or more",
             {200'000, 1'000'000});
    d.count("--receivers", options->receivers, "Receivers among these points, spread evenly",
            "100k");
    d.quick("--receivers", options->receivers, 8'000);
    d.repeats(options->repeats, 2);
  };
  const auto check = [options] {
    const std::uint64_t least = options->points.front();
    if (least < 1000) refuse("--points", std::to_string(least), "1000 or more");
  };
  return {
      .name = "scale",
      .purpose =
          "From a procedural city to shaded receivers under one memory cap: time, bytes, memory "
          "and cache hits of build, verification and shading at growing sizes, and the power "
          "laws by which they grow",
      .quick = "Under a minute on two cores: 200k and 1M points, 8k receivers, 2 runs",
      .declare = declare,
      .run = [options](const Bench& b) { return measure_rows(measure_scale, *options, b); },
      .check = check};
}

}  // namespace ptc::bench
