// Tasks of a plan, and other processes that do the same task in the middle of one.
#include "engine/pipeline/farm/tasks.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/pipeline/parts/part_edges.h"
#include "engine/pipeline/shade/shade_ranges.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

enum class When { begun, advanced };

/// Calls a function once, when a stage begins or when it has done its first points.
class AtStage : public Progress {
 public:
  AtStage(std::string stage, std::function<void()> then, When when = When::begun)
      : stage_(std::move(stage)), when_(when), then_(std::move(then)) {}
  void begin(const std::string& stage, std::uint64_t, const std::string&) override {
    reached_ = stage == stage_;
    if (when_ == When::begun) call();
  }
  void advance(std::uint64_t) override {
    if (when_ == When::advanced) call();
  }
  [[nodiscard]] bool called() const { return then_ == nullptr; }

 private:
  void call() {
    if (reached_ && then_) std::exchange(then_, nullptr)();
  }

  std::string stage_;
  When when_;
  bool reached_ = false;
  std::function<void()> then_;
};

/// A plan of a city of two parts in a directory of its own.
struct City {
  City() {
    BuildRequest request;
    request.city_points = 20'000;
    FarmOptions options{.parts = 2};
    options.command = [](const FarmPlan&, const FarmTask&) { return std::vector<std::string>(); };
    Progress silent;
    plan = make_plan(request, directory / "city.ptcx", directory / "city.json", options, silent);
    write_plan(plan);
  }

  [[nodiscard]] const FarmTask& task(const std::string& name) const {
    return *std::ranges::find(plan.tasks, name, &FarmTask::name);
  }
  bool run(const std::string& name) const {
    Progress silent;
    return run_task(plan, task(name), {}, silent);
  }
  void run_all() const {
    for (const FarmTask& task : plan.tasks) run(task.name());
  }
  [[nodiscard]] std::filesystem::path part(std::size_t i) const {
    return plan.output({TaskKind::part}, i);
  }

  test::TemporaryDirectory directory;
  FarmPlan plan;
};

}  // namespace

TEST_CASE("task: a part that loses its routes to the join of others ends well", "[farm][tasks]") {
  const City city;
  city.run("route.0");
  AtStage others("build", [&] { city.run_all(); });
  CHECK_FALSE(run_task(city.plan, city.task("part.0"), {}, others));
  CHECK(others.called());
  CHECK(TaskMarks(city.plan).state(city.task("part.0")) == TaskState::done);
}

TEST_CASE("task: a part that another process does first writes the same files", "[farm][tasks]") {
  const City city;
  city.run("route.0");
  std::vector<char> part, edges;
  const auto do_all = [&] {
    city.run_all();
    part = test::bytes_of(city.part(0));
    edges = test::bytes_of(edges_path(city.part(0)));
  };
  AtStage others("build", do_all, When::advanced);  // when its points are read
  CHECK(run_task(city.plan, city.task("part.0"), {}, others));
  CHECK((test::bytes_of(city.part(0)) == part));
  CHECK((test::bytes_of(edges_path(city.part(0))) == edges));
}

TEST_CASE("task: a route that is later than the parts leaves no file", "[farm][tasks]") {
  const City city;
  AtStage others("route", [&] { city.run_all(); });
  CHECK(run_task(city.plan, city.task("route.0"), {}, others));
  CHECK_FALSE(std::filesystem::exists(city.plan.output({TaskKind::route}, 0)));
  CHECK(TaskMarks(city.plan).state(city.task("route.0")) == TaskState::done);
}

TEST_CASE("task: edges of an earlier part stay until those of the next replace them",
          "[farm][tasks]") {
  const City city;
  city.run_all();
  const std::vector<char> edges = test::bytes_of(edges_path(city.part(1)));
  std::filesystem::remove(city.plan.folder() / "done" / "part.1");
  std::filesystem::remove(city.plan.folder() / "done" / "route.0");
  city.run("route.0");
  AtStage others("build", [&] { CHECK((test::bytes_of(edges_path(city.part(1))) == edges)); });
  CHECK(run_task(city.plan, city.task("part.1"), {}, others));
  CHECK(others.called());
}

namespace {

/// Writes surfels on a bent sheet as text, with channels of their own.
void write_sheet(const std::filesystem::path& path, int points, const std::string& names,
                 const std::string& values) {
  std::ofstream out(path);
  out << "ply\nformat ascii 1.0\nelement vertex " << points << '\n';
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "radius"})
    out << "property float " << name << '\n';
  out << names << "end_header\n";
  for (int i = 0; i < points; ++i) {
    out << i % 97 << ' ' << i / 97 << ' ' << i % 7 << " 0 0 1 0.5";
    for (const char c : values) out << ' ' << (c == 'i' ? i % 250 : 3);
    out << '\n';
  }
}

}  // namespace

TEST_CASE("task: shares of containers and ranges of parts do not change the parts",
          "[farm][tasks]") {
  // One has two channels, the other one of them; the plan records the order of both
  const test::TemporaryDirectory directory;
  Progress silent;
  BuildRequest request{.original_order = true};
  for (const std::string name : {"a", "b"}) {
    const bool both = name == "a";
    write_sheet(directory / (name + ".ply"), both ? 9000 : 7000,
                both ? "property uchar classification\nproperty uchar intensity\n"
                     : "property uchar intensity\n",
                both ? "ci" : "i");
    request.inputs.push_back(directory / (name + ".ptcx"));
    build_container({.inputs = {directory / (name + ".ply")}, .page_shift = 12},
                    request.inputs.back(), silent);
  }
  std::vector<std::vector<char>> parts;
  const auto build = [&](std::uint64_t share, std::size_t ranges, std::size_t routes) {
    FarmOptions options{.parts = 2, .share_points = share, .ranges = ranges};
    options.command = [](const FarmPlan&, const FarmTask&) { return std::vector<std::string>(); };
    const auto name = [&](const char* end) {
      return directory / ("of" + std::to_string(share) + "in" + std::to_string(ranges) + end);
    };
    FarmPlan plan = make_plan(request, name(".ptcx"), name(".json"), options, silent);
    write_plan(plan);
    plan = read_plan(plan.file, options.command);
    for (const FarmTask& task : plan.tasks) run_task(plan, task, {}, silent);
    CHECK(plan.inputs.size() == routes);
    CHECK(plan.borders.size() == 2 * ranges - 1);
    for (std::size_t i = 0; i < 2; ++i)
      parts.push_back(test::bytes_of(plan.output({TaskKind::part}, i)));
  };
  build(100'000, 1, 2);
  build(2'000, 1, 7);
  build(2'000, 5, 7);
  build(100'000, 60, 2);
  for (std::size_t i = 2; i < parts.size(); ++i) CHECK((parts[i] == parts[i % 2]));
}

TEST_CASE("ranges: rays of a range are those of a whole run", "[farm][ranges]") {
  const test::TemporaryDirectory directory;
  Progress silent;
  BuildRequest city;
  city.city_points = 140'000;
  build_container(city, directory / "city.ptcx", silent);
  ShadeRequest request{{.scene = directory / "city.ptcx", .receiver_rays = 2}};
  shade_container(request, directory / "whole.ply", silent);
  std::vector<std::filesystem::path> results;
  for (std::size_t i = 0; i < 3; ++i) {
    results.push_back(directory / ("range." + std::to_string(i)));
    shade_range(request, {i, 3}, 7, results.back(), silent);
  }
  collect_shading(request, results, 7, directory / "ranges.ply", silent);
  CHECK((test::bytes_of(directory / "ranges.ply") == test::bytes_of(directory / "whole.ply")));
}

TEST_CASE("task: whoever lights, adds bounces, shades or renders beside others ends well",
          "[farm][tasks]") {
  // A plan with each of these tasks; its pictures are copies of their bounces
  const test::TemporaryDirectory directory;
  Progress silent;
  BuildRequest request;
  request.city_points = 4'000;
  LightRequest lighting;
  lighting.lights = LightRig{.suns = {Sun{}}};
  FarmShading shading{.target = directory / "tile.#.ply"};
  shading.request.bounces = 2;
  shading.request.gather.solid_angle = 0.3F;
  FarmFrames frames{.directory = directory.path(),
                    .targets = {directory / "turn.#.exr"},
                    .range = FrameRange{1, 2, 1},
                    .lighting = shading.request};
  FarmOptions options{
      .parts = 2, .lighting = lighting, .shading = shading, .frames = std::move(frames)};
  options.command = [](const FarmPlan&, const FarmTask&) { return std::vector<std::string>(); };
  FarmPlan plan =
      make_plan(request, directory / "city.ptcx", directory / "city.json", options, silent);
  write_plan(plan);
  REQUIRE(plan.waves() == 1);
  const auto run = [&](const FarmTask& task, Progress& progress,
                       const std::function<void()>& before_frame = {}) {
    return run_task(plan, task, {}, progress, [&](const FarmTask& frame) {
      if (before_frame) before_frame();
      std::filesystem::copy_file(plan.output({TaskKind::join_bounce, 1}, 0), frame.outputs.at(0),
                                 std::filesystem::copy_options::overwrite_existing);
    });
  };
  const auto finish = [&] {
    for (const FarmTask& task : plan.tasks) run(task, silent);
  };
  const auto found = [&] {
    std::map<std::string, std::vector<char>> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory.path())) {
      const std::string name = entry.path().lexically_relative(directory.path());
      if (entry.is_regular_file()) files[name] = test::bytes_of(entry.path());
    }
    return files;
  };
  finish();
  const auto wanted = found();

  // Another process does all of the plan in the middle of a task
  for (const FarmTask& chosen : plan.tasks) {
    const TaskKind kind = chosen.step.kind;
    const bool frame = kind == TaskKind::frame;
    if (kind != TaskKind::light && kind != TaskKind::bounce && kind != TaskKind::shade && !frame)
      continue;
    CAPTURE(chosen.name());
    std::filesystem::remove_all(plan.folder());
    std::filesystem::remove(plan.scene);
    for (const FarmTask& task : plan.tasks) {
      if (task.step == chosen.step) break;
      run(task, silent);
    }
    bool called = false;
    const auto others = [&] {
      if (!std::exchange(called, true)) finish();
    };
    AtStage at_stage(frame ? "" : name_of(kind), others);
    const bool ran = run(chosen, at_stage, frame ? others : std::function<void()>());
    if (frame) CHECK_FALSE(ran);  // the others have removed its bounces
    CHECK(called);
    CHECK((found() == wanted));
  }
}
