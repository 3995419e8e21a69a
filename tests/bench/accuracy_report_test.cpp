// JSON, CSV, text and charts of rows made by hand.
#include <limits>

#include <catch2/catch.hpp>

#include "tests/support/scenes.h"
#include "tests/support/slurp.h"
#include "tools/bench/experiments/accuracy.h"
#include "tools/bench/experiments/accuracy_chart.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

AccuracyRow row(const std::string& set, const std::string& method, Quantity job, double us,
                double rms) {
  const ErrorStatistics errors{
      .count = 10, .rms = rms, .bias = -rms / 10, .percentile_99 = 3 * rms, .reference_mean = 1};
  const bool light = job == Quantity::bleeding;
  return {.scene = "two, \"rooms\"",
          .set = set,
          .method = method,
          .setting = method == "ptcx" ? "0.01 sr, 0.1 rad, R 32" : "64 rays, packets",
          .job = job,
          .receivers = 100,
          .us_per_receiver = {us, 0.9 * us, 1.1 * us},
          .counts = {.receivers = method == "ptcx" ? 1000U : 0U, .groups = 2500},
          .occlusion = errors,
          .irradiance =
              light ? errors : ErrorStatistics{.rms = kNone, .bias = kNone, .percentile_99 = kNone},
          .flip = set == "camera" ? 0.01 : kNone,
          .occlusion_rms_mesh = kNone,
          .irradiance_rms_mesh = kNone,
          .speedup_discs = 3,
          .speedup_mesh = kNone};
}

/// Rows of two sets, two methods and both jobs, without a mesh.
SceneAccuracy accuracy() {
  SceneAccuracy scene{.surfels = 1000};
  for (const char* set : {"camera", "points"}) {
    scene.references.push_back({.scene = "two, \"rooms\"",
                                .set = set,
                                .receivers = 10,
                                .rays = 8192,
                                .occlusion_mean = 0.3,
                                .irradiance_mean = 2,
                                .occlusion_noise = 0.001,
                                .irradiance_noise = 0.002,
                                .occlusion_floor = kNone,
                                .irradiance_floor = kNone});
    for (const Quantity job : {Quantity::occlusion, Quantity::bleeding}) {
      scene.rows.push_back(row(set, "ptcx", job, 20, 0.01));
      scene.rows.push_back(row(set, "embree-discs", job, 60, 0.02));
    }
  }
  return scene;
}

/// Returns the cells of each line of a CSV file (RFC 4180).
std::vector<std::vector<std::string>> csv_cells(const std::string& text) {
  std::vector<std::vector<std::string>> lines;
  bool quoted = false, begun = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (!begun) lines.push_back({""});
    begun = true;
    const char c = text[i];
    if (c == '"' && quoted && i + 1 < text.size() && text[i + 1] == '"') {
      lines.back().back() += text[++i];
    } else if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      lines.back().emplace_back();
    } else if (c == '\n' && !quoted) {
      begun = false;
    } else {
      lines.back().back() += c;
    }
  }
  CHECK(!quoted);
  return lines;
}

}  // namespace

TEST_CASE("facts: a row has the set, the method, the times and the errors", "[bench][report]") {
  const nlohmann::ordered_json facts = facts_of(report_of({accuracy()}, 5));
  REQUIRE(facts.at("rows").size() == 8);
  for (const auto& found : facts.at("rows")) {
    for (const char* key : {"scene",
                            "set",
                            "job",
                            "method",
                            "setting",
                            "receivers",
                            "us_per_receiver",
                            "us_per_receiver_low",
                            "us_per_receiver_high",
                            "wall_us_per_receiver",
                            "ao_rms",
                            "e_rms",
                            "bias",
                            "p99",
                            "flip",
                            "ao_rms_mesh",
                            "e_rms_mesh",
                            "speedup_discs",
                            "speedup_mesh",
                            "groups",
                            "surfel_blocks",
                            "clusters",
                            "surfels"}) {
      CAPTURE(key);
      CHECK(found.contains(key));
    }
  }
  const auto& first = facts.at("rows")[0];
  CHECK(first.at("scene") == "two, \"rooms\"");
  CHECK(first.at("set") == "camera");
  CHECK(first.at("job") == "occlusion");
  CHECK(first.at("method") == "ptcx");
  CHECK(first.at("us_per_receiver") == 20);
  CHECK(first.at("ao_rms") == 0.01);
  CHECK(first.at("bias") == -0.001);
  CHECK(first.at("p99") == 0.03);
  CHECK(first.at("groups") == 2.5);
}

TEST_CASE("facts: values that were not measured are null", "[bench][report]") {
  const nlohmann::ordered_json facts = facts_of(report_of({accuracy()}, 5));
  const auto& occlusion = facts.at("rows")[0];
  CHECK(occlusion.at("e_rms").is_null());
  CHECK(occlusion.at("ao_rms_mesh").is_null());
  CHECK(occlusion.at("speedup_mesh").is_null());
  CHECK(facts.at("rows")[1].at("groups").is_null());  // of rays
  CHECK(facts.at("rows")[4].at("flip").is_null());    // of points
  CHECK(facts.at("references")[0].at("ao_floor").is_null());
  CHECK(facts.at("references")[1].at("set") == "points");
  CHECK(facts.dump().find("nan") == std::string::npos);
}

TEST_CASE("reports: the files hold the facts, and each line of the table has every column",
          "[bench][report]") {
  const test::TemporaryDirectory dir;
  SceneAccuracy plain = accuracy();
  for (AccuracyRow& r : plain.rows) r.scene = "rooms";
  for (ReferenceNote& n : plain.references) n.scene = "rooms";
  const std::vector<SceneAccuracy> scenes{accuracy(), plain};
  write_files(dir.path(), report_of(scenes, 5));
  const nlohmann::ordered_json facts = facts_of(report_of(scenes, 5));
  CHECK(nlohmann::ordered_json::parse(slurp(dir / "accuracy.json")) == facts);
  const auto lines = csv_cells(slurp(dir / "accuracy.csv"));
  REQUIRE(lines.size() == 1 + facts.at("rows").size());
  for (std::size_t i = 1; i < lines.size(); ++i) {
    REQUIRE(lines[i].size() == lines[0].size());
    for (std::size_t k = 0; k < lines[0].size(); ++k) {
      const auto& value = facts.at("rows")[i - 1].at(lines[0][k]);
      CHECK(lines[i][k] == (value.is_null()     ? ""
                            : value.is_string() ? value.get<std::string>()
                                                : value.dump()));
    }
  }
  for (const char* name : {"accuracy", "accuracy-rooms", "accuracy-two, \"rooms\""}) {
    CHECK(slurp(dir / (std::string(name) + ".svg")).find("<svg") != std::string::npos);
    CHECK(slurp(dir / (std::string(name) + ".png")).starts_with("\x89PNG"));
  }
}

TEST_CASE("words: there is a line for each row and each reference, and no NaN", "[bench][report]") {
  const std::string text = text_of(report_of({accuracy()}, 5));
  CHECK(std::ranges::count(text, '\n') == (2 + 8) + 1 + (2 + 2));  // titles and headings, too
  CHECK(text.find("nan") == std::string::npos);
  CHECK(text.find("embree-discs  64 rays, packets") != std::string::npos);
}

TEST_CASE("chart: each set has a row of panels, each method a curve", "[bench][report]") {
  const Chart chart = chart_of(accuracy());
  CHECK(chart.columns == 4);
  std::vector<std::string> titles;
  for (const ChartPanel& panel : chart.panels) titles.push_back(panel.title);
  CHECK(titles == std::vector<std::string>{"Camera: occlusion", "Camera: irradiance",
                                           "Camera: irradiance, 99th percentile",
                                           "Camera: visible difference of the picture",
                                           "Points: occlusion", "Points: irradiance",
                                           "Points: irradiance, 99th percentile"});
  const ChartPanel& panel = chart.panels[1];
  REQUIRE(panel.series.size() == 2);
  CHECK(panel.series[0].name == "PTCX");
  CHECK(panel.series[1].name == "Embree, same discs");
  REQUIRE(panel.series[0].points.size() == 1);
  CHECK(panel.series[0].points[0].x == 20);
  CHECK(panel.series[0].points[0].y == Approx(1));
  CHECK(panel.series[0].points[0].label == "0.01");
  REQUIRE(panel.limits.size() == 1);
  CHECK(panel.limits[0].y == Approx(0.2));
  CHECK((panel.log_x && panel.log_y));
}

TEST_CASE("chart: a quantity that was not measured has no panel", "[bench][report]") {
  SceneAccuracy dark = accuracy();
  std::erase_if(dark.rows, [](const AccuracyRow& r) { return r.job == Quantity::bleeding; });
  CHECK(chart_of(dark).panels.size() == 2);
  const Chart all = chart_of({dark, accuracy()});
  CHECK(all.panels.size() == 2 + 4);
  CHECK(all.panels[0].title == "two, \"rooms\", camera: occlusion");
}
