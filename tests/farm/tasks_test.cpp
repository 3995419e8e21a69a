// Tasks of a plan, and other processes that do the same task in the middle of one.
#include "engine/pipeline/farm/tasks.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/pipeline/parts/part_edges.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

/// Calls a function once, when a stage begins.
class AtStage : public Progress {
 public:
  AtStage(std::string stage, std::function<void()> then)
      : stage_(std::move(stage)), then_(std::move(then)) {}
  void begin(const std::string& stage, std::uint64_t, const std::string&) override {
    if (stage == stage_ && then_) std::exchange(then_, nullptr)();
  }
  [[nodiscard]] bool called() const { return then_ == nullptr; }

 private:
  std::string stage_;
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
  AtStage others("sort", [&] { city.run_all(); });
  CHECK_FALSE(run_task(city.plan, city.task("part.0"), {}, others));
  CHECK(others.called());
  CHECK(state_of(city.plan, city.task("part.0")) == TaskState::done);
}

TEST_CASE("task: a part that another process does first writes the same files", "[farm][tasks]") {
  const City city;
  city.run("route.0");
  std::vector<char> part, edges;
  AtStage others("build", [&] {
    city.run_all();
    part = test::bytes_of(city.part(0));
    edges = test::bytes_of(edges_path(city.part(0)));
  });
  CHECK(run_task(city.plan, city.task("part.0"), {}, others));
  CHECK((test::bytes_of(city.part(0)) == part));
  CHECK((test::bytes_of(edges_path(city.part(0))) == edges));
}

TEST_CASE("task: a route that is later than the parts leaves no file", "[farm][tasks]") {
  const City city;
  AtStage others("route", [&] { city.run_all(); });
  CHECK(run_task(city.plan, city.task("route.0"), {}, others));
  CHECK_FALSE(std::filesystem::exists(city.plan.output({TaskKind::route}, 0)));
  CHECK(state_of(city.plan, city.task("route.0")) == TaskState::done);
}

TEST_CASE("task: edges of an earlier part stay until those of the next replace them",
          "[farm][tasks]") {
  const City city;
  city.run_all();
  const std::vector<char> edges = test::bytes_of(edges_path(city.part(1)));
  std::filesystem::remove(city.plan.folder() / "done" / "part.1");
  std::filesystem::remove(city.plan.folder() / "done" / "route.0");
  city.run("route.0");
  AtStage others("sort", [&] { CHECK((test::bytes_of(edges_path(city.part(1))) == edges)); });
  CHECK(run_task(city.plan, city.task("part.1"), {}, others));
  CHECK(others.called());
}
