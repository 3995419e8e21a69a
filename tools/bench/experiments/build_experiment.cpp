#include <algorithm>

#include "tools/bench/experiments/build_bench.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/values.h"

namespace ptc::bench {
namespace {

constexpr char kReading[] =
    "The city, from a file of unsorted records of 40 bytes to a published container. Input and "
    "spilled records go past the system's cache. Profiles: compact is zstd, fast is LZ4. The "
    "floor is the time in which the same disk moves the bytes of the first profile with nothing "
    "done to them: the input is read, what is spilled is written and read, and as much as the "
    "container has is written; floor % is that time over the build's. Every container was "
    "verified, and is the same under every cap.";

double per_point_ns(double seconds, const BuildRow& row) {
  return 1e9 * seconds / static_cast<double>(row.points);
}

double moved_share(const BuildRow& row) {
  return static_cast<double>(row.moved_bytes) / static_cast<double>(row.input_bytes);
}

/// The floor follows the methods of its size and cap.
double floor_share(const std::vector<BuildRow>& rows, const BuildRow& row) {
  if (row.method == "floor") return kNone;
  const auto from = rows.begin() + (&row - rows.data());
  const auto found = std::ranges::find(from, rows.end(), "floor", &BuildRow::method);
  return found == rows.end() ? kNone : found->wall.median / row.wall.median;
}

Columns<BuildRow> columns_of(const std::vector<BuildRow>& rows) {
  using R = BuildRow;
  const auto of_build = [](auto member) {
    return [member](const R& r) { return when(r.method != "floor", r.*member); };
  };
  return {{"panel", {"over"}, &R::panel},
          {"method", {"profile"}, &R::method},
          {"points", {"points"}, &R::points},
          {"threads", {"threads"}, &R::threads},
          {"memory_bytes", {"cap MiB", "{:.0f}", kMebi}, of_build(&R::memory_bytes)},
          {"wall_seconds", {"wall s", "{:.3f}"}, &R::wall},
          {"cpu_ns_per_point",
           {"CPU ns a point", "{:.1f}"},
           [](const R& r) { return scaled(r.cpu, per_point_ns(1, r)); }},
          {"input_bytes", {}, &R::input_bytes},
          {"moved_bytes", {"moved GB", "{:.2f}", kGiga}, &R::moved_bytes},
          {"moved_share", {"of the input", "{:.2f}"}, moved_share},
          {"resident_bytes", {"peak MiB", "{:.0f}", kMebi}, &R::resident_bytes},
          {"nodes", {"nodes"}, of_build(&R::nodes)},
          {"bytes_per_point", {"bytes a point", "{:.2f}"}, of_build(&R::bytes_per_point)},
          {"bytes_per_node", {"bytes a node", "{:.2f}"}, of_build(&R::bytes_per_node)},
          {"floor_share", percent("floor %", "{:.0f}"),
           [&rows](const R& r) { return floor_share(rows, r); }}};
}

double mebibytes(std::uint64_t bytes) {
  return static_cast<double>(bytes) / kMebi;
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

Chart chart_of(const std::vector<BuildRow>& rows) {
  Chart chart{.title = "Sort and build", .note = kReading, .columns = 2};
  const auto wall = [](const BuildRow& row) { return per_point_ns(row.wall.median, row); };
  const auto moved = [](const BuildRow& row) {
    return static_cast<double>(row.moved_bytes) / static_cast<double>(row.points);
  };
  const auto peak = [](const BuildRow& row) { return mebibytes(row.resident_bytes); };
  constexpr char kWall[] = "wall time per point, ns";
  add_panel(chart, panel_of(rows, "points", "Time and size", kWall, true, wall));
  add_panel(chart,
            panel_of(rows, "points", "Bytes and size", "bytes moved per point", false, moved));
  add_panel(chart, panel_of(rows, "cap", "Time and memory", kWall, false, wall));
  add_panel(chart, panel_of(rows, "cap", "Memory", "most resident, MiB", false, peak));
  return chart;
}

}  // namespace

Report report_of(const std::vector<BuildRow>& rows, unsigned runs) {
  return {.name = "build",
          .title = "Sort and build",
          .reading = kReading,
          .runs = runs,
          .tables = {tabulate<BuildRow>({.name = "rows", .title = "Over", .group = "panel"},
                                        columns_of(rows), rows)},
          .figures = {{.chart = chart_of(rows)}}};
}

Experiment make_build_experiment() {
  const auto options = std::make_shared<BuildBenchOptions>();
  const auto declare = [options](Declaration& d) {
    d.points(options->points, "Points of the city, in place of 1M, 5M and 20M; repeatable",
             {200'000, 1'000'000});
    const auto parse = [](const std::string& text) { return parse_size("--cap", text); };
    d.list("--cap", "SIZE", options->caps, parse,
           "Build the most points under this cap, not under 128M to 2G; repeatable");
    d.quick("--cap", options->caps, {96ULL << 20, 192ULL << 20});
    d.words("--profile", options->profiles, "Build in this profile, not both; repeatable");
    d.words("--panel", options->panels, "Measure this, not both; repeatable");
    d.repeats(options->repeats, 3);
  };
  return {.name = "build",
          .purpose =
              "Time, bytes and memory of sort and build, over points and over the cap, "
              "beside a disk that moves the same bytes",
          .quick = "Under a minute on two cores: 200k and 1M points, 3 runs",
          .declare = declare,
          .run = [options](const Bench& b) { return measure_rows(measure_build, *options, b); }};
}

}  // namespace ptc::bench
