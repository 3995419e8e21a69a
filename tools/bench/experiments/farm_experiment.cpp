// The experiment `ptcbench farm`: its tables, its chart and its options.
#include <memory>
#include <string>

#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/farm_bench.h"
#include "tools/parse.h"

namespace ptc::bench {
namespace {

constexpr char kFarmReading[] =
    "A city built in one run, and by the tasks of a plan: routes, parts, a join. A smaller city is "
    "also lit by a sun and shaded with two bounces, the first of which is made of all points "
    "before. Workers: threads "
    "of the one run, or tasks of one thread at once. Overhead: CPU time of the tasks over that of "
    "one run with as many threads, less 1. Both hold the same points. The other "
    "tables are of a model, which plays the stages with what the tasks took here: cores that run "
    "a task each, a scheduler that starts tasks one after another, machines whose cores share "
    "their net, a file system that all share, a time to open a file, and some tasks that take "
    "longer. Model s: what it says of this machine. Efficiency: computing of all tasks over "
    "cores times seconds. Limit: what takes longest where nothing else takes time.";

const Columns<FarmRow>& farm_columns() {
  using R = FarmRow;
  static const Columns<R> columns{{"way", {"way"}, &R::way},
                                  {"workers", {"workers"}, &R::workers},
                                  {"wall_seconds", {"wall s", "{:.2f}"}, &R::wall},
                                  {"cpu_seconds", {"CPU s", "{:.2f}"}, &R::cpu},
                                  {"overhead", percent("overhead %", "{:.1f}"), &R::overhead},
                                  {"model_seconds", {"model s", "{:.2f}"}, &R::model}};
  return columns;
}

const Columns<FarmModelRow>& farm_model_columns() {
  using R = FarmModelRow;
  constexpr double kHour = 3600, kTera = 1e12, kMega = 1e6;
  static const Columns<R> columns{
      {"nodes", {"machines"}, &R::nodes},
      {"routes", {"routes"}, path(&R::load, &FarmLoad::routes)},
      {"parts", {"parts"}, path(&R::load, &FarmLoad::parts)},
      {"route_seconds", {"routed h", "{:.2f}", kHour}, path(&R::times, &FarmTimes::route)},
      {"part_seconds", {"parts h", "{:.2f}", kHour}, path(&R::times, &FarmTimes::part)},
      {"join_seconds", {"join h", "{:.3f}", kHour}, path(&R::times, &FarmTimes::join)},
      {"built_seconds", {"built h", "{:.2f}", kHour}, [](const R& r) { return r.times.built(); }},
      {"light_seconds", {"lit h", "{:.2f}", kHour}, path(&R::times, &FarmTimes::light)},
      {"bounce_seconds", {"bounce h", "{:.2f}", kHour}, path(&R::times, &FarmTimes::bounce)},
      {"shade_seconds", {"shaded h", "{:.2f}", kHour}, path(&R::times, &FarmTimes::shade)},
      {"seconds", {"all h", "{:.2f}", kHour}, [](const R& r) { return r.times.total(); }},
      {"efficiency", percent("efficiency %", "{:.0f}"), &R::efficiency},
      {"moved_bytes", {"moved TB", "{:.1f}", kTera}, path(&R::times, &FarmTimes::moved_bytes)},
      {"opened", {"files opened, millions", "{:.1f}", kMega}, path(&R::times, &FarmTimes::opened)},
      {"plan_bytes", {"plan MB", "{:.1f}", kMega}, &R::plan_bytes},
      {"limit", {"limit"}, path(&R::times, &FarmTimes::limit)}};
  return columns;
}

const Columns<TaskCosts>& cost_columns() {
  using R = TaskCosts;
  static const Columns<R> columns{
      {"route_seconds", {"route, ns of CPU a point", "{:.0f}", 1e-9}, &R::route_seconds},
      {"part_seconds", {"part, ns of CPU a point", "{:.0f}", 1e-9}, &R::part_seconds},
      {"join_seconds", {"join, ms of CPU a part", "{:.2f}", 1e-3}, &R::join_seconds},
      {"light_seconds", {"light, us of CPU a point", "{:.2f}", 1e-6}, &R::light_seconds},
      {"bounce_seconds", {"bounce, us of CPU a point", "{:.1f}", 1e-6}, &R::bounce_seconds},
      {"shade_seconds", {"shade, us of CPU a point", "{:.1f}", 1e-6}, &R::shade_seconds},
      {"collect_seconds", {"collect, ns of CPU a point", "{:.0f}", 1e-9}, &R::collect_seconds},
      {"row_bytes", {"bytes a point between them", "{:.1f}"}, &R::row_bytes},
      {"stored_bytes", {"bytes a point of the container", "{:.1f}"}, &R::stored_bytes},
      {"edge_bytes", {"edges KB a part", "{:.1f}", 1e3}, &R::edge_bytes}};
  return columns;
}

Chart chart_of(const FarmResult& result, std::uint64_t points) {
  Chart chart{.title = fmt::format("{} billion points by the model", points / 1'000'000'000),
              .columns = 2};
  ChartPanel time{.title = "Time", .x_label = "machines", .y_label = "hours"};
  ChartPanel share{.title = "Efficiency", .x_label = "machines", .y_label = "efficiency, %"};
  for (const FarmModelRow& row : result.by_nodes) {
    const auto nodes = static_cast<double>(row.nodes);
    const auto add = [&](const char* name, double seconds) {
      series_of(time, name, false).points.push_back({.x = nodes, .y = seconds / 3600});
    };
    add("routes", row.times.route);
    add("parts", row.times.part);
    add("join", row.times.join);
    add("light", row.times.light);
    add("bounce", row.times.bounce);
    add("shade", row.times.shade);
    add("all", row.times.total());
    series_of(share, "all", false).points.push_back({.x = nodes, .y = 100 * row.efficiency});
  }
  add_panel(chart, time);
  add_panel(chart, share);
  return chart;
}

}  // namespace

Report report_of(const FarmResult& result, const FarmBenchOptions& options) {
  const FarmHardware& h = options.hardware;
  const std::vector<TaskCosts> costs{result.costs};
  const std::string model = fmt::format("{:.3g} billion points by the model",
                                        static_cast<double>(options.model_points) / 1e9);
  return {
      .name = "farm",
      .title = "One scene by many tasks",
      .reading = kFarmReading,
      .runs = options.repeats,
      .tables = {tabulate<FarmRow>({.name = "rows"}, farm_columns(), result.rows),
                 tabulate<TaskCosts>({.name = "costs", .title = "What the tasks took"},
                                     cost_columns(), costs),
                 tabulate<FarmModelRow>({.name = "nodes", .title = model}, farm_model_columns(),
                                        result.by_nodes),
                 tabulate<FarmModelRow>(
                     {.name = "parts", .title = "The same on the most machines, by the plan"},
                     farm_model_columns(), result.by_parts)},
      .notes = {fmt::format("The model's machines have {} cores and {:.3g} GB/s of net each, the "
                            "file system {:.3g} GB/s for all. A file takes {:.3g} ms to open, the "
                            "scheduler starts {:.3g} tasks a second, and {:.3g} % of the tasks "
                            "take {:.3g} times as long.",
                            h.cores, h.node_bytes / 1e9, h.store_bytes / 1e9, 1000 * h.open_seconds,
                            h.starts, 100 * h.slow_share, h.slow_factor),
                "In the model routes read their points from files, of as many bytes as they write; "
                "here the city is made in memory.",
                fmt::format("In the model each range writes a file of its own. Where they are "
                            "collected in one file, a last task takes {:.1f} hours more.",
                            result.collect_seconds / 3600)},
      .figures = {{.chart = chart_of(result, options.model_points)}}};
}

Experiment make_farm_experiment() {
  const auto options = std::make_shared<FarmBenchOptions>();
  const auto declare = [options](Declaration& d) {
    d.city_points(options->points, "20M", 300'000);
    d.integer("--parts", options->parts, 1, 1000, "Parts of the city; 8 without this option");
    d.quick("--parts", options->parts, 3);
    d.count("--shaded", options->shaded, "Points of a smaller city, which is shaded", "300k");
    d.quick("--shaded", options->shaded, 20'000);
    d.count("--model-points", options->model_points, "Points of the model's scene", "100G");
    d.integer("--cores", options->hardware.cores, 1, 1024,
              "Cores of each of the model's machines; 16 without this option");
    d.repeats(options->repeats, 1);
  };
  const auto check = [options] {
    if (options->points < 1000) refuse("--points", std::to_string(options->points), "1000 or more");
    if (options->shaded < 1000) refuse("--shaded", std::to_string(options->shaded), "1000 or more");
    if (options->model_points < 1'000'000)
      refuse("--model-points", std::to_string(options->model_points), "1000000 or more");
  };
  return {.name = "farm",
          .purpose = "A scene built in parts beside one run, and a model of up to 1,000 machines",
          .quick = "300k points in 3 parts, once",
          .declare = declare,
          .run =
              [options](const Bench& b) {
                return report_of(measure_farm(*options, b.work, b.run, b.progress), *options);
              },
          .check = check};
}

}  // namespace ptc::bench
