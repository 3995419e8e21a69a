// The growth experiment: its measurements, its rows, and reports of rows made by hand.
#include "tools/bench/experiments/growth.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <system_error>

#include <catch2/catch.hpp>

#include "engine/sort/spill.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

GrowthOptions small_growth() {
  GrowthOptions options;
  options.points = {10'000, 30'000};
  options.middle_points = 8'000;
  options.solid_angles = {0.3F, 0.003F};
  options.layers = {1, 8};
  options.caps = {1, 0.3};
  options.rays = {64, 4096};
  options.own_points = 4'096;
  options.checked = 40;
  options.reference_rays = 1024;
  options.repeats = 1;
  return options;
}

std::vector<GrowthRow> measure(GrowthOptions options, const char* panel, unsigned threads = 1) {
  const test::TemporaryDirectory dir;
  Progress silent;
  options.panels = {panel};
  std::vector<GrowthRow> rows = measure_growth(options, dir.path(), {.threads = threads}, silent);
  CHECK(std::filesystem::is_empty(dir.path()));
  return rows;
}

GrowthRow row(const std::string& panel, double x, unsigned threads, double us) {
  const bool cap = panel == "cap";
  return {.panel = panel,
          .x = x,
          .scene = "city",
          .surfels = 1000,
          .threads = threads,
          .receivers = 10,
          .us = {us, 0.9 * us, 1.1 * us},
          .wall_us = cap ? Spread{us / threads, us / threads, us} : Spread{kNone, kNone, kNone},
          .occlusion_rms = 0.01,
          .irradiance_rms = cap ? kNone : 0.02,
          .speedup_discs = panel == "surfels" ? 10 : kNone,
          .speedup_mesh = kNone,
          .hit_rate = cap ? 0.995 : kNone,
          .pages = cap ? 0.1 : kNone,
          .bytes = cap ? 3000 : kNone};
}

std::vector<GrowthRow> all_rows() {
  return {row("surfels", 1e6, 2, 50), row("surfels", 2e6, 2, 60), row("solid-angle", 0.01, 2, 50),
          row("depth", 4, 2, 70),     row("cap", 1, 1, 50),       row("cap", 0.09, 1, 55),
          row("cap", 1, 2, 52),       row("cap", 0.09, 2, 57)};
}

}  // namespace

TEST_CASE("growth: there is a checked row for each number of surfels, next to one of Embree",
          "[bench][growth]") {
  const std::vector<GrowthRow> rows = measure(small_growth(), "surfels");
  REQUIRE(rows.size() == 2);
  CHECK(rows[0].x == Approx(10'000).epsilon(0.06));
  CHECK(rows[1].x == Approx(30'000).epsilon(0.06));
  for (const GrowthRow& r : rows) {
    CHECK(r.x == static_cast<double>(r.surfels));
    CHECK(r.receivers == 4096);
    CHECK(r.us.median > 0);
    CHECK(r.irradiance_rms < 0.05);
    CHECK(r.occlusion_rms < 0.05);
    CHECK(r.speedup_discs > 0);
    CHECK(std::isnan(r.hit_rate));
  }
}

TEST_CASE("growth: where rays are too slow there is a time and no error", "[bench][growth]") {
  GrowthOptions options = small_growth();
  options.ray_reach = 20'000;
  const std::vector<GrowthRow> rows = measure(options, "surfels");
  REQUIRE(rows.size() == 2);
  CHECK(rows[0].irradiance_rms > 0);
  CHECK(std::isnan(rows[1].irradiance_rms));
  CHECK(std::isnan(rows[1].speedup_discs));
  CHECK(rows[1].us.median > 0);
  CHECK(rows[1].pages > 0);
  for (const GrowthRow& r : measure(options, "cap")) CHECK(std::isnan(r.irradiance_rms));
}

TEST_CASE("growth: a smaller solid angle has a smaller error", "[bench][growth]") {
  const std::vector<GrowthRow> rows = measure(small_growth(), "solid-angle");
  REQUIRE(rows.size() == 2);
  CHECK(rows[0].x == Approx(0.3));
  CHECK(rows[1].x == Approx(0.003));
  CHECK(rows[1].irradiance_rms < 0.7 * rows[0].irradiance_rms);
}

TEST_CASE("growth: sheets lie behind each other", "[bench][growth]") {
  const std::vector<GrowthRow> rows = measure(small_growth(), "depth");
  REQUIRE(rows.size() == 2);
  CHECK(rows[0].x == 1);
  CHECK(rows[1].x == 8);
  CHECK(rows[0].surfels == Approx(rows[1].surfels).epsilon(0.05));
}

TEST_CASE("growth: a cap changes how much is read and no result", "[bench][growth]") {
  GrowthOptions options = small_growth();
  options.points = {100'000};
  options.own_points = 16'384;
  const std::vector<GrowthRow> rows = measure(options, "cap", 2);
  REQUIRE(rows.size() == 4);
  for (std::size_t i = 0; i < 4; ++i) {
    INFO(i);
    CHECK(rows[i].threads == (i < 2 ? 1 : 2));
    CHECK(rows[i].x == (i % 2 == 0 ? 1 : 0.3));
    CHECK(rows[i].irradiance_rms == rows[0].irradiance_rms);
    CHECK(rows[i].wall_us.median > 0);
    CHECK(rows[i].hit_rate > 0.5);
    CHECK(rows[i].hit_rate < 1);
  }
  CHECK(rows[1].pages > rows[0].pages);
  CHECK(rows[1].bytes > rows[0].bytes);
}

TEST_CASE("growth: a disk with too little room is refused before anything is built",
          "[bench][growth]") {
  GrowthOptions options = small_growth();
  options.points = {std::uint64_t{1} << 46};
  const test::TemporaryDirectory dir;
  Progress silent;
  options.panels = {"surfels"};
  CHECK_THROWS_AS(measure_growth(options, dir.path(), {.threads = 1}, silent), std::system_error);
  CHECK_THROWS_WITH(measure_growth(options, dir.path(), {.threads = 1}, silent),
                    Catch::Contains(dir.path().string()) && Catch::Contains("GB free") &&
                        Catch::Contains("`run.temp_dirs`"));
}

TEST_CASE("growth: a build takes no more bytes than estimated", "[bench][growth]") {
  const test::TemporaryDirectory dir;
  Progress silent;
  BuildRequest request;
  request.city_points = 50'000;
  build_container(request, dir / "city.ptcx", silent);
  CHECK(std::filesystem::file_size(dir / "city.ptcx") + 50'000 * kSpilledBytes <
        build_disk_bytes(50'000));
}

TEST_CASE("growth report: there is a panel for each varied quantity, and three for caps",
          "[bench][report]") {
  const Chart chart = report_of(all_rows(), 3).figures.front().chart;
  std::vector<std::string> titles;
  for (const ChartPanel& panel : chart.panels) titles.push_back(panel.title);
  CHECK(titles == std::vector<std::string>{"Surfels", "Solid angle", "Depth complexity",
                                           "Page cache: CPU time", "Page cache: wall time",
                                           "Page cache: bytes read"});
  const ChartPanel& surfels = chart.panels[0];
  REQUIRE(surfels.series.size() == 2);
  CHECK(surfels.series[0].name == "PTCX");
  CHECK(surfels.series[0].points[1].x == 2e6);
  CHECK(surfels.series[0].points[1].y == 60);
  CHECK(surfels.series[0].points[1].label == "2.0 %");
  CHECK(surfels.series[1].name == "Embree, same discs");
  CHECK(surfels.series[1].points[0].y == 500);
  const ChartPanel& memory = chart.panels[3];
  REQUIRE(memory.series.size() == 2);
  CHECK(memory.series[0].name == "1 thread");
  CHECK(memory.series[1].name == "2 threads");
  REQUIRE(memory.series[1].points.size() == 2);
  CHECK(memory.series[1].points[1].x == Approx(9));
  CHECK(memory.series[1].points[1].y == 57);
  CHECK(memory.series[1].points[1].label == "99.50 %");
  CHECK(chart.panels[4].series[1].points[1].y == Approx(28.5));
  CHECK(chart.panels[5].series[0].points[0].y == 3000);
  CHECK(report_of({row("depth", 4, 2, 70)}, 3).figures.front().chart.panels.size() == 1);
}

TEST_CASE("growth report: rows have the same members, null where nothing was measured",
          "[bench][report]") {
  const nlohmann::ordered_json facts = facts_of(report_of(all_rows(), 3));
  REQUIRE(facts.at("rows").size() == 8);
  for (const auto& r : facts.at("rows")) CHECK(r.size() == facts.at("rows").front().size());
  CHECK(facts["rows"][0]["hit_rate"].is_null());
  CHECK(facts["rows"][0]["e_rms"] == 0.02);
  CHECK(facts["rows"][4]["e_rms"].is_null());
  CHECK(facts["rows"][4]["hit_rate"] == 0.995);
  const test::TemporaryDirectory dir;
  write_files(dir.path(), report_of(all_rows(), 3));
  for (const char* ending : {".json", ".csv", ".svg", ".png"}) {
    CHECK(std::filesystem::file_size(dir / (std::string("growth") + ending)) > 100);
  }
  std::ifstream csv(dir / "growth.csv");
  std::string line;
  for (int i = 0; i < 9; ++i) REQUIRE(std::getline(csv, line));
  CHECK(!std::getline(csv, line));
  CHECK(text_of(report_of(all_rows(), 3)).find("solid-angle") != std::string::npos);
}
