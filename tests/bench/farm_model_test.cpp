// The model of a farm against times that follow by hand, and the build in parts beside one run.
#include "tools/bench/experiments/farm_model.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "tests/support/temporary_directory.h"
#include "tools/bench/experiments/farm_bench.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

/// Machines that nothing holds up.
FarmHardware free_of_limits(std::uint64_t nodes, std::uint64_t cores) {
  return {.nodes = nodes,
          .cores = cores,
          .node_bytes = 1e30,
          .store_bytes = 1e30,
          .open_seconds = 0,
          .starts = 1e30,
          .slow_share = 0};
}

const FarmLoad kLoad{.points = 1'000'000, .routes = 10, .parts = 20};

}  // namespace

TEST_CASE("farm model: stages that only compute take their tasks over the cores", "[bench][farm]") {
  const TaskCosts costs{.route_seconds = 1e-5, .part_seconds = 4e-5, .join_seconds = 0.5};
  // 10 routes of 1 s, 20 parts of 2 s, a join of 10 s; cores that are left over wait
  const FarmTimes one = play(kLoad, costs, free_of_limits(1, 1));
  CHECK(one.route == Approx(10));
  CHECK(one.part == Approx(40));
  CHECK(one.join == Approx(10));
  CHECK(one.total() == Approx(60));
  CHECK(one.cpu_seconds == Approx(60));
  CHECK(one.limit == "computing");
  const FarmTimes eight = play(kLoad, costs, free_of_limits(2, 4));
  CHECK(eight.route == Approx(2));
  CHECK(eight.part == Approx(6));
  CHECK(eight.join == Approx(10));
  const FarmTimes many = play(kLoad, costs, free_of_limits(100, 4));
  CHECK(many.total() == Approx(1 + 2 + 10));
  CHECK(many.limit == "the longest tasks");
}

TEST_CASE("farm model: what is shared is divided among those who use it", "[bench][farm]") {
  const TaskCosts costs{.source_bytes = 40, .row_bytes = 40, .stored_bytes = 20};
  const double plan = plan_bytes(kLoad);
  FarmHardware hardware = free_of_limits(2, 5);
  hardware.node_bytes = 1e6;
  const FarmTimes by_nodes = play(kLoad, costs, hardware);
  CHECK(by_nodes.route == Approx((80e6 + 10 * plan) / 2e6));
  CHECK(by_nodes.part == Approx((60e6 + 20 * plan) / 2e6));
  CHECK(by_nodes.limit == "net of the machines");
  CHECK(by_nodes.moved_bytes == Approx(140e6 + 40e6 + 33 * plan));
  hardware.store_bytes = 1e6;
  const FarmTimes by_store = play(kLoad, costs, hardware);
  CHECK(by_store.route == Approx((80e6 + 10 * plan) / 1e6));
  CHECK(by_store.limit == "file system");
  hardware = free_of_limits(1000, 1);
  hardware.starts = 2;
  CHECK(play(kLoad, costs, hardware).route == Approx(5));
  CHECK(play(kLoad, costs, hardware).limit == "scheduler");
  hardware = free_of_limits(1, 1);
  hardware.open_seconds = 1e-3;
  const FarmTimes opening = play(kLoad, costs, hardware);
  CHECK(opening.part == Approx(20 * (4 + 3 * 10) * 1e-3));
  CHECK(opening.limit == "opening files");
  CHECK(opening.opened == Approx(10 * 4 + 20 * 34 + (4 + 40 + 10) + (4 + 20) + (4 + 1)));
}

TEST_CASE("farm model: tasks that come one by one do not share what they use", "[bench][farm]") {
  // Each moves 8 MB at 1 MB/s; the next one begins when it has ended
  const TaskCosts costs{.source_bytes = 80};
  FarmHardware hardware = free_of_limits(1, 100);
  hardware.store_bytes = 1e6;
  hardware.starts = 0.1;
  const double plan = plan_bytes(kLoad);
  CHECK(play(kLoad, costs, hardware).route == Approx(100 + (8e6 + plan) / 1e6));
  hardware.starts = 0.25;  // the file system has always something to do
  CHECK(play(kLoad, costs, hardware).route == Approx(4 + 10 * (8e6 + plan) / 1e6));
}

TEST_CASE("farm model: each task starts and reads the plan", "[bench][farm]") {
  const TaskCosts costs{.start_seconds = 0.5, .listed_seconds = 0.25};
  const FarmTimes times = play(kLoad, costs, free_of_limits(1, 10));  // of 33 tasks
  CHECK(times.route == Approx(0.5 + 33 * 0.25));
  CHECK(times.part == Approx(2 * (0.5 + 33 * 0.25)));
  CHECK(times.cpu_seconds == Approx(33 * (0.5 + 33 * 0.25)));
}

TEST_CASE("farm model: parts are lit and get their bounces one wave after another",
          "[bench][farm]") {
  const TaskCosts costs{.join_seconds = 0.05,
                        .light_seconds = 4e-5,
                        .bounce_seconds = 1e-4,
                        .stored_bytes = 20,
                        .edge_bytes = 1000};
  FarmLoad load = kLoad;
  const FarmTimes built = play(load, costs, free_of_limits(1, 4));
  CHECK(built.light == 0);
  CHECK(built.bounce == 0);
  load.lit = true;
  load.waves = 2;
  const FarmTimes times = play(load, costs, free_of_limits(1, 4));
  // 20 parts of 2 s on 4 cores, a join of 1 s; twice 20 parts of 5 s and a join
  CHECK(times.light == Approx(10 + 1));
  CHECK(times.bounce == Approx(2 * (25 + 1)));
  CHECK(times.total() == Approx(built.total() + times.light + times.bounce));
  CHECK(times.cpu_seconds == Approx(built.cpu_seconds + 41 + 2 * 101));
  TaskCosts with_ends = costs;
  with_ends.batch_points = 10'000;  // at 19 borders, over 20 parts
  CHECK(play(load, with_ends, free_of_limits(1, 4)).light == Approx(10 * 1.19 + 1));
  CHECK(play(load, with_ends, free_of_limits(1, 4)).bounce == Approx(2 * (25 * 1.19 + 1)));
  const double plans = 96 * plan_bytes(load) - 33 * plan_bytes(kLoad);
  CHECK(times.moved_bytes == Approx(built.moved_bytes + 3 * (60e6 + 40'000) + plans));
  // The second wave and the ranges see the scene, and the one with the light of the bounce before
  CHECK(times.opened == Approx(built.opened + 2 * 20 * 24 + 20 * 44 + 3 * 44 + 20));
}

TEST_CASE("farm model: ranges are shaded beside each other, and may be collected by one",
          "[bench][farm]") {
  const TaskCosts costs{.shade_seconds = 1e-4, .collect_seconds = 1e-6, .shade_bytes = 10};
  FarmLoad load{.points = 1'000'000, .ranges = 8};
  const FarmTimes files = play(load, costs, free_of_limits(1, 4));
  CHECK(files.shade == Approx(25));
  CHECK(files.collect == Approx(0).margin(1e-9));
  CHECK(files.moved_bytes == Approx(10e6 + 12 * plan_bytes(load)));
  load.collected = true;
  const FarmTimes one = play(load, costs, free_of_limits(1, 4));
  CHECK(one.collect == Approx(1));
  CHECK(one.total() == Approx(26));
  CHECK(one.built() == Approx(0).margin(1e-9));
  CHECK(one.moved_bytes == Approx(30e6 + 12 * plan_bytes(load)));
}

TEST_CASE("farm model: slow tasks hold up their stage alone", "[bench][farm]") {
  const TaskCosts costs{.part_seconds = 2e-5};
  FarmHardware hardware = free_of_limits(20, 1);
  hardware.slow_share = 0.05;  // one of 20 parts
  hardware.slow_factor = 3;
  CHECK(play(kLoad, costs, hardware).part == Approx(3));
  hardware.slow_share = 0.02;
  CHECK(play(kLoad, costs, hardware).part == Approx(1));
  hardware.slow_share = 1;
  hardware.nodes = 1;
  CHECK(play(kLoad, costs, hardware).part == Approx(60));
}

TEST_CASE("farm: parts hold what one run holds, and the model has a row for each farm",
          "[bench][farm]") {
  const test::TemporaryDirectory work;
  FarmBenchOptions options{
      .points = 60'000, .parts = 3, .shaded = 5'000, .workers = {1, 2}, .repeats = 1};
  Progress silent;
  const FarmResult result = measure_farm(options, work.path(), {}, silent);
  REQUIRE(result.rows.size() == 4);
  CHECK(result.rows[1].way == "parts");
  CHECK(std::isfinite(result.rows[1].overhead));
  CHECK(result.rows[1].model > 0);
  CHECK(result.costs.route_seconds > 0);
  CHECK(result.costs.part_seconds > 0);
  CHECK(result.costs.shade_seconds > 0);
  CHECK(result.costs.light_seconds > 0);
  CHECK(result.costs.bounce_seconds > result.costs.light_seconds);
  CHECK(result.costs.collect_seconds > 0);
  CHECK(result.costs.shade_bytes > 0);
  CHECK(result.costs.row_bytes == Approx(34).margin(8));
  CHECK(result.costs.stored_bytes > 10);
  CHECK(result.costs.edge_bytes > 0);
  REQUIRE(result.by_nodes.size() == options.nodes.size());
  for (std::size_t i = 1; i < result.by_nodes.size(); ++i) {
    CHECK(result.by_nodes[i].times.total() <= 1.001 * result.by_nodes[i - 1].times.total());
    CHECK(result.by_nodes[i].efficiency <= 1);
  }
  CHECK(std::filesystem::is_empty(work.path()));
}
