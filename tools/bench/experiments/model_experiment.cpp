// The experiment `ptcbench model`: its table columns, its charts and its options.
//
// A chart has eight panels:
//
//   payload: error over bytes (irradiance, occlusion)     payload: error over time (the same two)
//   leaf: error over bytes, error over time               directions: error over time, pages
#include <algorithm>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "engine/parallel/thread_pool.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/model.h"

namespace ptc::bench {
namespace {

using ModelMeasure = std::function<double(const ModelRow&)>;

constexpr char kError[] = "RMS error, % of the mean";
constexpr char kModelReading[] =
    "What each part of the model costs, in bytes and time, and is worth, in error. Errors are root "
    "mean square (RMS) over the mean of the reference. Payload: what a node holds of the areas and "
    "radiance of its surfels; SH n is spherical harmonics up to degree n; receivers are gathered "
    "one at a time with the same cut through the same tree, and errors are against all surfels in "
    "the same pixels. The payload \"exact\" is the sum over the node's surfels, none in front of "
    "another, which the others approximate. Node: all columns of a node, bounds included, as "
    "floats or as stored. Leaf (points in it) and directions (pixels along a cube edge): PTCX at "
    "its default setting, errors against rays. Pages: stored bytes and CPU time to decode of "
    "points "
    "as they lie, packed, or rounded and packed, and of nodes; rounding moves a point by at most "
    "0.001 of its radius. In charts of payloads over bytes the left marker is as stored, the right "
    "one as floats; over time, solid angles go from coarse to fine.";

double occlusion(const ModelRow& row) {
  return 100 * row.occlusion.rms;
}
double irradiance(const ModelRow& row) {
  return 100 * row.irradiance.rms;
}

const Columns<ModelRow>& model_columns() {
  using R = ModelRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"axis", {"part"}, &R::axis},
      {"variant", {"variant"}, &R::variant},
      {"form", {"form"}, &R::form},
      {"solid_angle", {"solid angle sr", "{:.2g}"}, &R::solid_angle},
      {"bytes", {"bytes", "{:.1f}"}, &R::bytes},
      {"per", {"per"}, &R::per},
      {"us_per_receiver", {"CPU us/receiver", "{:.1f}"}, &R::us},
      {"wall_us_per_receiver", {"wall us/receiver", "{:.1f}"}, &R::wall_us},
      {"evaluate_us", {"payload CPU us/receiver", "{:.1f}"}, &R::evaluate_us},
      {"decode_ns", {"CPU ns to decode", "{:.1f}"}, &R::decode_ns},
      {"moved_radii", {"moved at most, radii", "{:.2g}"}, &R::moved},
      {"ao_rms", percent("occlusion RMS %"), path(&R::occlusion, &ErrorStatistics::rms)},
      {"ao_bias", {}, path(&R::occlusion, &ErrorStatistics::bias)},
      {"ao_p99", {}, path(&R::occlusion, &ErrorStatistics::percentile_99)},
      {"e_rms", percent("irradiance RMS %"), path(&R::irradiance, &ErrorStatistics::rms)},
      {"e_bias", percent("irradiance bias %", "{:+.2f}"),
       path(&R::irradiance, &ErrorStatistics::bias)},
      {"e_p99", percent("irradiance 99th percentile %", "{:.1f}"),
       [](const R& r) { return r.irradiance.percentile_99; }}};
  return columns;
}

const Columns<SceneModel>& scene_columns() {
  using R = SceneModel;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"surfels", {"surfels"}, &R::surfels},
      {"nodes", {"nodes"}, &R::nodes},
      {"receivers", {"receivers (pixels)"}, &R::receivers},
      {"rays", {"rays/receiver"}, &R::rays},
      {"ao_noise", percent("noise, occlusion %", "{:.2g}"), &R::occlusion_noise},
      {"e_noise", percent("noise, irradiance %", "{:.2g}"), &R::irradiance_noise}};
  return columns;
}

std::string note_text(const SceneModel& scene) {
  return fmt::format(
      "{}: {} surfels, {} nodes; receivers are {} pixels of the camera; the error of the reference "
      "of {} rays each is {:.2g} % of the mean occlusion and {:.2g} % of the mean irradiance.\n",
      scene.scene, scene.surfels, scene.nodes, scene.receivers, scene.rays,
      100 * scene.occlusion_noise, 100 * scene.irradiance_noise);
}

/// The middle one of the solid angles at which payloads were measured.
double middle_angle(const SceneModel& scene) {
  std::vector<double> angles;
  for (const ModelRow& row : scene.rows) {
    if (row.axis == "payload" && std::ranges::find(angles, row.solid_angle) == angles.end())
      angles.push_back(row.solid_angle);
  }
  return angles.empty() ? kNone : angles[angles.size() / 2];
}

/// Makes a panel of error over bytes of a node, at the middle solid angle.
ChartPanel payloads_over_bytes(const SceneModel& scene, const char* what,
                               const ModelMeasure& error) {
  const double angle = middle_angle(scene);
  ChartPanel panel{.title = fmt::format("Payload at {:.2g} sr: {}", angle, what),
                   .x_label = "bytes per node",
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

/// Makes a panel of error over time, with a line for each payload as stored.
ChartPanel payloads_over_time(const SceneModel& scene, const char* what,
                              const ModelMeasure& error) {
  ChartPanel panel{
      .title = fmt::format("Payload: {}", what), .x_label = kTimePerReceiver, .y_label = kError};
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

/// Makes a panel of the errors of the gather over a cost of its tree or its pixels.
ChartPanel gathers_over(const SceneModel& scene, const char* axis, const char* title,
                        const char* x_label, const ModelMeasure& x) {
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

/// Makes a panel of the time to decode over stored bytes, with a line for each form.
ChartPanel pages(const SceneModel& scene) {
  ChartPanel panel{.title = "Compression of pages",
                   .x_label = "stored bytes per point or node",
                   .y_label = "CPU time to decode one, ns"};
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
  Chart chart{.title = "Error against bytes and time of each part of the model: " + scene.scene,
              .note = std::string(kModelReading) + "\n" + note_text(scene),
              .columns = 4};
  for (ChartPanel& panel : std::vector<ChartPanel>{
           payloads_over_bytes(scene, "irradiance", irradiance),
           payloads_over_bytes(scene, "occlusion", occlusion),
           payloads_over_time(scene, "irradiance", irradiance),
           payloads_over_time(scene, "occlusion", occlusion),
           gathers_over(scene, "leaf", "Points in a leaf: bytes", "bytes per point, nodes included",
                        bytes),
           gathers_over(scene, "leaf", "Points in a leaf: time", kTimePerReceiver, time),
           gathers_over(scene, "directions", "Directions: pixels along a cube edge",
                        kTimePerReceiver, time),
           pages(scene)}) {
    add_panel(chart, std::move(panel));
  }
  return chart;
}

}  // namespace

Report report_of(const std::vector<SceneModel>& scenes, unsigned runs) {
  std::vector<ModelRow> rows;
  Report report{.name = "model",
                .title = "Error against bytes and time of each part of the model",
                .reading = kModelReading,
                .runs = runs};
  for (const SceneModel& scene : scenes) {
    rows.insert(rows.end(), scene.rows.begin(), scene.rows.end());
    report.figures.push_back({.part = scene.scene, .chart = chart_of(scene)});
  }
  report.tables = {
      tabulate<ModelRow>({.name = "rows", .title = "Part of the model", .group = "axis"},
                         model_columns(), rows),
      tabulate<SceneModel>({.name = "scenes", .title = "Scenes and references"}, scene_columns(),
                           scenes)};
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
  return {
      .name = "model",
      .purpose =
          "Error against bytes and against time of each part of the model: the payload of a node "
          "(surfel, lobes, vector, cube, spherical harmonics), its rounding, points in a leaf, "
          "direction pixels; compression of pages",
      .quick = "Under a minute on two cores: 100k points, 150 receivers checked, 2 runs",
      .declare = declare,
      .run = run,
      .check = [scenes] { scenes->check(); }};
}

}  // namespace ptc::bench
