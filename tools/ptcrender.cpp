// ptcrender: a picture of a scene, lit directly by rays and indirectly by its surfels.
#include <set>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "tools/common.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Renders a picture: direct light by rays, indirect light gathered from the container.";
constexpr char kExamples[] =
    "  ptcrender dragon.ptcx --mesh dragon.ply --backdrop -o dragon.png\n"
    "  ptcrender room.ptcx --camera 0,1.6,4,0,1.2,0 --fov 50 --size 1920x1080 -o room.exr\n"
    "  ptcrender dragon.ptcx --error 3% --check 1000 -o dragon.exr\n"
    "  ptcrender city.ptcx --memory 512M --samples 16 --exposure 0.5 --progress -o city.png\n";

struct Arguments {
  ptc::RenderRequest request;
  std::vector<std::filesystem::path> outputs;
  std::vector<ptc::PictureTarget> layers;
  ptc::LightArguments lights;
  ptc::CameraArguments camera;
};

void add_layers(ptc::Command& command, Arguments& arguments) {
  static const std::set<std::string> kLayers{"direct", "indirect", "occlusion", "albedo"};
  const auto check = [](const std::string& text) {
    const std::size_t equals = text.find('=');
    const bool known = kLayers.contains(text.substr(0, equals)) && ptc::has_ending(text, ".png");
    return known && equals != std::string::npos
               ? std::string()
               : "expects direct=, indirect=, occlusion= or albedo= and a name in .png, not '" +
                     text + "'";
  };
  command.app()
      .add_option_function<std::vector<std::string>>(
          "--layer",
          [&](const std::vector<std::string>& values) {
            for (const std::string& text : values) {
              const std::size_t equals = text.find('=');
              arguments.layers.push_back({text.substr(equals + 1), text.substr(0, equals)});
            }
          },
          "Also write direct, indirect, occlusion or albedo as a PNG; repeatable")
      ->type_name("LAYER=FILE.png")
      ->allow_extra_args(false)
      ->check(check);
}

void declare_scene(ptc::Command& command, Arguments& arguments) {
  ptc::RenderRequest& request = arguments.request;
  command.add_input("scene", request.scene, "Container that gives the indirect light")->required();
  command.add_outputs("-o,--output", arguments.outputs, {".exr", ".png"},
                      "The picture: .exr with all layers, or .png; repeatable");
  add_layers(command, arguments);
  command.add_inputs("--mesh", request.meshes,
                     "Mesh that the camera sees, repeatable [default: the surfels themselves]");
  command.app().add_flag("--backdrop", request.backdrop,
                         "Set the meshes on a ground before a red wall, as ptcbuild does");
}

void declare_picture(CLI::App& app, Arguments& arguments) {
  constexpr char kGroup[] = "Picture";
  arguments.camera.declare(
      app, "Its place and what it looks at [default: the mesh's, the build's, a view of all]");
  ptc::add_integer(app, "--samples", arguments.request.samples, 1, 4096,
                   "Rays a pixel, a square number")
      ->check(CLI::Validator(
          [](std::string& text) {
            const std::uint64_t count = std::stoull(text);
            std::uint64_t side = 1;
            while (side * side < count) ++side;
            return side * side == count ? std::string()
                                        : "expects a square number (1, 4, 9, 16 ...), not " + text;
          },
          ""))
      ->group(kGroup);
  ptc::add_number(app, "--exposure", arguments.request.exposure, -64, 64, "Stops, for a .png")
      ->group(kGroup);
}

void declare_lights(CLI::App& app, Arguments& arguments) {
  arguments.lights.declare(app);
  ptc::add_light_sampling(app, arguments.request.light_sampling);
}

/// A cloud would be passed over in silence: the camera would see the surfels instead.
void refuse_clouds(const std::vector<std::filesystem::path>& meshes) {
  for (const std::filesystem::path& path : meshes) {
    if (!ptc::is_point_file(path)) continue;
    throw ptc::DataError(path.string() + ": offset 0: a cloud, where --mesh takes a mesh");
  }
}

ptc::Outcome render(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  ptc::RenderRequest& request = arguments.request;
  refuse_clouds(request.meshes);
  request.run = run;
  request.camera = arguments.camera.camera();
  request.size = arguments.camera.size();
  if (arguments.lights.given()) request.lights = arguments.lights.rig();
  std::vector<ptc::PictureTarget> targets = arguments.layers;
  for (const auto& output : arguments.outputs) targets.push_back({.path = output});
  const ptc::LightingReport report = ptc::render_picture(request, targets, progress);
  std::vector<std::string> names;
  for (const ptc::PictureTarget& target : targets) names.push_back(target.path.string());
  nlohmann::ordered_json facts{{"outputs", names}};
  facts.update(ptc::facts_of(report));
  return {facts, ptc::shade_text(names.back(), report)};
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcrender", kPurpose, kExamples);
  Arguments arguments;
  declare_scene(command, arguments);
  declare_picture(command.app(), arguments);
  declare_lights(command.app(), arguments);
  ptc::add_bounces(command.app(), arguments.request.bounces);
  ptc::add_gather_options(command.app(), arguments.request.gather, arguments.request.lift);
  ptc::add_error_option(command.app(), arguments.request.error);
  ptc::add_estimate_option(command.app(), arguments.request.estimate);
  ptc::add_back_end(command.app(), arguments.request.back_end);
  ptc::add_tolerate_damage(command.app(), arguments.request.tolerate_damage);
  ptc::add_check_options(command.app(), arguments.request.check);
  return command.run(argc, argv, [&](ptc::Progress& progress) {
    return render(arguments, command.run_options(), progress);
  });
}
