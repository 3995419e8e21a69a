// The experiment `ptcbench truth`: its table columns, its sheets of pictures and its options.
#include <fmt/format.h>

#include "engine/base/error.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/truth.h"
#include "tools/parse.h"
#include "tools/scene_options.h"

namespace ptc::bench {
namespace {

constexpr char kTruthReading[] =
    "Pictures of scenes with 1, 2, 4 ... bounces of light, built and rendered with the default "
    "options, beside pictures by a path tracer with as many paths a pixel as the command says: "
    "Mitsuba 3, which shares no code with this project and gets the same triangles, materials, "
    "lights and camera, where the command names a Python that has it, else our own. Errors are "
    "those of pixels that show one smooth surface, neither lamps nor sky, over the mean of the "
    "paths in these: of the mean (bias), and root mean square (RMS) without the noise of the "
    "paths, which two independent halves give and which stands beside it. FLIP is the visible "
    "difference of whole pictures as they are shown here, from 0 to 1, and HDR-FLIP the greatest "
    "over all exposures; beside it that of one half of the paths against the other, which is noise "
    "alone. Mitsuba has other rays through a pixel, so edges in whole pictures and borders of "
    "shadows in all figures differ by that alone; our own paths take the same rays. Times are wall "
    "times of one run on all cores.";

const Columns<TruthRow>& truth_columns() {
  using R = TruthRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, path(&R::errors, &RoomRow::scene)},
      {"judge", {"beside"}, &R::judge},
      {"bounces", {"bounces"}, &R::bounces},
      {"triangles", {"triangles"}, path(&R::errors, &RoomRow::triangles)},
      {"surfels", {"surfels"}, path(&R::errors, &RoomRow::surfels)},
      {"judged", percent("pixels judged %", "{:.0f}"), path(&R::errors, &RoomRow::judged)},
      {"bias", percent("bias %", "{:+.2f}"), path(&R::errors, &RoomRow::bias)},
      {"rms", percent("RMS %"), path(&R::errors, &RoomRow::rms)},
      {"noise", percent("noise of the paths %"), path(&R::errors, &RoomRow::noise)},
      {"flip", {"FLIP", "{:.4f}"}, path(&R::errors, &RoomRow::flip)},
      {"hdr_flip", {"HDR-FLIP", "{:.4f}"}, path(&R::errors, &RoomRow::hdr_flip)},
      {"noise_hdr_flip",
       {"HDR-FLIP of the halves", "{:.4f}"},
       path(&R::errors, &RoomRow::noise_hdr_flip)},
      {"build_seconds", {"build s", "{:.1f}"}, path(&R::errors, &RoomRow::build_seconds)},
      {"render_seconds", {"render s", "{:.1f}"}, path(&R::errors, &RoomRow::render_seconds)},
      {"path_seconds", {"paths s", "{:.1f}"}, path(&R::errors, &RoomRow::path_seconds)}};
  return columns;
}

/// The options that are parsed to more than one value each.
struct TruthParsed {
  CameraArguments camera;
  LightArguments lights;
};

}  // namespace

Report report_of(const std::vector<Truth>& scenes, unsigned runs) {
  Report report{.name = "truth",
                .title = "Pictures of several bounces beside a path tracer from outside",
                .reading = kTruthReading,
                .runs = runs,
                .tables = {}};
  std::vector<TruthRow> rows;
  for (const Truth& scene : scenes) {
    rows.insert(rows.end(), scene.rows.begin(), scene.rows.end());
    report.sheets.push_back(
        {.part = scene.scene,
         .caption =
             fmt::format("{}, {} bounces: PTCX, {}, and HDR-FLIP from 0 (black) over red and "
                         "yellow to 0.25 and more (white).",
                         scene.scene, scene.rows.back().bounces, scene.rows.back().judge),
         .image = scene.sheet});
  }
  report.tables.push_back(tabulate<TruthRow>({.name = "rows"}, truth_columns(), rows));
  return report;
}

Experiment make_truth_experiment() {
  const auto options = std::make_shared<TruthOptions>();
  const auto parsed = std::make_shared<TruthParsed>();
  const auto scenes =
      std::make_shared<SceneList>(std::vector<std::string>{"cornell", "ajar", "window"});
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.joinable(*scenes);
    d.points(options->room.points, "300k", 20'000);
    d.list(
        "--bounces", "N", options->bounces,
        [](const std::string& text) {
          return static_cast<unsigned>(parse_count("--bounces", text));
        },
        "Bounces of light between surfaces; repeatable [default: 1, 2, 4, 8]");
    d.quick("--bounces", options->bounces, {1, 2});
    d.integer("--paths", options->room.paths, 2, 1'000'000, "Paths of the judge for each pixel");
    d.quick("--paths", options->room.paths, 64);
    d.quick(options->room.size, {64, 48});
    d.file("--python", options->python,
           "A Python interpreter with the package mitsuba, which then judges");
    parsed->camera.declare(d.command(), "Camera: position and target [default: the scene's own]");
    d.command().get_option("--size")->default_str("192x144");
    parsed->lights.declare(d.command());
  };
  const auto run = [=](const Bench& b) {
    TruthOptions given = *options;
    given.room.camera = parsed->camera.camera();
    if (parsed->camera.size()) given.room.size = *parsed->camera.size();
    if (parsed->lights.given())
      given.room.lights = parsed->lights.rig({0, 1, 0}, *TextureStore::make());
    return measure_scenes(*scenes, 1, b, [&](const SceneChoice& choice) {
      return measure_truth(choice, given, b.work, b.run, b.progress);
    });
  };
  return {.name = "truth",
          .purpose = "Pictures of 1 to 8 bounces beside Mitsuba 3 or, without it, our own paths",
          .quick =
              "A few seconds: 20k points of the first scene, 64 x 48 pixels, 64 paths each, 1 "
              "and 2 bounces",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check_meshes(); }};
}

}  // namespace ptc::bench
