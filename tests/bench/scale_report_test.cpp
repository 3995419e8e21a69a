// The scale experiment: laws of growth and reports for rows made by hand.
#include <cmath>
#include <filesystem>
#include <fstream>

#include <catch2/catch.hpp>

#include "tests/support/scenes.h"
#include "tools/bench/experiments/scale_law.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

ScaleRow row(const std::string& stage, std::uint64_t points, double seconds,
             std::uint64_t resident = 1000) {
  const bool limit = stage.ends_with("floor") || stage == "memcpy";
  ScaleRow made{.stage = stage,
                .points = points,
                .receivers = stage == "shade" ? std::uint64_t{100} : 0,
                .threads = 2,
                .memory_bytes = limit ? 0 : std::uint64_t{1} << 30,
                .wall = {seconds, 0.9 * seconds, 1.1 * seconds},
                .cpu = {2 * seconds, 2 * seconds, 2 * seconds},
                .resident_bytes = resident,
                .moved_bytes = 50 * points};
  if (stage == "build") made.file_bytes = 10 * points;
  if (stage == "shade") {
    made.hits = 995;
    made.misses = 5;
    made.cap_share = 0.09;
  }
  return made;
}

/// Rows in which the time of build grows with the points, of verify with their root, of shade not
/// at all.
std::vector<ScaleRow> rows_of(const std::vector<std::uint64_t>& sizes) {
  std::vector<ScaleRow> rows;
  for (const std::uint64_t points : sizes) {
    const auto n = static_cast<double>(points);
    rows.push_back(row("build", points, 4e-7 * n, 1000 + points / 100'000));
    rows.push_back(row("verify", points, 1e-5 * std::sqrt(n)));
    rows.push_back(row("shade", points, 3));
    rows.push_back(row("build floor", points, 1e-7 * n));
    rows.push_back(row("verify floor", points, 1e-6 * std::sqrt(n)));
    rows.push_back(row("memcpy", points, 4e-9 * n));
  }
  return rows;
}

}  // namespace

TEST_CASE("scale report: each stage has its law and its time at 1.7 billion points",
          "[bench][report]") {
  const std::vector<ScaleLaw> laws = laws_of(rows_of({1'000'000, 5'000'000}));
  REQUIRE(laws.size() == 3);
  CHECK(laws[0].stage == "build");
  CHECK(laws[0].time_exponent == Approx(1));
  CHECK(laws[0].predicted_seconds == Approx(680));
  CHECK(laws[0].resident_exponent > 0);
  CHECK(laws[1].time_exponent == Approx(0.5));
  CHECK(laws[1].predicted_seconds == Approx(1e-5 * std::sqrt(1.7e9)));
  CHECK(laws[2].time_exponent == Approx(0).margin(1e-9));
  CHECK(laws[2].resident_exponent == Approx(0).margin(1e-9));
  for (const ScaleLaw& law : laws) CHECK(std::isnan(law.time_ratio));  // no size reaches 20 million
}

TEST_CASE("scale report: the largest size is compared with the smallest from 20 million on",
          "[bench][report]") {
  const std::vector<ScaleLaw> laws =
      laws_of(rows_of({1'000'000, 20'000'000, 50'000'000, 200'000'000}));
  CHECK(laws[0].time_ratio == Approx(1));  // of a point
  CHECK(laws[0].resident_ratio == Approx(3000.0 / 1200));
  CHECK(laws[1].time_ratio == Approx(std::sqrt(0.1)));
  CHECK(laws[2].time_ratio == Approx(1));  // of a receiver
  CHECK(laws[2].resident_ratio == 1);
  CHECK(std::isnan(
      laws_of(rows_of({1'000'000, 20'000'000}))[0].time_ratio));  // the largest is the smallest
  CHECK(std::isnan(laws_of(rows_of({19'999'999, 20'000'000}))[0].resident_ratio));
  CHECK(std::isfinite(laws[0].predicted_seconds));
  CHECK(
      std::isnan(laws_of(rows_of({20'000'000, 1'700'000'000}))[0].predicted_seconds));  // measured
}

TEST_CASE("scale report: rows have the same members, null where a stage has no value",
          "[bench][report]") {
  const nlohmann::ordered_json facts = facts_of(report_of(rows_of({1'000'000, 20'000'000}), 5));
  const auto& rows = facts.at("rows");
  REQUIRE(rows.size() == 12);
  for (const auto& r : rows) CHECK(r.size() == rows.front().size());
  CHECK(rows[0]["wall_ns_each"] == Approx(400));
  CHECK(rows[0]["floor_share"] == Approx(0.25));
  CHECK(rows[1]["floor_share"] == Approx(0.1));
  CHECK(rows[2]["floor_share"].is_null());
  CHECK(rows[3]["floor_share"].is_null());
  CHECK(rows[2]["wall_ns_each"] == Approx(3e7));
  CHECK(rows[2]["cpu_ns_each"] == Approx(6e7));
  CHECK(rows[2]["hit_rate"] == Approx(0.995));
  for (const char* member : {"hit_rate", "hits", "receivers"}) CHECK(rows[0][member].is_null());
  for (const char* member : {"file_bytes", "bytes_per_node"}) CHECK(rows[2][member].is_null());
  REQUIRE(facts.at("laws").size() == 3);
  CHECK(facts["laws"][0]["time_exponent"] == Approx(1));
  CHECK(facts["laws"][0]["time_ratio"].is_null());
}

TEST_CASE("scale report: panels show time, receivers, memory and bytes, with dashed limits",
          "[bench][report]") {
  const Chart chart = report_of(rows_of({1'000'000, 20'000'000}), 5).figures.front().chart;
  std::vector<std::string> titles;
  for (const ChartPanel& panel : chart.panels) titles.push_back(panel.title);
  CHECK(titles == std::vector<std::string>{"Time per point: build, verify and their limits",
                                           "Time per receiver: shade", "Peak memory",
                                           "Bytes moved and stored"});
  const ChartPanel& time = chart.panels[0];
  std::vector<std::string> names;
  for (const ChartSeries& series : time.series) {
    names.push_back(series.name + (series.dashed ? " dashed" : ""));
    CHECK(series.points.size() == 2);
  }
  CHECK(names == std::vector<std::string>{"build", "verify", "build floor dashed",
                                          "verify floor dashed", "memcpy dashed"});
  CHECK(time.series[0].points[1].x == 2e7);
  CHECK(time.series[0].points[1].y == Approx(400));
  REQUIRE(chart.panels[1].series.size() == 1);
  CHECK(chart.panels[1].series[0].points[0].y == Approx(30'000));
  CHECK(chart.panels[1].series[0].points[0].label == "99.50 % hits");
  CHECK(chart.panels[2].series.size() == 3);
  REQUIRE(chart.panels[2].limits.size() == 1);
  CHECK(chart.panels[2].limits[0].y == 1024);
  CHECK(chart.panels[3].series.size() == 3);
  CHECK(chart.panels[3].series[0].points[0].y == 50);
  CHECK(chart.panels[3].series[1].points[0].y == 10);
}

TEST_CASE("scale report: files and text are written for one size and for several",
          "[bench][report]") {
  const test::TemporaryDirectory dir;
  for (const std::vector<std::uint64_t>& sizes :
       {std::vector<std::uint64_t>{1'000'000}, {1'000'000, 20'000'000, 200'000'000}}) {
    const std::vector<ScaleRow> rows = rows_of(sizes);
    write_files(dir.path(), report_of(rows, 5));
    for (const char* ending : {".json", ".csv", ".svg", ".png"}) {
      CHECK(std::filesystem::file_size(dir / (std::string("scale") + ending)) > 100);
    }
    std::ifstream csv(dir / "scale.csv");
    std::size_t lines = 0;
    for (std::string line; std::getline(csv, line);) ++lines;
    CHECK(lines == rows.size() + 1);
    const std::string text = text_of(report_of(rows, 5));
    CHECK_THAT(text, Catch::Contains("build floor") && Catch::Contains(" 9.0   99.50       5 "));
    CHECK((text.find("nan") == std::string::npos));
  }
}
