// ptcbake: bakes the light of a scene into a texture or the vertices of its meshes.
#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "engine/base/error.h"
#include "engine/io/text/text.h"
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
    "Bakes occlusion, irradiance and bent normals into a texture or the vertices of a mesh.\n"
    "Each texel or vertex is shaded at its place on the surface, as ptcrender shades a pixel. For "
    "a texture the mesh needs texture coordinates that cover it without overlap.\n"
    "\n"
    "An .exr holds the layers irradiance, direct, indirect, occlusion, bent_normal, albedo, "
    "object_id and material_id, and as picture the radiance that leaves the surface. A .png holds "
    "one of the layers. Texels next to an island show its edge; alpha leaves them out. With <UDIM> "
    "in the name of the output there is a file for each tile of the texture coordinates: 1001, "
    "1002 and so on.\n"
    "\n"
    "A .ply holds the mesh with all of these but the numbers of objects and materials at its "
    "vertices, and with colours as a picture has them. A .glb holds the mesh with COLOR_0: the "
    "light by which the base colour is multiplied.";
constexpr char kExamples[] =
    "  # Bake the light of a room, and its occlusion as a PNG\n"
    "  ptcbake room.obj -o room.exr --layer occlusion=ao.png\n"
    "  # Bake a prop where it stands in a scene that was built before\n"
    "  ptcbake scene.ptcx --mesh prop.glb --size 2048 -o prop.exr\n"
    "  # Bake the vertices of a mesh, and its occlusion as COLOR_0\n"
    "  ptcbake statue.ply -o lit.ply --layer occlusion=statue.glb\n"
    "  # Bake each tile of a character under the sky of a picture\n"
    "  ptcbake character.obj --sky sunset.exr -o 'light.<UDIM>.exr'\n";

/// The layers that a .png may show, without the picture itself.
constexpr std::array<std::string_view, 7> kLayers{
    "irradiance", "direct", "indirect", "occlusion", "albedo", "object_id", "material_id"};

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
  command.add_outputs(
      "-o,--output", arguments.outputs, {".exr", ".png", ".ply", ".glb"},
      "Texture or mesh to write; repeatable\n"
      "A texture is an .exr with all layers or a .png, a mesh a .ply with all or a .glb.");
  ptc::add_layers(app, arguments.layers, kLayers, {".png", ".glb", ".ply"});
  command.add_inputs("--mesh", request.meshes, ptc::mesh_endings(),
                     "Mesh that is baked; repeatable\n"
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

/// Says whether the outputs are meshes. @throws ptc::RequestError when only some of them are
bool bakes_vertices(const Arguments& arguments) {
  std::vector<std::filesystem::path> paths = arguments.outputs;
  for (const ptc::PictureTarget& target : arguments.layers) paths.push_back(target.path);
  const auto meshes = std::ranges::count_if(paths, [](const std::filesystem::path& path) {
    const std::string ending = ptc::lower_extension(path);
    return ending == ".ply" || ending == ".glb";
  });
  if (meshes > 0 && meshes != std::ssize(paths))
    throw ptc::RequestError("targets",
                            "a run bakes a texture or vertices: name pictures or meshes");
  return meshes > 0;
}

/// Bakes the texture or the vertices, and reports them.
ptc::Outcome bake(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  ptc::RenderRequest& request = arguments.request;
  request.run = run;
  if (!request.vertices) request.texture = arguments.texture;
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
    arguments.request.vertices = bakes_vertices(arguments);
    if (arguments.request.vertices)
      ptc::note_unused(command.app(), {"--margin"}, "no texture is baked", progress);
    return bake(arguments, command.run_options(), progress);
  });
}
