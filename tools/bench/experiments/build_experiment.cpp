// The experiment `ptcbench build`: its table columns, its charts and its options.
#include <algorithm>

#include "tools/bench/experiments/build_bench.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/parse.h"

namespace ptc::bench {
namespace {

constexpr char kBuildReading[] =
    "Builds of the procedural city, from a file of unsorted records of 40 bytes to a published "
    "container. Input and spilled records go past the system's cache. Profiles: compact is zstd, "
    "fast is LZ4. The floor is the time in which the same disk moves the bytes of the first "
    "profile without any work on them: the input is read, the spilled bytes are written and read, "
    "and as many bytes as the container has are written. Floor / build is that time as a share of "
    "the build's. Moved bytes are read or written. Peak memory is the maximum of resident memory "
    "of the whole program during a run. "
    "Containers were verified, and are the same under every cap.";

/// Nanoseconds per point.
double per_point_ns(double seconds, const BuildRow& row) {
  return 1e9 * seconds / static_cast<double>(row.points);
}

/// Bytes moved over the bytes of the input.
double moved_share(const BuildRow& row) {
  return static_cast<double>(row.moved_bytes) / static_cast<double>(row.input_bytes);
}

/// The time of the floor over that of a row; the floor's row follows the rows of its size and cap.
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
  return {{"panel", {"varied"}, &R::panel},
          {"method", {"profile"}, &R::method},
          {"points", {"points"}, &R::points},
          {"threads", {"threads"}, &R::threads},
          {"memory_bytes", {"cap MiB", "{:.0f}", kMebi}, of_build(&R::memory_bytes)},
          {"wall_seconds", {"wall s", "{:.3f}"}, &R::wall},
          {"cpu_ns_per_point",
           {"CPU ns/point", "{:.1f}"},
           [](const R& r) { return scaled(r.cpu, per_point_ns(1, r)); }},
          {"input_bytes", {}, &R::input_bytes},
          {"moved_bytes", {"moved GB", "{:.2f}", kGiga}, &R::moved_bytes},
          {"moved_share", {"moved / input", "{:.2f}"}, moved_share},
          {"resident_bytes", {"peak memory MiB", "{:.0f}", kMebi}, &R::resident_bytes},
          {"nodes", {"nodes"}, of_build(&R::nodes)},
          {"bytes_per_point", {"stored bytes/point", "{:.2f}"}, of_build(&R::bytes_per_point)},
          {"bytes_per_node", {"stored bytes/node", "{:.2f}"}, of_build(&R::bytes_per_node)},
          {"floor_share", percent("floor / build %", "{:.0f}"),
           [&rows](const R& r) { return floor_share(rows, r); }}};
}

/// Makes a panel with a line for each method, over points or, for the panel "cap", over the cap.
/// @param floor  whether the floor has a line
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
  Chart chart{.title = "Build from unsorted records, compared with the disk alone",
              .note = kBuildReading,
              .columns = 2};
  const auto wall = [](const BuildRow& row) { return per_point_ns(row.wall.median, row); };
  const auto moved = [](const BuildRow& row) {
    return static_cast<double>(row.moved_bytes) / static_cast<double>(row.points);
  };
  const auto peak = [](const BuildRow& row) { return mebibytes(row.resident_bytes); };
  constexpr char kWall[] = "wall time per point, ns";
  add_panel(chart, panel_of(rows, "points", "Time against size", kWall, true, wall));
  add_panel(chart, panel_of(rows, "points", "Bytes moved against size", "bytes moved per point",
                            false, moved));
  add_panel(chart, panel_of(rows, "cap", "Time against memory cap", kWall, false, wall));
  add_panel(chart, panel_of(rows, "cap", "Peak memory against memory cap", "peak memory, MiB",
                            false, peak));
  return chart;
}

}  // namespace

Report report_of(const std::vector<BuildRow>& rows, unsigned runs) {
  return {.name = "build",
          .title = "Build from unsorted records, compared with the disk alone",
          .reading = kBuildReading,
          .runs = runs,
          .tables = {tabulate<BuildRow>({.name = "rows", .title = "Varied", .group = "panel"},
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
           "Build the largest city under this memory cap, in place of 128M to 2G; repeatable");
    d.quick("--cap", options->caps, {96ULL << 20, 192ULL << 20});
    d.words("--profile", options->profiles, "Build only in this profile; repeatable");
    d.words("--panel", options->panels, "Vary only the points, or only the memory cap; repeatable");
    d.repeats(options->repeats, 3);
  };
  return {
      .name = "build",
      .purpose =
          "Time, bytes and memory of a build from unsorted records, against points and against the "
          "memory cap, compared with a disk that moves the same bytes",
      .quick = "Under a minute on two cores: 200k and 1M points, 3 runs",
      .declare = declare,
      .run = [options](const Bench& b) { return measure_rows(measure_build, *options, b); }};
}

}  // namespace ptc::bench
