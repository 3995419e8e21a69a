// ptcrender: renders a picture of a scene, lit directly by rays and indirectly by its surfels.
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
#include "tools/common.h"
#include "tools/inputs.h"
#include "tools/option_text.h"
#include "tools/options.h"
#include "tools/parse.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Renders a picture of a container or a cloud, with direct and indirect light.\n"
    "Rays from the camera meet the meshes, or the surfels of the container when no mesh is given. "
    "Direct light comes by shadow rays from the lights and the sky; indirect light is gathered "
    "from the surfels. Of clouds and meshes a container is built first, in a temporary file.\n"
    "\n"
    "An .exr holds the picture in linear light, in W/m^2/sr, with alpha and depth (Z), and the "
    "layers direct, indirect, occlusion, bent_normal, albedo, position (P) and normal (N). Of "
    "meshes it also holds object_id and material_id, whose names are in its header; with "
    "--estimate occlusion_error and irradiance_error, with --glossy reflection and "
    "reflection_occlusion. A .png holds the picture or one of its layers, for display.";
constexpr char kExamples[] =
    "  # Render a mesh with the light of its container\n"
    "  ptcrender dragon.ptcx --mesh dragon.ply --backdrop -o dragon.png\n"
    "  # Render a scan, or the tiles of one\n"
    "  ptcrender scan.laz -o scan.png\n"
    "  ptcrender tiles/ --size 1920x1080 -o scan.png\n"
    "  # Choose the camera and write all layers\n"
    "  ptcrender room.ptcx --camera 0,1.6,4,0,1.2,0 --fov 50 --size 1920x1080 -o room.exr\n"
    "  # Write the picture, and its occlusion as a picture of its own\n"
    "  ptcrender room.ptcx -o room.png --layer occlusion=occlusion.png\n"
    "  # Write the numbers of objects and materials, and a picture of the objects\n"
    "  ptcrender room.obj chair.glb -o room.exr --layer object_id=objects.png\n"
    "  # Render what the surfaces would reflect if they were rough mirrors, too\n"
    "  ptcrender room.ptcx --glossy 0.3 -o room.exr --layer reflection=reflection.png\n"
    "  # Go once around what is seen, in 48 pictures\n"
    "  ptcrender dragon.ptcx --mesh dragon.ply --turntable 48 -o turn.##.png\n"
    "  # Render frames of the second camera of a file, as its animation has it\n"
    "  ptcrender shot.glb --camera-name closeup --frames 1-100 -o shot.####.exr\n"
    "  # Meet an error of 3 %, and measure the error at 1000 receivers\n"
    "  ptcrender dragon.ptcx --error 3% --check 1000 -o dragon.exr\n";

/// The request, and the arguments that are turned into it after parsing.
struct Arguments {
  ptc::RenderRequest request;
  ptc::SceneArguments scene;
  std::vector<std::filesystem::path> outputs;
  std::vector<ptc::PictureTarget> layers;
  ptc::LightArguments lights;
  ptc::CameraArguments camera;
  ptc::SequenceArguments sequence;
};

/// The layers that a .png may show, without the picture itself.
constexpr std::array<std::string_view, 9> kLayers{"direct", "indirect",   "occlusion",
                                                  "albedo", "reflection", "depth",
                                                  "normal", "object_id",  "material_id"};

void declare_scene(ptc::Command& command, Arguments& arguments) {
  ptc::RenderRequest& request = arguments.request;
  arguments.scene.declare(command,
                          "Container, clouds or meshes whose surfels give the indirect light");
  command.add_outputs("-o,--output", arguments.outputs, {".exr", ".png"},
                      "Picture to write (.exr with all layers, or .png); repeatable");
  ptc::add_layers(command.app(), arguments.layers, kLayers);
  command.add_inputs("--mesh", request.meshes, ptc::mesh_endings(),
                     "Mesh that the camera sees; repeatable\n"
                     "By default the camera sees the surfels, or the meshes of SCENE when that has "
                     "no container and no cloud.");
  command.app()
      .add_flag("--backdrop", request.backdrop,
                "Set the meshes on a ground before a red wall, as ptcbuild does; +y is up")
      ->group(ptc::kFilesGroup);
  ptc::add_one_sided(command.app(), request.one_sided);
}

void declare_picture(ptc::Command& command, Arguments& arguments) {
  constexpr char kGroup[] = "Camera";
  CLI::App& app = command.app();
  arguments.camera.declare(
      app,
      "Camera position and target [default: from the files]\n"
      "By default the camera is the first one of --camera-file. Without that it is the camera of "
      "the build, then that of the mesh, and without these one that sees the whole scene, or all "
      "that stands on the backdrop.");
  command
      .add_inputs("--camera-file", arguments.request.camera_files, ptc::mesh_endings(),
                  "Mesh or scene file whose cameras may be taken; repeatable")
      ->group(kGroup);
  app.add_option("--camera-name", arguments.request.camera_name, "Take the camera with this name")
      ->type_name("NAME")
      ->group(kGroup);
  const auto set_crop = [&request = arguments.request](const std::string& text) {
    constexpr char kExpected[] =
        "X0,Y0,X1,Y1 with the first column and row, and those behind the last";
    const std::vector<double> n = ptc::parse_numbers("--crop", text, {4}, kExpected);
    request.crop.emplace();
    for (std::size_t i = 0; i < 4; ++i) {
      if (!(n[i] >= 0 && n[i] <= 65536 && n[i] == std::floor(n[i])))
        ptc::refuse("--crop", text, kExpected);
      (*request.crop)[i] = static_cast<unsigned>(n[i]);
    }
  };
  app.add_option_function<std::string>("--crop", set_crop,
                                       "Part of the picture that is rendered, in pixels")
      ->type_name("X0,Y0,X1,Y1")
      ->group(kGroup);
  ptc::add_samples(app, arguments.request.samples)->group(kGroup);
  ptc::add_exposure(app, arguments.request.exposure)->group(kGroup);
}

void declare_lights(CLI::App& app, Arguments& arguments) {
  arguments.lights.declare(app);
  ptc::add_bounces(app, arguments.request.bounces)->group("Lights");
  ptc::add_light_groups(app, arguments.request.light_groups, "a layer");
  ptc::add_shadows(app, arguments.request.shadows, "layer");
  ptc::add_light_sampling(app, arguments.request.light_sampling);
}

/// Refuses clouds, which would be ignored in silence: the camera would see the surfels instead.
void refuse_clouds(const std::vector<std::filesystem::path>& meshes) {
  for (const std::filesystem::path& path : ptc::object_files(meshes)) {
    if (!ptc::holds_points(path)) continue;
    throw ptc::DataError(path.string() + ": offset 0: this is a cloud; --mesh takes a mesh");
  }
}

/// Renders the picture and reports it.
ptc::Outcome render(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  ptc::RenderRequest& request = arguments.request;
  refuse_clouds(request.meshes);
  request.run = run;
  arguments.scene.apply(request, arguments.outputs.front(), progress);
  request.camera = arguments.camera.camera();
  request.size = arguments.camera.size();
  request.sequence = arguments.sequence.sequence();
  if (arguments.lights.given() || request.camera) {
    const glm::vec3 up = ptc::up_of_files(ptc::scene_files(request), request.up);
    if (arguments.lights.given()) {
      request.lights =
          arguments.lights.rig(up, *ptc::texture_store(request.run, arguments.outputs.front()));
    }
    if (request.camera) request.camera->up = up;
  }
  return ptc::render_files(request, arguments.outputs, arguments.layers, progress);
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcrender", kPurpose, kExamples);
  Arguments arguments;
  declare_scene(command, arguments);
  declare_picture(command, arguments);
  arguments.sequence.declare(command.app());
  declare_lights(command.app(), arguments);
  ptc::Preset preset = ptc::Preset::none;
  ptc::add_preset(command.app(), preset);
  ptc::add_surroundings(command.app(), arguments.request.gather.around);
  ptc::add_glossy(command.app(), arguments.request.glossy, "layer");
  ptc::add_quality_options(command.app(), arguments.request);
  ptc::add_back_end(command.app(), arguments.request.back_end);
  return command.run(argc, argv, [&](ptc::Progress& progress) {
    ptc::apply_preset(command.app(), preset, arguments.request);
    if (!arguments.sequence.sequence())
      ptc::note_unused(command.app(), {"--fps"}, "one picture is rendered", progress);
    if (arguments.camera.camera())
      ptc::note_unused(command.app(), {"--camera-file"}, "--camera is given", progress);
    return render(arguments, command.run_options(), progress);
  });
}
