// One run and runs in parts take turns, so that they share whatever else the machine does:
//
//   repeat 1:  one run, 1 thread   parts, 1 at once   one run, 2 threads   parts, 2 at once   ...
//
// Tasks are called in this process, as many threads at once as there are workers.
#include "tools/bench/experiments/farm_bench.h"

#include <unistd.h>

#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/file/disk_space.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/farm/tasks.h"
#include "engine/pipeline/light/relit_points.h"
#include "engine/store/reader.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

// CPU time of `ptcfarm part` that finds its task done or not yet to be done, with plans of 6 and of
// 9,009 tasks, medians of 3 and 5 runs
constexpr double kStartSeconds = 0.01, kListedSeconds = 1.5e-5;
constexpr std::uint64_t kModelRoutePoints = 40'000'000, kModelPartPoints = 50'000'000,
                        kModelRangePoints = 10'000'000;

/// What a container holds, whether or not it is in parts. Parts have tops of their own, so that the
/// numbers of nodes differ.
struct Content {
  std::uint64_t points = 0;
  double area = 0;
};

bool same(const Content& a, const Content& b) {
  constexpr double kRounding = 1e-9;  // areas are added in another order
  return a.points == b.points && std::abs(a.area - b.area) <= kRounding * a.area;
}

Content content_of(const std::filesystem::path& container) {
  const ContainerReader reader(container);
  const Superblock& s = reader.superblock();
  return {.points = s.points, .area = s.area};
}

/// CPU time of all tasks of a kind, over all runs.
struct KindCost {
  double cpu = 0;
  std::uint64_t runs = 0;
};
using KindCosts = std::map<TaskKind, KindCost>;

class FarmMeasurement {
 public:
  FarmMeasurement(const FarmBenchOptions& options, const std::filesystem::path& work,
                  const RunOptions& run, Progress& progress)
      : options_(options),
        folder_(work / fmt::format(".ptcbench-{}-farm", ::getpid())),
        run_(run),
        progress_(progress) {
    constexpr std::uint64_t kBytes = 120;  // of a point: rows, parts and one container
    require_room({&work, 1}, options.points * kBytes, fmt::format("{} points", options.points));
  }

  FarmResult measure() {
    std::map<std::pair<bool, unsigned>, TimedRuns> times;
    progress_.begin("build", 2 * options_.workers.size() * options_.repeats, "runs");
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      for (const unsigned workers : options_.workers) {
        folder_.clear();
        Content one, parts;
        times[{false, workers}].run([&] { one = build_whole(workers); });
        progress_.advance(1);
        times[{true, workers}].run([&] { parts = build_parts(workers); });
        progress_.advance(1);
        if (!same(one, parts))
          throw DataError("the scene in parts holds something else than one run's");
      }
    }
    progress_.end();
    measure_shading();
    FarmResult result{.rows = {}, .costs = costs(), .by_nodes = {}, .by_parts = {}};
    for (const unsigned workers : options_.workers) {
      const TimedRuns &whole = times[{false, workers}], &parts = times[{true, workers}];
      FarmRow one{.way = "one run",
                  .workers = workers,
                  .wall = spread_of(whole.wall),
                  .cpu = spread_of(whole.cpu),
                  .overhead = kNone,
                  .model = kNone};
      FarmRow many{.way = "parts",
                   .workers = workers,
                   .wall = spread_of(parts.wall),
                   .cpu = spread_of(parts.cpu)};
      many.overhead = many.cpu.median / one.cpu.median - 1;
      many.model = play({.points = points_, .routes = routes_, .parts = options_.parts},
                        result.costs, this_machine(workers))
                       .built();
      result.rows.push_back(std::move(one));
      result.rows.push_back(std::move(many));
    }
    play_all(result, options_);
    return result;
  }

 private:
  [[nodiscard]] BuildRequest request(unsigned threads) const {
    BuildRequest request;
    request.city_points = options_.points;
    request.run = run_;
    request.run.threads = threads;
    return request;
  }

  Content build_whole(unsigned threads) {
    const std::filesystem::path target = folder_.path() / "whole.ptcx";
    Progress silent;
    static_cast<void>(build_container(request(threads), target, silent));
    return content_of(target);
  }

  /// Plans a city in parts.
  /// @param shading, lighting  how it is shaded, and lit; empty: not at all
  [[nodiscard]] FarmPlan plan_city(const BuildRequest& city, std::uint64_t parts,
                                   const std::optional<FarmShading>& shading = {},
                                   const std::optional<LightRequest>& lighting = {}) const {
    FarmOptions options{.parts = parts,
                        .memory_bytes = options_.task_memory,
                        .lighting = lighting,
                        .shading = shading};
    options.command = [](const FarmPlan&, const FarmTask&) { return std::vector<std::string>(); };
    Progress silent;
    FarmPlan plan = make_plan(city, folder_.path() / "parts.ptcx", folder_.path() / "parts.json",
                              options, silent);
    write_plan(plan);
    return plan;
  }

  Content build_parts(unsigned workers) {
    const FarmPlan plan = plan_city(request(workers), options_.parts);
    for (const TaskKind kind : {TaskKind::route, TaskKind::part, TaskKind::join}) {
      if (kind == TaskKind::join) note_sizes(plan);
      run_timed(plan, kind, workers, building_);
    }
    return content_of(plan.scene);
  }

  /// Measures the tasks that light and shade, with a smaller city: a point takes hundreds of times
  /// as long as to build it.
  void measure_shading() {
    progress_.begin("shade", options_.repeats, "runs");
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      folder_.clear();
      BuildRequest city = request(1);
      city.city_points = options_.shaded;
      LightRequest sun;
      sun.lights.emplace().suns.push_back({.to_sun = glm::normalize(glm::vec3(1, 2, 1))});
      FarmShading shading{.target = folder_.path() / "shaded.#.ply", .request = {}, .ranges = 2};
      shading.request.bounces = 2;
      const FarmPlan plan = plan_city(city, 2, shading, sun);
      run_all(plan, shading_);
      note_shaded(plan);
      // Collect the points in one file, too: how well they are shaded makes no difference
      shading.target = folder_.path() / "shaded.ply";
      shading.request.bounces = 1;
      shading.request.gather.solid_angle = 1;
      run_all(plan_city(city, 2, shading), collecting_);
      progress_.advance(1);
    }
    progress_.end();
  }

  /// Runs all tasks of a plan, step by step.
  void run_all(const FarmPlan& plan, KindCosts& costs) const {
    for (const FarmTask& task : plan.tasks) {
      if (task.number == 0) run_timed(plan, task.step.kind, 1, costs);
    }
  }

  /// Notes what a point takes in the files of the ranges. @pre they are shaded
  void note_shaded(const FarmPlan& plan) {
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i < plan.shading->ranges; ++i) {
      const std::filesystem::path file = plan.output({TaskKind::shade}, i);
      if (std::filesystem::exists(file)) bytes += std::filesystem::file_size(file);  // has points
    }
    shaded_ = ContainerReader(plan.scene).superblock().points;
    sizes_.shade_bytes = static_cast<double>(bytes) / static_cast<double>(shaded_);
  }

  /// Runs all tasks of a kind, and counts their CPU time.
  void run_timed(const FarmPlan& plan, TaskKind kind, unsigned workers, KindCosts& costs) const {
    const Stopwatch stopwatch;
    run_kind(plan, kind, workers);
    KindCost& sum = costs[kind];
    sum.cpu += stopwatch.cost().cpu;
    ++sum.runs;
  }

  /// Runs all tasks of a kind, so many at once.
  void run_kind(const FarmPlan& plan, TaskKind kind, unsigned workers) const {
    std::vector<const FarmTask*> tasks;
    for (const FarmTask& task : plan.tasks) {
      if (task.step.kind == kind) tasks.push_back(&task);
    }
    ThreadPool(workers).for_each(tasks.size(), [&](std::size_t i, unsigned) {
      Progress silent;
      RunOptions run = run_;
      run.threads = 1;
      run.memory_bytes = options_.task_memory;
      run_task(plan, *tasks[i], run, silent);
    });
  }

  /// Notes how many bytes are between the stages. @pre routes and parts are done
  void note_sizes(const FarmPlan& plan) {
    routes_ = plan.inputs.size();
    points_ = 0;
    std::uint64_t rows = 0, stored = 0, edges = 0;
    for (const auto& entry : std::filesystem::directory_iterator(plan.folder())) {
      if (!entry.is_regular_file()) continue;
      const std::string name = entry.path().filename().string();
      if (name.starts_with("route.")) rows += entry.file_size();
      if (name.ends_with(".edges")) edges += entry.file_size();
      if (!name.ends_with(".ptcx")) continue;
      stored += entry.file_size();
      points_ += ContainerReader(entry.path()).superblock().points;
    }
    const auto points = static_cast<double>(points_);
    sizes_.row_bytes = static_cast<double>(rows) / points;
    sizes_.stored_bytes = static_cast<double>(stored) / points;
    sizes_.edge_bytes = static_cast<double>(edges) / static_cast<double>(options_.parts);
  }

  [[nodiscard]] TaskCosts costs() const {
    const auto over = [](const KindCost& cost, std::uint64_t number) {
      return cost.cpu / static_cast<double>(cost.runs * number);
    };
    TaskCosts costs = sizes_;
    costs.route_seconds = over(building_.at(TaskKind::route), points_);
    costs.part_seconds = over(building_.at(TaskKind::part), points_);
    costs.join_seconds = over(building_.at(TaskKind::join), options_.parts);
    // The batch of points in which the first part ends and the second begins is lit by both tasks.
    const std::uint64_t lit = shaded_ + std::min<std::uint64_t>(shaded_, RelitPoints::kBatch);
    costs.batch_points = static_cast<double>(RelitPoints::kBatch);
    costs.light_seconds = over(shading_.at(TaskKind::light), lit);
    costs.bounce_seconds = over(shading_.at(TaskKind::bounce), lit);
    costs.shade_seconds = over(shading_.at(TaskKind::shade), shaded_);
    costs.collect_seconds = over(collecting_.at(TaskKind::collect), shaded_);
    costs.start_seconds = kStartSeconds;
    costs.listed_seconds = kListedSeconds;
    return costs;
  }

  /// This machine in terms of the model: its disk is as fast as its memory, nothing is far away.
  [[nodiscard]] static FarmHardware this_machine(unsigned workers) {
    FarmHardware hardware;
    hardware.cores = std::min(workers, ThreadPool::count(0));
    hardware.node_bytes = hardware.store_bytes = 1e12;
    hardware.open_seconds = 0;
    hardware.starts = 1e6;
    hardware.slow_share = 0;
    return hardware;
  }

  const FarmBenchOptions& options_;
  WorkDirectory folder_;
  RunOptions run_;
  Progress& progress_;
  KindCosts building_, shading_, collecting_;  // of the city, and of the smaller one
  TaskCosts sizes_;
  std::uint64_t points_ = 0, routes_ = 1, shaded_ = 1;
};

FarmModelRow model_row(const FarmLoad& load, const TaskCosts& costs, const FarmHardware& hardware) {
  FarmModelRow row{.load = load,
                   .nodes = hardware.nodes,
                   .times = play(load, costs, hardware),
                   .plan_bytes = plan_bytes(load)};
  row.efficiency = row.times.cpu_seconds /
                   (static_cast<double>(hardware.nodes * hardware.cores) * row.times.total());
  return row;
}

}  // namespace

FarmResult measure_farm(const FarmBenchOptions& options, const std::filesystem::path& work,
                        const RunOptions& run, Progress& progress) {
  return FarmMeasurement(options, work, run, progress).measure();
}

void play_all(FarmResult& result, const FarmBenchOptions& options) {
  TaskCosts costs = result.costs;
  costs.source_bytes = costs.row_bytes;  // the city has no input; files of points do
  const std::uint64_t points = options.model_points;
  const FarmLoad usual{.points = points,
                       .routes = points / kModelRoutePoints + 1,
                       .parts = points / kModelPartPoints + 1,
                       .lit = true,
                       .waves = 1,
                       .ranges = points / kModelRangePoints + 1};
  FarmHardware hardware = options.hardware;
  for (const std::uint64_t nodes : options.nodes) {
    hardware.nodes = nodes;
    result.by_nodes.push_back(model_row(usual, costs, hardware));
  }
  hardware.nodes = options.nodes.back();
  FarmLoad collected = usual;
  collected.collected = true;
  result.collect_seconds = play(collected, costs, hardware).collect;
  for (const std::uint64_t parts : {500U, 2'000U, 5'000U, 10'000U}) {
    for (const std::uint64_t routes : {1'000U, 10'000U, 25'000U}) {
      FarmLoad load = usual;
      load.routes = routes;
      load.parts = parts;
      result.by_parts.push_back(model_row(load, costs, hardware));
    }
  }
}

}  // namespace ptc::bench
