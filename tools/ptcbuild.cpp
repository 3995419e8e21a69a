// ptcbuild: meshes and clouds to a lit, sorted, hierarchical container.
#include <fmt/format.h>

#include "engine/pipeline/build/append.h"
#include "format/node_page.h"
#include "tools/common.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Samples and lights meshes, reads clouds, sorts everything along the Z-curve under a memory\n"
    "cap and writes a container with an octree.";
constexpr char kExamples[] =
    "  ptcbuild dragon.ply --backdrop -o dragon.ptcx\n"
    "  ptcbuild sponza.obj --points 20M --sun 30,60,4 --sky 0.5,0.6,0.8 -o sponza.ptcx\n"
    "  ptcbuild scan.ply --memory 512M --progress -o scan.ptcx\n"
    "  ptcbuild huge.ply --resume --temp . --temp /scratch -o huge.ptcx\n"
    "  ptcbuild annex.ply --append scan.ptcx -o scan.ptcx\n"
    "  ptcbuild --city 100M --memory 1G --temp /scratch -o city.ptcx\n";

/// What the command line says beyond the request itself.
struct Arguments {
  ptc::BuildRequest request;
  std::filesystem::path output;
  ptc::LightArguments lights;
  ptc::CameraArguments camera;
  bool no_default_lights = false;
};

void declare_scene(ptc::Command& command, Arguments& arguments) {
  CLI::App& app = command.app();
  ptc::BuildRequest& request = arguments.request;
  CLI::Option* inputs =
      command.add_inputs("inputs", request.inputs,
                         "Meshes (OBJ, PLY, OFF, glTF, GLB) and clouds (PLY, XYZ), also .gz");
  command.add_output("-o,--output", arguments.output, {".ptcx"}, "The container to write");
  ptc::add_count(app, "--city", request.city_points,
                 "A procedural city of about so many points, no inputs")
      ->excludes(inputs);
  command
      .add_input("--append", request.append,
                 "A container whose points, lights and profile go before the inputs")
      ->excludes("--city");
  app.add_flag("--backdrop", request.backdrop, "Set the meshes on a ground before a red wall");
}

void declare_sampling(CLI::App& app, Arguments& arguments) {
  constexpr char kGroup[] = "Sampling";
  ptc::SamplingOptions& sampling = arguments.request.sampling;
  CLI::Option* points = ptc::add_points(app, sampling.count);
  ptc::add_number(app, "--spacing", sampling.spacing, 1e-30, 1e30,
                  "Distance between neighbours instead, scene units")
      ->default_str("")
      ->excludes(points)
      ->group(kGroup);
  arguments.camera.declare(app, "Sample finer where this camera looks close");
  ptc::add_number(app, "--pixels-per-surfel", sampling.pixels_per_surfel, 0.01, 1000,
                  "At most so many pixels between neighbours in its view")
      ->group("Camera");
  ptc::add_number(app, "--finest", sampling.finest, 0.001, 1,
                  "But never below this share of the spacing")
      ->group("Camera");
}

void declare_lights(CLI::App& app, Arguments& arguments) {
  arguments.lights.declare(app);
  app.add_flag("--no-default-lights", arguments.no_default_lights,
               "Without any light: no sun from 40,50 and no bluish sky of 0.8")
      ->group("Lights");
  ptc::add_light_sampling(app, arguments.request.sampling.lights);
}

void declare_container(CLI::App& app, ptc::BuildRequest& request) {
  ptc::add_profile(app, request.profile)->group("Container");
  ptc::add_page_size(app, request.page_shift)->group("Container");
  ptc::add_integer(app, "--leaf", request.tree.leaf_points, 1, ptc::kMaxLeafPoints,
                   "Cells with no more points are not split")
      ->group("Container");
  ptc::add_integer(app, "--levels-per-stream", request.tree.levels_per_stream, 1, 63,
                   "Octree levels that share a stream of node pages")
      ->group("Expert");
}

void declare_resume(CLI::App& app, ptc::BuildRequest& request) {
  constexpr char kGroup[] = "Resume";
  CLI::Option* resume = app.add_flag("--resume", request.resume,
                                     "Leave what it takes to go on, and go on with what there is")
                            ->group(kGroup);
  ptc::add_count(app, "--checkpoint", request.checkpoint_points,
                 "Points that are built again at most, about")
      ->needs(resume)
      ->group(kGroup);
}

/// What is not given is that of the scene which is added to.
void adopt_settings(Arguments& arguments, ptc::Command& command) {
  if (arguments.lights.given() || arguments.no_default_lights) {
    throw CLI::ExcludesError("--append", "lights: the scene has its own");
  }
  const auto given = [&](const char* option) { return command.app().count(option) > 0; };
  const ptc::ContainerReader scene(arguments.request.append);
  if (!given("--profile")) ptc::adopt_profile(arguments.request, scene);
  if (!given("--page-size")) ptc::adopt_page_size(arguments.request, scene);
  if (!given("--leaf")) ptc::adopt_leaves(arguments.request, scene);
}

ptc::Outcome build(Arguments& arguments, ptc::Command& command, ptc::Progress& progress) {
  ptc::BuildRequest& request = arguments.request;
  if (request.inputs.empty() && request.city_points == 0) {
    throw CLI::RequiredError("a mesh, a cloud or --city");
  }
  request.run = command.run_options();
  request.sampling.camera = arguments.camera.camera();
  if (arguments.lights.given() || arguments.no_default_lights)
    request.lights = arguments.lights.rig();
  if (request.city_points > 0 && arguments.lights.given())
    throw CLI::ExcludesError("--city", "lights: it has its own");
  if (!request.append.empty()) adopt_settings(arguments, command);
  const ptc::BuildReport report = ptc::build_container(request, arguments.output, progress);

  const ptc::Superblock& made = report.superblock;
  nlohmann::ordered_json facts{{"output", arguments.output.string()}};
  facts.update(ptc::container_facts(made));
  if (request.resume) facts["resumed_points"] = report.resumed_points;
  facts["space"] = ptc::facts_of(report.space);
  facts["sort"] = ptc::facts_of(report.sort);
  facts["seconds"] = ptc::facts_of(report.seconds);
  return {facts, fmt::format("{}: {} points, {} nodes on {} levels, {} pages, {}, {:.2f} s\n{}",
                             arguments.output.string(), made.points, made.nodes, made.levels,
                             made.page_count, ptc::bytes_text(made.file_bytes),
                             ptc::total_seconds(report.seconds), ptc::stages_text(report.seconds))};
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcbuild", kPurpose, kExamples);
  Arguments arguments;
  declare_scene(command, arguments);
  declare_sampling(command.app(), arguments);
  declare_lights(command.app(), arguments);
  declare_container(command.app(), arguments.request);
  declare_resume(command.app(), arguments.request);
  return command.run(argc, argv,
                     [&](ptc::Progress& progress) { return build(arguments, command, progress); });
}
