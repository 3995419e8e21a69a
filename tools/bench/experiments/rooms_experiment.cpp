// The experiment `ptcbench rooms`: its table columns, its sheets of pictures and its options.
#include <fmt/format.h>

#include "engine/base/error.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/rooms.h"
#include "tools/scene_options.h"

namespace ptc::bench {
namespace {

constexpr char kRoomsReading[] =
    "Pictures of rooms, built and rendered with the default options and as many bounces as the "
    "command says, beside pictures by path tracing on the mesh, from the same camera with the same "
    "rays through each pixel. Errors are those of pixels that show neither lamps nor sky, over the "
    "mean of the paths in these: of the mean (bias), and root mean square (RMS) without the noise "
    "of "
    "the paths, which two independent halves give. FLIP is the visible difference, from 0 to 1, "
    "mean "
    "over the whole picture: of the pictures as they are shown here, and HDR-FLIP, the greatest "
    "over "
    "all exposures; beside it that of one half of the paths against the other, which is noise "
    "alone. "
    "The path tracer has random numbers, sampling, weights and the light of lamps of its own. It "
    "shares with the renderer what a ray meets (Embree, interpolated normals, textures), the "
    "camera, and the radiance of the sky. Times are wall times of one run.";

const Columns<RoomRow>& rooms_columns() {
  using R = RoomRow;
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"triangles", {"triangles"}, &R::triangles},
      {"surfels", {"surfels"}, &R::surfels},
      {"judged", percent("pixels judged %", "{:.0f}"), &R::judged},
      {"bias", percent("bias %", "{:+.2f}"), &R::bias},
      {"rms", percent("RMS %"), &R::rms},
      {"noise", percent("noise of the paths %"), &R::noise},
      {"flip", {"FLIP", "{:.4f}"}, &R::flip},
      {"hdr_flip", {"HDR-FLIP", "{:.4f}"}, &R::hdr_flip},
      {"noise_hdr_flip", {"HDR-FLIP of the halves", "{:.4f}"}, &R::noise_hdr_flip},
      {"build_seconds", {"build s", "{:.1f}"}, &R::build_seconds},
      {"render_seconds", {"render s", "{:.1f}"}, &R::render_seconds},
      {"path_seconds", {"paths s", "{:.1f}"}, &R::path_seconds}};
  return columns;
}

/// The options that are parsed to more than one value each.
struct RoomsParsed {
  CameraArguments camera;
  LightArguments lights;
};

}  // namespace

Report report_of(const std::vector<Room>& rooms, unsigned runs) {
  Report report{.name = "rooms",
                .title = "Pictures of rooms beside path tracing",
                .reading = kRoomsReading,
                .runs = runs,
                .tables = {}};
  std::vector<RoomRow> rows;
  for (const Room& room : rooms) {
    rows.push_back(room.row);
    report.sheets.push_back(
        {.part = room.row.scene,
         .caption = fmt::format("{}: PTCX, paths, and HDR-FLIP from 0 (black) over red and yellow "
                                "to 0.25 and more (white).",
                                room.row.scene),
         .image = room.sheet});
  }
  report.tables.push_back(tabulate<RoomRow>({.name = "rows"}, rooms_columns(), rows));
  return report;
}

Experiment make_rooms_experiment() {
  const auto options = std::make_shared<RoomsOptions>();
  const auto parsed = std::make_shared<RoomsParsed>();
  const auto scenes =
      std::make_shared<SceneList>(std::vector<std::string>{"cornell", "box-lamp", "window"});
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.joinable(*scenes);
    d.points(options->points, "300k", 20'000);
    d.integer("--paths", options->paths, 2, 1'000'000, "Paths of the reference for each pixel");
    d.quick("--paths", options->paths, 64);
    d.integer("--bounces", options->bounces, 0, 64, "Bounces of light between surfaces");
    d.quick(options->size, {64, 48});
    d.file("--pictures", options->pictures,
           "Directory for SCENE.exr with the layers paths and flip beside our picture");
    parsed->camera.declare(d.command(), "Camera: position and target [default: the scene's own]");
    d.command().get_option("--size")->default_str("192x144");
    parsed->lights.declare(d.command());
  };
  const auto run = [=](const Bench& b) {
    RoomsOptions given = *options;
    given.camera = parsed->camera.camera();
    if (parsed->camera.size()) given.size = *parsed->camera.size();
    if (parsed->lights.given()) given.lights = parsed->lights.rig({0, 1, 0}, *TextureStore::make());
    return measure_scenes(*scenes, 1, b, [&](const SceneChoice& choice) {
      return measure_room(choice, given, b.work, b.run, b.progress);
    });
  };
  return {.name = "rooms",
          .purpose = "Pictures of rooms beside the same pictures by path tracing, with FLIP",
          .quick = "A few seconds: 20k points of the first scene, 64 x 48 pixels, 64 paths each",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check_meshes(); }};
}

}  // namespace ptc::bench
