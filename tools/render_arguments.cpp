#include "tools/render_arguments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>

#include "engine/base/error.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/light/built_scene.h"
#include "tools/option_text.h"
#include "tools/parse.h"
#include "tools/report.h"
#include "tools/values.h"

namespace ptc {
namespace {

/// The layers that a .png may show, without the picture itself.
constexpr std::array<std::string_view, 9> kLayers{"direct", "indirect",   "occlusion",
                                                  "albedo", "reflection", "depth",
                                                  "normal", "object_id",  "material_id"};

/// Refuses clouds, which would be ignored in silence: the camera would see the surfels instead.
void refuse_clouds(const std::vector<std::filesystem::path>& meshes) {
  for (const std::filesystem::path& path : object_files(meshes)) {
    if (!holds_points(path)) continue;
    throw DataError(path.string() + ": offset 0: this is a cloud; --mesh takes a mesh");
  }
}

}  // namespace

void RenderArguments::declare(Command& command) {
  declare_scene(command);
  declare_picture(command);
  sequence_.declare(command.app());
  declare_lights(command.app());
  add_preset(command.app(), preset_);
  add_surroundings(command.app(), request_.gather.around);
  add_glossy(command.app(), request_.glossy, "layer");
  add_quality_options(command.app(), request_);
  add_back_end(command.app(), request_.back_end);
}

std::vector<std::filesystem::path> RenderArguments::targets() const {
  std::vector<std::filesystem::path> targets = outputs_;
  for (const PictureTarget& layer : layers_) targets.push_back(layer.path);
  return targets;
}

void RenderArguments::declare_scene(Command& command) {
  scene_.declare(command, "Container, clouds or meshes whose surfels give the indirect light");
  command.add_outputs("-o,--output", outputs_, {".exr", ".png"},
                      "Picture to write (.exr with all layers, or .png); repeatable");
  add_layers(command.app(), layers_, kLayers);
  command.add_inputs("--mesh", request_.meshes, mesh_endings(),
                     "Mesh that the camera sees; repeatable\n"
                     "By default the camera sees the surfels, or the meshes of SCENE when that has "
                     "no container and no cloud.");
  command.app()
      .add_flag("--backdrop", request_.backdrop,
                "Set the meshes on a ground before a red wall, as ptcbuild does; +y is up")
      ->group(kFilesGroup);
  add_one_sided(command.app(), request_.one_sided);
}

void RenderArguments::declare_picture(Command& command) {
  constexpr char kGroup[] = "Camera";
  CLI::App& app = command.app();
  camera_.declare(
      app,
      "Camera position and target [default: from the files]\n"
      "By default the camera is the first one of --camera-file. Without that it is the camera of "
      "the build, then that of the mesh, and without these one that sees the whole scene, or all "
      "that stands on the backdrop.");
  command
      .add_inputs("--camera-file", request_.camera_files, mesh_endings(),
                  "Mesh or scene file whose cameras may be taken; repeatable")
      ->group(kGroup);
  app.add_option("--camera-name", request_.camera_name, "Take the camera with this name")
      ->type_name("NAME")
      ->group(kGroup);
  const auto set_crop = [this](const std::string& text) {
    constexpr char kExpected[] =
        "X0,Y0,X1,Y1 with the first column and row, and those behind the last";
    const std::vector<double> n = parse_numbers("--crop", text, {4}, kExpected);
    request_.crop.emplace();
    for (std::size_t i = 0; i < 4; ++i) {
      if (!(n[i] >= 0 && n[i] <= 65536 && n[i] == std::floor(n[i])))
        refuse("--crop", text, kExpected);
      (*request_.crop)[i] = static_cast<unsigned>(n[i]);
    }
  };
  app.add_option_function<std::string>("--crop", set_crop,
                                       "Part of the picture that is rendered, in pixels")
      ->type_name("X0,Y0,X1,Y1")
      ->group(kGroup);
  add_samples(app, request_.samples)->group(kGroup);
  add_exposure(app, request_.exposure)->group(kGroup);
}

void RenderArguments::declare_lights(CLI::App& app) {
  lights_.declare(app);
  add_bounces(app, request_.bounces)->group("Lights");
  add_light_groups(app, request_.light_groups, "a layer");
  add_shadows(app, request_.shadows, "layer");
  add_light_sampling(app, request_.light_sampling);
}

const LightingRequest& RenderArguments::lighting(Command& command) {
  apply_preset(command.app(), preset_, request_);
  return request_;
}

double RenderArguments::expected_seconds() const {
  constexpr double kSampleSeconds = 2e-4;  // several times what a view of a city takes
  const std::array<unsigned, 2> size = camera_.size().value_or(std::array<unsigned, 2>{1920, 1080});
  return kSampleSeconds * size[0] * size[1] * request_.samples * std::max(1U, request_.bounces) +
         60;
}

Outcome RenderArguments::render(Command& command, const RunOptions& run, Progress& progress) {
  apply_preset(command.app(), preset_, request_);
  if (!sequence()) note_unused(command.app(), {"--fps"}, "one picture is rendered", progress);
  if (camera_.camera())
    note_unused(command.app(), {"--camera-file"}, "--camera is given", progress);
  refuse_clouds(request_.meshes);
  request_.run = run;
  scene_.apply(request_, outputs_.front(), progress);
  request_.camera = camera_.camera();
  request_.size = camera_.size();
  request_.sequence = sequence_.sequence();
  if (lights_.given() || request_.camera) {
    const glm::vec3 up = up_of_files(scene_files(request_), request_.up);
    if (lights_.given()) {
      request_.lights = lights_.rig(up, *texture_store(request_.run, outputs_.front()));
    }
    if (request_.camera) request_.camera->up = up;
  }
  return render_files(request_, outputs_, layers_, progress);
}

}  // namespace ptc
