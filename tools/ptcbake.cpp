// ptcbake: bakes the light of a scene into a texture of its meshes.
#include <array>
#include <string_view>

#include "engine/base/error.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/light/built_scene.h"
#include "engine/pipeline/render/render_picture.h"
#include "tools/common.h"
#include "tools/inputs.h"
#include "tools/option_text.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Bakes occlusion, irradiance and bent normals into a texture of a mesh.\n"
    "Each texel is shaded at its place on the surface, as ptcrender shades a pixel. The mesh needs "
    "texture coordinates that cover the texture without overlap.\n"
    "\n"
    "An .exr holds the layers irradiance, direct, indirect, occlusion, bent_normal, albedo and "
    "alpha, and as picture the radiance that leaves the surface. A .png holds one of the layers. "
    "Texels next to an island show its edge; alpha leaves them out. With <UDIM> in the name of "
    "the output there is a file for each tile of the texture coordinates: 1001, 1002 and so on.";
constexpr char kExamples[] =
    "  # Bake the light of a room, and its occlusion as a PNG\n"
    "  ptcbake room.obj -o room.exr --layer occlusion=ao.png\n"
    "  # Bake a prop where it stands in a scene that was built before\n"
    "  ptcbake scene.ptcx --mesh prop.glb --size 2048 -o prop.exr\n"
    "  # Bake each tile of a character under the sky of a picture\n"
    "  ptcbake character.obj --sky sunset.exr -o 'light.<UDIM>.exr'\n";

/// The layers that a .png may show, without the picture itself.
constexpr std::array<std::string_view, 5> kLayers{"irradiance", "direct", "indirect", "occlusion",
                                                  "albedo"};

/// The request, and the arguments that are turned into it after parsing.
struct Arguments {
  ptc::RenderRequest request;
  ptc::TextureTarget texture;
  ptc::SceneArguments scene;
  std::vector<std::filesystem::path> outputs;
  std::vector<ptc::PictureTarget> layers;
  ptc::LightArguments lights;
};

void declare(ptc::Command& command, Arguments& arguments) {
  ptc::RenderRequest& request = arguments.request;
  CLI::App& app = command.app();
  arguments.scene.declare(command,
                          "Container, clouds or meshes whose surfels give the indirect light");
  command.add_outputs("-o,--output", arguments.outputs, {".exr", ".png"},
                      "Texture to write (.exr with all layers, or .png); repeatable");
  ptc::add_layers(app, arguments.layers, kLayers);
  command.add_inputs("--mesh", request.meshes, ptc::mesh_endings(),
                     "Mesh whose texture is baked; repeatable\n"
                     "By default that is the meshes of SCENE, when it has no container.");
  ptc::add_one_sided(app, request.one_sided);
  constexpr char kGroup[] = "Texture";
  ptc::add_size(app, request.size, true, "Width and height of the texture, in texels", "1024")
      ->group(kGroup);
  ptc::add_integer(app, "--margin", arguments.texture.margin, 0, 64,
                   "Texels around an island that show its edge")
      ->group(kGroup);
  ptc::add_samples(app, request.samples)->group(kGroup);
  ptc::add_exposure(app, request.exposure)->group(kGroup);
  arguments.lights.declare(app);
  ptc::add_bounces(app, request.bounces)->group("Lights");
  ptc::add_light_sampling(app, request.light_sampling);
}

/// Bakes the texture and reports it.
ptc::Outcome bake(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  ptc::RenderRequest& request = arguments.request;
  request.run = run;
  request.texture = arguments.texture;
  arguments.scene.apply(request, arguments.outputs.front(), progress);
  if (arguments.lights.given()) {
    request.lights = arguments.lights.rig(ptc::up_of_files(ptc::scene_files(request), request.up),
                                          *ptc::texture_store(run, arguments.outputs.front()));
  }
  return ptc::render_files(request, arguments.outputs, arguments.layers, progress);
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcbake", kPurpose, kExamples);
  Arguments arguments;
  declare(command, arguments);
  ptc::Preset preset = ptc::Preset::none;
  ptc::add_preset(command.app(), preset);
  ptc::add_surroundings(command.app(), arguments.request.gather.around);
  ptc::add_quality_options(command.app(), arguments.request);
  ptc::add_back_end(command.app(), arguments.request.back_end);
  return command.run(argc, argv, [&](ptc::Progress& progress) {
    ptc::apply_preset(command.app(), preset, arguments.request);
    return bake(arguments, command.run_options(), progress);
  });
}
