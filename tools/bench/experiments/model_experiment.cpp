#include <algorithm>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "engine/parallel/thread_pool.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/model.h"

namespace ptc::bench {
namespace {

using Measure = std::function<double(const ModelRow&)>;

constexpr char kTime[] = "CPU time per receiver, \u00b5s";
constexpr char kError[] = "RMS error, % of the mean";
constexpr char kReading[] =
    "What each part of the model costs and is worth. Payloads: plain gather of one receiver at a "
    "time, the same cut through the same tree, so that only what a node tells of its surfels "
    "differs; against all surfels in the same pixels. Node: all columns, bounds too. Exact: the "
    "sum over the node's own surfels, none in front of another, which payloads approximate. Leaf "
    "and directions: PTCX at its default setting, against rays. Pages: bytes and CPU time to "
    "decode, points as they lie, packed, or rounded and packed; rounded points lie at most 0.001 "
    "of their radius from where they were. In charts the left marker of a payload is as stored, "
    "the right one as floats, and solid angles go from coarse to fine over time.";

double occlusion(const ModelRow& row) {
  return 100 * row.occlusion.rms;
}
double irradiance(const ModelRow& row) {
  return 100 * row.irradiance.rms;
}

const Columns<ModelRow>& columns() {
  using R = ModelRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"axis", {"part"}, &R::axis},
      {"variant", {"variant"}, &R::variant},
      {"form", {"form"}, &R::form},
      {"solid_angle", {"sr", "{:.2g}"}, &R::solid_angle},
      {"bytes", {"bytes", "{:.1f}"}, &R::bytes},
      {"per", {"of a"}, &R::per},
      {"us_per_receiver", {"CPU us each", "{:.1f}"}, &R::us},
      {"wall_us_per_receiver", {"wall us each", "{:.1f}"}, &R::wall_us},
      {"evaluate_us", {"to evaluate us", "{:.1f}"}, &R::evaluate_us},
      {"decode_ns", {"to decode ns", "{:.1f}"}, &R::decode_ns},
      {"moved_radii", {"moved, radii", "{:.2g}"}, &R::moved},
      {"ao_rms", percent("occlusion RMS %"), path(&R::occlusion, &ErrorStatistics::rms)},
      {"ao_bias", {}, path(&R::occlusion, &ErrorStatistics::bias)},
      {"ao_p99", {}, path(&R::occlusion, &ErrorStatistics::percentile_99)},
      {"e_rms", percent("irradiance RMS %"), path(&R::irradiance, &ErrorStatistics::rms)},
      {"e_bias", percent("bias %", "{:+.2f}"), path(&R::irradiance, &ErrorStatistics::bias)},
      {"e_p99", percent("p99 %", "{:.1f}"), [](const R& r) { return r.irradiance.percentile_99; }}};
  return columns;
}

const Columns<SceneModel>& scene_columns() {
  using R = SceneModel;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"surfels", {"surfels"}, &R::surfels},
      {"nodes", {"nodes"}, &R::nodes},
      {"receivers", {"pixels"}, &R::receivers},
      {"rays", {"rays each"}, &R::rays},
      {"ao_noise", percent("noise, occlusion %", "{:.2g}"), &R::occlusion_noise},
      {"e_noise", percent("noise, irradiance %", "{:.2g}"), &R::irradiance_noise}};
  return columns;
}

std::string note_text(const SceneModel& scene) {
  return fmt::format(
      "{}: {} surfels, {} nodes; {} pixels of the camera; {} rays each are off by {:.2g} % of the "
      "mean "
      "occlusion and {:.2g} % of the mean irradiance.\n",
      scene.scene, scene.surfels, scene.nodes, scene.receivers, scene.rays,
      100 * scene.occlusion_noise, 100 * scene.irradiance_noise);
}

/// The middle one of the solid angles of payloads.
double middle_angle(const SceneModel& scene) {
  std::vector<double> angles;
  for (const ModelRow& row : scene.rows) {
    if (row.axis == "payload" && std::ranges::find(angles, row.solid_angle) == angles.end())
      angles.push_back(row.solid_angle);
  }
  return angles.empty() ? kNone : angles[angles.size() / 2];
}

ChartPanel payloads_over_bytes(const SceneModel& scene, const char* what, const Measure& error) {
  const double angle = middle_angle(scene);
  ChartPanel panel{.title = fmt::format("Payload at {:.2g} sr: {}", angle, what),
                   .x_label = "bytes of a node",
                   .y_label = kError};
  const auto add = [&](const std::string& name, const ModelRow& row, const std::string& label) {
    series_of(panel, name, false)
        .points.push_back({.x = row.bytes, .y = error(row), .label = label});
  };
  for (const ModelRow& row : scene.rows) {
    if (row.solid_angle != angle || row.axis != "payload") continue;
    if (row.variant != "exact") {
      add(row.variant, row, row.form == "stored" ? row.variant : "");
    } else if (error(row) > 0) {
      panel.limits.push_back({error(row), "sum over the surfels"});
    }
  }
  for (const ModelRow& row : scene.rows) {
    if (row.solid_angle == angle && row.axis == "node") add("whole node", row, "");
  }
  return panel;
}

ChartPanel payloads_over_time(const SceneModel& scene, const char* what, const Measure& error) {
  ChartPanel panel{.title = fmt::format("Payload: {}", what), .x_label = kTime, .y_label = kError};
  for (const ModelRow& row : scene.rows) {
    if (row.axis != "payload" || row.form != "stored") continue;
    series_of(panel, row.variant, false)
        .points.push_back(
            {.x = row.us.median,
             .y = error(row),
             .label = row.variant == "cube" ? fmt::format("{:.2g} sr", row.solid_angle) : ""});
  }
  return panel;
}

ChartPanel gathers_over(const SceneModel& scene, const char* axis, const char* title,
                        const char* x_label, const Measure& x) {
  ChartPanel panel{.title = title, .x_label = x_label, .y_label = kError};
  for (const ModelRow& row : scene.rows) {
    if (row.axis != axis) continue;
    const auto add = [&](const char* name, double y) {
      series_of(panel, name, false).points.push_back({.x = x(row), .y = y, .label = row.variant});
    };
    add("irradiance", irradiance(row));
    add("occlusion", occlusion(row));
  }
  return panel;
}

ChartPanel pages(const SceneModel& scene) {
  ChartPanel panel{.title = "Pages",
                   .x_label = "bytes of a point or node",
                   .y_label = "CPU time to decode it, ns"};
  for (const ModelRow& row : scene.rows) {
    if (row.axis != "pages") continue;
    series_of(panel, row.form, false)
        .points.push_back({.x = row.bytes, .y = row.decode_ns, .label = row.variant});
  }
  return panel;
}

Chart chart_of(const SceneModel& scene) {
  const auto bytes = [](const ModelRow& row) { return row.bytes; };
  const auto time = [](const ModelRow& row) { return row.us.median; };
  Chart chart{.title = "What the model costs and is worth: " + scene.scene,
              .note = std::string(kReading) + "\n" + note_text(scene),
              .columns = 4};
  for (ChartPanel& panel : std::vector<ChartPanel>{
           payloads_over_bytes(scene, "irradiance", irradiance),
           payloads_over_bytes(scene, "occlusion", occlusion),
           payloads_over_time(scene, "irradiance", irradiance),
           payloads_over_time(scene, "occlusion", occlusion),
           gathers_over(scene, "leaf", "Points of a leaf", "bytes of a point, with its nodes",
                        bytes),
           gathers_over(scene, "leaf", "Points of a leaf", kTime, time),
           gathers_over(scene, "directions", "Directions: pixels along a cube edge", kTime, time),
           pages(scene)}) {
    add_panel(chart, std::move(panel));
  }
  return chart;
}

}  // namespace

Report report_of(const std::vector<SceneModel>& scenes, unsigned runs) {
  std::vector<ModelRow> rows;
  Report report{.name = "model",
                .title = "What the model costs and is worth",
                .reading = kReading,
                .runs = runs};
  for (const SceneModel& scene : scenes) {
    rows.insert(rows.end(), scene.rows.begin(), scene.rows.end());
    report.figures.push_back({.part = scene.scene, .chart = chart_of(scene)});
  }
  report.tables = {tabulate<ModelRow>({.name = "rows", .group = "axis"}, columns(), rows),
                   tabulate<SceneModel>({.name = "scenes", .title = "Scenes and references"},
                                        scene_columns(), scenes)};
  return report;
}

Experiment make_model_experiment() {
  const auto options = std::make_shared<ModelOptions>();
  const auto scenes = std::make_shared<SceneList>();
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->scene.points, "500k", 100'000);
    d.checked(options->checked, 150);
    d.repeats(options->repeats, 2);
    d.quick(options->scene.shaded_width, 192);
    d.quick(options->scene.shaded_height, 108);
    d.quick(options->reference_rays, 4096);
  };
  const auto run = [=](const Bench& b) {
    const ThreadPool executor(b.run.threads);
    return measure_scenes(*scenes, options->repeats, b, [&](const SceneChoice& choice) {
      const BenchScene scene(choice, options->scene, b.work, b.run, b.progress);
      return measure_model(scene, *options, b.work, executor, b.progress);
    });
  };
  return {.name = "model",
          .purpose =
              "Error against bytes and against time: what a node may hold (surfel, lobes, "
              "vector, cube, spherical harmonics), its rounding, points of a leaf, "
              "direction pixels; page compression",
          .quick = "Under a minute on two cores: 100k points, 150 receivers checked, 2 runs",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check(); }};
}

}  // namespace ptc::bench
