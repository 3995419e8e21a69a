// JSON, CSV, text and the chart of errors made by hand.
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "tests/support/scenes.h"
#include "tests/support/slurp.h"
#include "tools/bench/experiments/error_knob.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

CheckError error_of(double share) {
  return {.occlusion_rms = share / 4,
          .occlusion_mean = 0.5,
          .irradiance_rms = share,
          .irradiance_mean = 2};
}

/// Rows whose errors fall with the square of the time.
SceneErrors errors(bool mesh) {
  SceneErrors scene{.name = "room", .surfels = 1000};
  for (const double asked : {0.1, 0.02}) {
    ErrorRow row{.scene = "room",
                 .set = "points",
                 .asked = asked,
                 .receivers = 500,
                 .us_per_receiver = 20,
                 .pilot_share = 0.1};
    row.tuning = {.asked = asked, .met = asked > 0.05, .setting = 3, .measured = error_of(0.07)};
    row.check = {.receivers = 100, .rays = 4096, .discs = error_of(0.06)};
    if (mesh) row.check.mesh = error_of(0.08);
    scene.rows.push_back(row);
  }
  for (std::size_t i = 0; i < ladder().size(); ++i) {
    const double us = 10 * std::pow(1.3, static_cast<double>(i));
    scene.rungs.push_back({error_of(10 / (us * us)), us});
  }
  return scene;
}

}  // namespace

TEST_CASE("error report: the slope is the exponent of the error as a power of time",
          "[bench][error]") {
  CHECK(errors(false).slope() == Approx(-2));
  SceneErrors gap = errors(false);
  gap.rungs[2].error = {};  // has no logarithm
  CHECK(gap.slope() == Approx(-2));
}

TEST_CASE("error report: rows have the requested and the measured error, and null without a mesh",
          "[bench][error]") {
  const nlohmann::ordered_json facts = facts_of(report_of({errors(false)}));
  REQUIRE(facts.at("rows").size() == 2);
  const auto& row = facts.at("rows").at(1);
  CHECK(row.at("asked") == 0.02);
  CHECK(row.at("met") == false);
  CHECK(row.at("measured") == 0.06);
  CHECK(row.at("at_pilots") == 0.07);
  CHECK(row.at("measured_mesh").is_null());
  CHECK(facts_of(report_of({errors(true)})).at("rows").at(0).at("measured_mesh") == 0.08);
  CHECK(facts.at("ladder").size() == ladder().size());
  CHECK(facts.at("ladder").at(0).at("occlusion") == Approx(0.1 / 2));
  CHECK(facts.at("slopes").at(0).at("slope") == Approx(-2));
}

TEST_CASE("error report: an unreachable error counts as not met, and every file is written",
          "[bench][error]") {
  const std::vector<SceneErrors> scenes{errors(true)};
  const std::string text = text_of(report_of(scenes));
  CHECK_THAT(text, Catch::Contains("10  yes") && Catch::Contains(" 2   no "));
  CHECK_THAT(text, Catch::Contains("power") && Catch::Contains("-2.00"));
  const test::TemporaryDirectory dir;
  write_files(dir.path(), report_of(scenes));
  CHECK(nlohmann::ordered_json::parse(slurp(dir / "error.json")) == facts_of(report_of(scenes)));
  const std::string rows = slurp(dir / "error.csv"), rungs = slurp(dir / "error-ladder.csv");
  CHECK(std::ranges::count(rows, '\n') == 3);
  CHECK(std::ranges::count(rungs, '\n') == static_cast<std::ptrdiff_t>(ladder().size()) + 1);
  CHECK(slurp(dir / "error.svg").find("room, points") != std::string::npos);
  CHECK(std::filesystem::file_size(dir / "error.png") > 1000);
}
