// The study of the model: its measurements, their bounds, and the report of its rows.
#include "tools/bench/experiments/model.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/shade/reference/plain_gather.h"
#include "tests/support/scenes.h"
#include "tools/bench/references/methods.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

ModelOptions small_model() {
  ModelOptions options;
  options.scene.points = 8'000;
  options.scene.shaded_width = 64;
  options.scene.shaded_height = 36;
  options.checked = 160;
  options.reference_rays = 8192;
  options.repeats = 1;
  options.solid_angles = {0.1F, 0.02F};
  options.study_resolution = 32;
  options.leaf_points = {4, 32};
  options.resolutions = {16, 48};
  options.levels = {1, 9};
  return options;
}

/// Returns the study of the fractal, which is made once for all tests.
const SceneModel& measured() {
  static const SceneModel model = [] {
    const test::TemporaryDirectory dir;
    Progress silent;
    const ThreadPool executor(1);
    const BenchScene scene({.name = "fractal"}, small_model().scene, dir.path(), {.threads = 1},
                           silent);
    SceneModel found = measure_model(scene, small_model(), dir.path(), executor, silent);
    CHECK(std::filesystem::is_empty(dir.path()));
    return found;
  }();
  return model;
}

const ModelRow& row_of(const SceneModel& model, const std::string& axis, const std::string& variant,
                       const std::string& form, double solid_angle = kNone) {
  const auto found = std::ranges::find_if(model.rows, [&](const ModelRow& r) {
    const bool angle = std::isnan(solid_angle) || r.solid_angle == Approx(solid_angle);
    return r.axis == axis && r.variant == variant && r.form == form && angle;
  });
  REQUIRE(found != model.rows.end());
  return *found;
}

}  // namespace

TEST_CASE("model: every axis has its rows, and each row has its cost", "[bench][model]") {
  std::map<std::string, int> rows;
  for (const ModelRow& row : measured().rows) {
    CAPTURE(row.axis, row.variant, row.form);
    ++rows[row.axis];
    CHECK((row.bytes > 0) == (row.variant != "exact"));
    if (row.axis == "pages") {
      CHECK(row.decode_ns > 0);
      CHECK(std::isnan(row.irradiance.rms));
      continue;
    }
    CHECK(row.us.median > 0);
    CHECK(row.irradiance.rms > 0);
    CHECK(row.occlusion.rms > 0);
    CHECK((row.evaluate_us > 0) == (row.axis == "payload" || row.axis == "node"));
  }
  CHECK(rows == std::map<std::string, int>{
                    {"payload", 34}, {"node", 4}, {"leaf", 2}, {"directions", 2}, {"pages", 14}});
}

TEST_CASE("model: a larger payload has at most a tenth more error", "[bench][model]") {
  for (const double angle : {0.1, 0.02}) {
    const auto error = [&](const char* name) {
      return row_of(measured(), "payload", name, "stored", angle).irradiance.rms;
    };
    const auto no_worse = [&](const char* more, const char* less) {
      CAPTURE(angle, more, less, error(more), error(less));
      CHECK(error(more) < 1.1 * error(less) + 0.001);  // below a thousandth they differ either way
    };
    no_worse("SH 1", "SH 0");
    no_worse("SH 2", "SH 1");
    no_worse("SH 4", "SH 2");
    no_worse("two lobes", "surfel");
    no_worse("cube", "surfel");
    no_worse("cube", "SH 1");
  }
}

TEST_CASE("model: rounding changes no error by more than a twentieth", "[bench][model]") {
  for (const ModelRow& row : measured().rows) {
    if (row.form != "stored") continue;
    const ModelRow& exact = row_of(measured(), row.axis, row.variant, "float", row.solid_angle);
    CAPTURE(row.axis, row.variant, row.solid_angle);
    CHECK(row.irradiance.rms == Approx(exact.irradiance.rms).epsilon(0.05));
    CHECK(row.occlusion.rms == Approx(exact.occlusion.rms).epsilon(0.05));
    CHECK(row.bytes < exact.bytes);
  }
}

TEST_CASE("model: leaves, directions and pages have the expected costs", "[bench][model]") {
  const SceneModel& model = measured();
  CHECK(row_of(model, "leaf", "32", "").bytes < 0.8 * row_of(model, "leaf", "4", "").bytes);
  CHECK(row_of(model, "directions", "48", "").irradiance.rms <
        0.7 * row_of(model, "directions", "16", "").irradiance.rms);
  const auto bytes = [&](const char* variant, const char* form) {
    return row_of(model, "pages", variant, form).bytes;
  };
  for (const char* form : {"points", "nodes"}) {
    CHECK(bytes("zstd 1", form) < 0.95 * bytes("raw", form));
    CHECK(bytes("lz4", form) < bytes("raw", form));
    CHECK(bytes("zstd 9", form) < bytes("zstd 1", form));
  }
  CHECK(bytes("raw", "points") == Approx(34).epsilon(0.05));
  for (const char* variant : {"lz4", "zstd 1", "zstd 9"}) {
    CHECK(bytes(variant, "packed") < bytes(variant, "points"));
    CHECK(bytes(variant, "rounded") < 0.7 * bytes(variant, "packed"));
    CHECK(row_of(model, "pages", variant, "packed").moved == 0);
    CHECK(row_of(model, "pages", variant, "rounded").moved <= 0.001);
    CHECK(row_of(model, "pages", variant, "rounded").moved > 0.0005);
  }
}

TEST_CASE("model: stored nodes give the shading of the plain gather", "[bench][model]") {
  const test::TemporaryDirectory dir;
  Progress silent;
  const ThreadPool executor(1);
  ModelOptions options = small_model();
  options.solid_angles = {0.05F};
  const BenchScene scene({.name = "city"}, options.scene, dir.path(), {.threads = 1}, silent);
  std::vector<Receiver> receivers(scene.sets().front().receivers);
  receivers.resize(30);
  const std::vector<ModelRow> rows = study_payloads(scene, receivers, options, executor, silent);
  const auto ours = std::ranges::find_if(
      rows, [](const ModelRow& r) { return r.axis == "node" && r.form == "stored"; });
  REQUIRE(ours != rows.end());

  const SceneView view(scene.container());
  PageCache cache(scene.container(), {.memory_bytes = 64U << 20, .threads = 1});
  PlainGather gather(view, cache, {.solid_angle = 0.05F, .resolution = options.study_resolution});
  const DirectionGrid grid(options.study_resolution, {});
  std::vector<Shading> plain, truth(receivers.size());
  for (const Receiver& receiver : receivers) plain.push_back(gather.shade(receiver, grid));
  shade_brute_force(scene.surfels(), receivers, truth, grid, Sides::both, executor);
  ModelRow theirs;
  compare(theirs, plain, truth);
  CHECK(theirs.irradiance.rms > 0.002);  // there is something to agree on
  CHECK(ours->irradiance.rms == Approx(theirs.irradiance.rms).epsilon(0.01));
  CHECK(ours->irradiance.bias == Approx(theirs.irradiance.bias).epsilon(0.01).margin(1e-5));
  CHECK(ours->occlusion.rms == Approx(theirs.occlusion.rms).epsilon(0.01));
}

TEST_CASE("model: a camera that sees nothing is refused", "[bench][model]") {
  const test::TemporaryDirectory dir;
  Progress silent;
  ModelOptions options = small_model();
  options.scene.shaded_width = 0;
  options.scene.own_points = 0;
  const BenchScene scene({.name = "city"}, options.scene, dir.path(), {.threads = 1}, silent);
  CHECK_THROWS_AS(measure_model(scene, options, dir.path(), ThreadPool(1), silent), DataError);
}

TEST_CASE("model report: rows have the same members, and panels show what was measured",
          "[bench][report]") {
  const std::vector<SceneModel> scenes{measured()};
  const nlohmann::ordered_json facts = facts_of(report_of(scenes, 1));
  REQUIRE(facts.at("rows").size() == measured().rows.size());
  for (const auto& row : facts.at("rows")) CHECK(row.size() == facts.at("rows").front().size());
  CHECK(facts.dump().find("nan") == std::string::npos);

  const Chart chart = report_of({measured()}, 1).figures.front().chart;
  REQUIRE(chart.panels.size() == 8);
  const ChartPanel& over_bytes = chart.panels[0];
  CHECK(over_bytes.title == "Payload at 0.02 sr: irradiance");
  CHECK(over_bytes.series.size() == 9);
  CHECK(over_bytes.series[3].name == "cube");
  CHECK(over_bytes.series[3].points[0].x == 60);
  CHECK(over_bytes.series[3].points[0].y ==
        Approx(100 * row_of(measured(), "payload", "cube", "stored", 0.02).irradiance.rms));
  CHECK(over_bytes.limits.size() == 1);
  CHECK(chart.panels[2].series[3].points.size() == 2);
  SceneModel few = measured();
  std::erase_if(few.rows, [](const ModelRow& row) { return row.axis != "leaf"; });
  CHECK(report_of({few}, 1).figures.front().chart.panels.size() == 2);

  const test::TemporaryDirectory dir;
  write_files(dir.path(), report_of(scenes, 1));
  for (const char* name : {"model.json", "model.csv", "model-fractal.svg", "model-fractal.png"}) {
    CHECK(std::filesystem::file_size(dir / name) > 100);
  }
  CHECK(text_of(report_of(scenes, 1)).find("nan") == std::string::npos);
}
