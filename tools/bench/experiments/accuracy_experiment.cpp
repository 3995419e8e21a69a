// The experiment `ptcbench accuracy`: its table columns, its report and its options.
#include <bit>

#include "engine/parallel/thread_pool.h"
#include "tools/bench/experiments/accuracy.h"
#include "tools/bench/experiments/accuracy_chart.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/parse.h"

namespace ptc::bench {
namespace {

constexpr char kAccuracyReading[] =
    "Time per receiver against error. Methods: ptcx is the hierarchical gather at settings from "
    "coarse to fine; ptcx-rays are stratified rays through the octree; plain is a gather of one "
    "receiver at a time; embree-discs and embree-mesh are "
    "Sobol-Owen rays at the same discs and at the mesh with baked light, single or in packets, "
    "whichever is faster. Quantities: occlusion alone (any-hit rays), or bleeding, which is "
    "occlusion and irradiance together. Errors are shares of the mean of a reference, which is "
    "many rays at the model that the method shades: root mean square (RMS), mean (bias) and 99th "
    "percentile. FLIP is the visible difference of a part of the picture, 0 to 1. A time ratio is "
    "the time that Embree takes for the same error, divided by the time of the row. Noise is the "
    "RMS error of the reference itself. A setting of ptcx is a solid angle in sr, a parallax in "
    "rad and R direction pixels along a cube edge.";

/// A count times 1000 as the mean per receiver; nothing for methods that do not gather.
Value times_thousand(const AccuracyRow& row, std::uint64_t count) {
  return when(row.counts.receivers > 0, static_cast<double>(count) / 1000);
}

const Columns<AccuracyRow>& accuracy_columns() {
  using R = AccuracyRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"set", {"receivers"}, &R::set},
      {"job", {"quantity"}, [](const R& r) { return std::string(name_of(r.job)); }},
      {"method", {"method"}, &R::method},
      {"setting", {"setting"}, &R::setting},
      {"receivers", {"receivers timed"}, &R::receivers},
      {"us_per_receiver", {"CPU us/receiver", "{:.1f}"}, &R::us_per_receiver},
      {"wall_us_per_receiver", {"wall us/receiver", "{:.1f}"}, &R::wall_us_per_receiver},
      {"ao_rms", percent("occlusion RMS %"), path(&R::occlusion, &ErrorStatistics::rms)},
      {"e_rms", percent("irradiance RMS %"), path(&R::irradiance, &ErrorStatistics::rms)},
      {"bias", percent("bias %", "{:+.2f}"), [](const R& r) { return r.error().bias; }},
      {"p99", percent("99th percentile %", "{:.1f}"),
       [](const R& r) { return r.error().percentile_99; }},
      {"flip", {"mean FLIP", "{:.4f}"}, &R::flip},
      {"ao_rms_mesh", {}, &R::occlusion_rms_mesh},
      {"e_rms_mesh", {}, &R::irradiance_rms_mesh},
      {"speedup_discs", {"Embree discs, time ratio", "{:.1f}"}, &R::speedup_discs},
      {"speedup_mesh", {"Embree mesh, time ratio", "{:.1f}"}, &R::speedup_mesh},
      {"groups", {}, [](const R& r) { return times_thousand(r, r.counts.groups); }},
      {"surfel_blocks", {}, [](const R& r) { return times_thousand(r, r.counts.surfel_blocks); }},
      {"clusters", {}, [](const R& r) { return times_thousand(r, r.counts.clusters); }},
      {"surfels", {}, [](const R& r) { return times_thousand(r, r.counts.surfels); }},
      {"retests", {}, [](const R& r) { return times_thousand(r, r.counts.retests); }}};
  return columns;
}

/// A reference and the size of its scene.
struct ReferenceRow {
  const ReferenceNote* note;
  const SceneAccuracy* scene;
};

const Columns<ReferenceRow>& reference_columns() {
  using R = ReferenceRow;
  const auto noted = [](auto member) { return [member](const R& r) { return r.note->*member; }; };
  constexpr char kNumber[] = "{:.4g}", kShare[] = "{:.2g}";
  static const Columns<R> columns{
      {"scene", {"scene"}, noted(&ReferenceNote::scene)},
      {"set", {"receivers"}, noted(&ReferenceNote::set)},
      {"surfels", {"surfels"}, [](const R& r) { return r.scene->surfels; }},
      {"triangles", {"triangles"}, [](const R& r) { return r.scene->triangles; }},
      {"receivers", {"receivers checked"}, noted(&ReferenceNote::receivers)},
      {"rays", {"rays/receiver"}, noted(&ReferenceNote::rays)},
      {"ao_mean", {"mean occlusion", kNumber}, noted(&ReferenceNote::occlusion_mean)},
      {"e_mean", {"mean irradiance", kNumber}, noted(&ReferenceNote::irradiance_mean)},
      {"ao_noise", percent("noise, occlusion %", kShare), noted(&ReferenceNote::occlusion_noise)},
      {"e_noise", percent("noise, irradiance %", kShare), noted(&ReferenceNote::irradiance_noise)},
      {"ao_floor", percent("discs against mesh, occlusion %", kShare),
       noted(&ReferenceNote::occlusion_floor)},
      {"e_floor", percent("discs against mesh, irradiance %", kShare),
       noted(&ReferenceNote::irradiance_floor)}};
  return columns;
}

}  // namespace

Report report_of(const std::vector<SceneAccuracy>& scenes, unsigned runs) {
  std::vector<AccuracyRow> rows;
  std::vector<ReferenceRow> references;
  Report report{.name = "accuracy",
                .title = "Time per receiver against error: PTCX, plain gather and Embree",
                .reading = kAccuracyReading,
                .runs = runs,
                .figures = {{.chart = chart_of(scenes)}}};
  for (const SceneAccuracy& scene : scenes) {
    rows.insert(rows.end(), scene.rows.begin(), scene.rows.end());
    for (const ReferenceNote& note : scene.references) references.push_back({&note, &scene});
    report.figures.push_back({.part = scene.name(), .chart = chart_of(scene)});
  }
  report.tables = {
      tabulate<AccuracyRow>({.name = "rows", .title = "Scene", .group = "scene"},
                            accuracy_columns(), rows),
      tabulate<ReferenceRow>(
          {.name = "references", .title = "References that the errors are measured against"},
          reference_columns(), references)};
  return report;
}

Experiment make_accuracy_experiment() {
  const auto options = std::make_shared<AccuracyOptions>();
  const auto scenes = std::make_shared<SceneList>();
  const auto declare = [=](Declaration& d) {
    SceneOptions& scene = options->scene;
    d.scenes(*scenes);
    d.points(scene.points, "2M", 200'000);
    d.checked(options->checked, 200);
    d.integer("--reference-rays", options->reference_rays, 16, 65536,
              "Rays per receiver of each of the two halves of a reference, a power of two");
    d.repeats(options->repeats, 3);
    d.list("--setting", "SR,RAD,R[,X]", options->settings, parse_setting,
           "Measure PTCX at this solid angle [sr], parallax [rad], resolution [pixels along a cube "
           "edge] and inflation, in place of a list from coarse to fine; repeatable");
    const std::vector<GatherOptions> all = AccuracyOptions::default_settings();
    d.quick("--setting", options->settings, {all[0], all[2], all[3], all[5]});
    d.words("--method", options->methods, "Measure only this method; repeatable");
    d.words("--set", options->sets,
            "Shade only these receivers: pixels of a picture, or points of the scene, in blocks of "
            "neighbours or far apart; repeatable");
    d.count("--sparse", scene.sparse_points, "Receivers far apart", "3k");
    for (const char* name : {"--setting", "--method", "--set", "--sparse"}) d.for_experts(name);
    // Shade the middle of the picture, not a smaller picture: receivers keep their distance, and so
    // their share of common work
    d.quick(scene.shaded_width, 192);
    d.quick(scene.shaded_height, 108);
    d.quick(scene.window_width, 48);
    d.quick(scene.window_height, 27);
    d.quick(scene.own_points, 8'192);
    d.quick("--sparse", scene.sparse_points, 1'000);
    d.quick(options->rays, {64, 256, 1024, 4096});
    d.quick(options->plain_solid_angles, {0.01F});
  };
  const auto check = [=] {
    const unsigned rays = options->reference_rays;
    if (!std::has_single_bit(rays)) {
      refuse("--reference-rays", std::to_string(rays), "a power of two");
    }
    scenes->check();
  };
  const auto run = [=](const Bench& b) {
    const ThreadPool executor(b.run.threads);
    return measure_scenes(*scenes, options->repeats, b, [&](const SceneChoice& choice) {
      const BenchScene scene(choice, options->scene, b.work, b.run, b.progress);
      return measure_accuracy(scene, *options, executor, b.progress);
    });
  };
  return {
      .name = "accuracy",
      .purpose =
          "Time per receiver against error: PTCX at settings from coarse to fine and by rays, a "
          "plain gather, and Embree on the same discs and on the mesh",
      .quick =
          "Under a minute per scene on two cores: 200k points, fewer receivers of each set "
          "(192 x 108 pixels, 8k points), 200 of them checked, 3 runs of fewer settings",
      .declare = declare,
      .run = run,
      .check = check};
}

}  // namespace ptc::bench
