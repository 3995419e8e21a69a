// The options, tables and charts of `ptcbench glossy`.
#include <fmt/format.h>

#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/glossy.h"

namespace ptc::bench {
namespace {

constexpr char kGlossyReading[] =
    "Time per receiver for what it would reflect as a rough mirror, against the error. ptcx casts "
    "rays through the octree of the container; embree-discs casts the same rays one at a time at "
    "the same discs in memory, whose tree takes up to 200 bytes a surfel and is built before. "
    "Receivers are points of the scene, in blocks of neighbours, whose fronts the camera of the "
    "scene's picture sees. The reference is many more rays by Embree, in two halves: errors are "
    "free of its noise, and its noise stands beside them. Radiance is over the mean radiance, "
    "occlusion absolute.";

const Columns<GlossyRow>& glossy_columns() {
  using R = GlossyRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"roughness", {"roughness", "{:.1f}"}, &R::roughness},
      {"method", {"method"}, &R::method},
      {"rays", {"rays"}, &R::rays},
      {"receivers", {"receivers"}, &R::receivers},
      {"threads", {"threads"}, &R::threads},
      {"us_per_receiver", {"CPU us/receiver", "{:.1f}"}, &R::us},
      {"wall_us_per_receiver", {"wall us/receiver", "{:.1f}"}, &R::wall_us},
      {"radiance", percent("radiance RMS %"), &R::radiance},
      {"bias", percent("bias %", "{:+.2f}"), &R::bias},
      {"occlusion", {"occlusion RMS", "{:.4f}"}, &R::occlusion},
      {"noise", percent("noise of reference %"), &R::noise}};
  return columns;
}

}  // namespace

Report report_of(const std::vector<std::vector<GlossyRow>>& scenes, unsigned runs) {
  std::vector<GlossyRow> rows;
  Chart chart{.title = "Time for a reflection against error", .note = kGlossyReading, .columns = 2};
  for (const auto& scene : scenes) {
    if (scene.empty()) continue;
    ChartPanel panel{.title = scene.front().scene,
                     .x_label = kTimePerReceiver,
                     .y_label = "radiance RMS error, %"};
    for (const GlossyRow& row : scene) {
      const std::string name = fmt::format("{}, roughness {:.1f}", row.method, row.roughness);
      series_of(panel, name, row.method != "ptcx")
          .points.push_back({.x = row.us.median,
                             .y = 100 * row.radiance,
                             .label = fmt::format("{} rays", row.rays)});
    }
    add_panel(chart, std::move(panel));
    rows.insert(rows.end(), scene.begin(), scene.end());
  }
  return {
      .name = "glossy",
      .title = "Time for a reflection against error",
      .reading = kGlossyReading,
      .runs = runs,
      .tables = {tabulate<GlossyRow>({.name = "rows", .group = "scene"}, glossy_columns(), rows)},
      .figures = {{.chart = chart}}};
}

Experiment make_glossy_experiment() {
  const auto options = std::make_shared<GlossyOptions>();
  const auto scenes = std::make_shared<SceneList>();
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->points, "2M", 20'000);
    d.checked(options->checked, 50);
    d.repeats(options->repeats, 2);
    d.quick(options->receivers, 1'000);
    d.quick(options->reference_rays, 512);
  };
  const auto run = [=](const Bench& b) {
    return measure_scenes(*scenes, options->repeats, b, [&](const SceneChoice& choice) {
      return measure_glossy(choice, *options, b.work, b.run, b.progress);
    });
  };
  return {.name = "glossy",
          .purpose =
              "Time for reflections of rough mirrors against their error, next to Embree on "
              "the discs",
          .quick = "A few seconds: 20k points of the first scene, 1000 mirrors, 50 checked, 2 runs",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check(); }};
}

}  // namespace ptc::bench
