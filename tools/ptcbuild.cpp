// ptcbuild: builds a lit, sorted, hierarchical container from meshes and clouds.
//
//   command line -> Arguments -> BuildRequest -> build_container() -> facts and summary
#include <algorithm>

#include <fmt/format.h>

#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/append.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/scene_record.h"
#include "format/node_page.h"
#include "tools/common.h"
#include "tools/inputs.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Builds a lit PTCX container from meshes and point clouds.\n"
    "Meshes are sampled into surfels: small discs with a position, a normal, a radius, a colour "
    "and the light that they reflect. Suns, point lights, the sky and emissive triangles light "
    "them by shadow rays. Clouds keep their points, everything that is recorded of each point, and "
    "the light that they come with, unless light options say otherwise; without light they get a "
    "white sky. Missing normals and radii are estimated from the neighbours. Where clouds get "
    "lamps, "
    "and where lamps of one input shine on points of another, all points are lit by rays at the "
    "discs once they are there.\n"
    "\n"
    "All points are sorted along the Z-curve within the cap on memory, and an octree is built over "
    "them. What does not fit in memory goes through temporary files in the directory of the "
    "output, or in those that --temp names. They are removed however the program ends, unless "
    "--resume keeps them. The room that they need is stated, and checked, before work begins.\n"
    "\n"
    "The same command gives the same bytes for any number of threads and any cap on memory.";
constexpr char kExamples[] =
    "  # Build a mesh on a ground before a wall, in the default light\n"
    "  ptcbuild dragon.ply --backdrop -o dragon.ptcx\n"
    "  # Set the number of surfels, the sun and the sky\n"
    "  ptcbuild sponza.obj --points 20M --sun 30,60,4 --sky 0.5,0.6,0.8 -o sponza.ptcx\n"
    "  # Light a room by a lamp and a spot light\n"
    "  ptcbuild room.glb --point 0,2,0,60W --spot 2,2,0,0,-1,0,40,0.2,300cd -o room.ptcx\n"
    "  # Store a mesh in as few bytes as an error of 3 % allows\n"
    "  ptcbuild dragon.ply --tolerance 3% -o small.ptcx\n"
    "  # Build a large cloud on two disks; the same command goes on after an interruption\n"
    "  ptcbuild huge.ply --resume --memory 512M --temp . --temp /scratch -o huge.ptcx\n"
    "  # Build the tiles of a scan, or what another program writes\n"
    "  ptcbuild tiles/ -o scan.ptcx\n"
    "  pdal translate in.copc.laz stdout.las | ptcbuild - -o scan.ptcx\n"
    "  # Join containers, or take a part of one\n"
    "  ptcbuild north.ptcx south.ptcx -o town.ptcx\n"
    "  ptcbuild town.ptcx --bbox 0,0,0,100,100,50 -o square.ptcx\n"
    "  # Add a cloud to a container\n"
    "  ptcbuild annex.ply --append scan.ptcx -o scan.ptcx\n"
    "  # Build a procedural city that is larger than memory\n"
    "  ptcbuild --city 100M --memory 1G --temp /scratch -o city.ptcx\n";

/// The request, and the arguments that are turned into it after parsing.
struct Arguments {
  ptc::BuildRequest request;
  std::filesystem::path output;
  ptc::LightArguments lights;
  ptc::CameraArguments camera;
  bool no_default_lights = false;
  std::string format;  ///< of standard input
  std::optional<double> error, tolerance;
};

void declare_scene(ptc::Command& command, Arguments& arguments) {
  CLI::App& app = command.app();
  ptc::BuildRequest& request = arguments.request;
  CLI::Option* inputs = ptc::offer(
      app.add_option(
          "INPUT", request.inputs,
          "Mesh, cloud, container, directory, pattern, @list, or - for standard input\n"
          "Meshes: OBJ, PLY, OFF, glTF, GLB, STL. Clouds: LAS, LAZ, COPC, E57, PLY, PCD, XYZ, PTS, "
          "PTX, Pixar's .ptc, Houdini's .bgeo and .geo, Maya's .pdb. The bytes of a file tell its "
          "format; only text goes by its ending, too. OBJ, PLY, OFF and text may be packed by "
          "gzip; LAS, LAZ and E57 may not. A PLY without faces is a cloud. A directory stands for "
          "all meshes and clouds in it, @FILE for the files that its lines name."),
      ptc::input_endings());
  inputs->type_name("FILE")->group(ptc::kFilesGroup);
  ptc::add_format(app, arguments.format);
  app.add_flag("--remove-duplicates", request.remove_duplicates,
               "Keep one of the points that lie at the same place\n"
               "A note says how many were left out.")
      ->group(ptc::kFilesGroup);
  ptc::add_up(app, request.up)->group(ptc::kFilesGroup);
  ptc::add_original_order(
      app, request.original_order,
      "Record the order of the inputs\n"
      "ptcconvert and ptcshade can then write points in the order in which they came.")
      ->group(ptc::kFilesGroup);
  command.add_output("-o,--output", arguments.output, {".ptcx"}, "Container to write (.ptcx)");
  command.add_input(
      "--append", request.append, {".ptcx"},
      "Add the inputs to the points of this container\n"
      "Its points are merged with those of the inputs and not sorted again. Its lights hold; its "
      "profile, page size and leaves hold unless options say otherwise. The output may have the "
      "same name: the old file stays until the new one is complete. A container that was shaded is "
      "refused.");
  ptc::add_count(app, "--city", request.city_points,
                 "Build a procedural city of about COUNT points instead of inputs")
      ->excludes(inputs)
      ->excludes("--append")
      ->group(ptc::kFilesGroup);
  app.add_flag(
         "--backdrop", request.backdrop,
         "Set the meshes on a ground before a red wall; +y is up\n"
         "The ground lies below the lowest y of the meshes, and the wall stands to the left of "
         "their lowest x. Turn a mesh whose z is up before you build it.")
      ->group(ptc::kFilesGroup);
  ptc::add_one_sided(app, request.one_sided);
}

void declare_sampling(CLI::App& app, Arguments& arguments) {
  constexpr char kGroup[] = "Sampling";
  ptc::SamplingOptions& sampling = arguments.request.sampling;
  CLI::Option* points = ptc::add_points(app, sampling.count);
  ptc::add_number(app, "--spacing", sampling.spacing, 1e-30, 1e30,
                  "Distance between neighbouring surfels, in scene units")
      ->type_name("LENGTH")
      ->default_str("")
      ->excludes(points)
      ->group(kGroup);
  CLI::Option* adapt =
      app.add_flag("--adapt", sampling.adapts,
                   "Place more of them where meshes turn or light changes, fewer elsewhere")
          ->group(kGroup);
  ptc::add_share(
      app, "--error", arguments.error,
      "Find about the fewest surfels whose RMS error is at most SHARE\n"
      "SHARE is a percentage or a number up to 1: 3% and 0.03 are the same. The error is "
      "that of occlusion and of light, each relative to its mean, by rays at the surfels "
      "against rays at the meshes along the same directions, at places all over the "
      "meshes, or over the camera's picture. Numbers of surfels, even or adapted, are "
      "tried in temporary containers. Where more of them stop making the error smaller, "
      "the fewest that are as good are taken, and the report says so.")
      ->excludes(points)
      ->excludes("--spacing")
      ->excludes(adapt)
      ->excludes("--append")
      ->excludes("--city")
      ->group(kGroup);
}

void declare_camera(CLI::App& app, Arguments& arguments) {
  ptc::SamplingOptions& sampling = arguments.request.sampling;
  arguments.camera.declare(app, "Camera position and target: samples nearby surfaces more finely");
  ptc::add_number(app, "--pixels-per-surfel", sampling.pixels_per_surfel, 0.01, 1000,
                  "Maximum distance of neighbours in its picture, in pixels")
      ->type_name("N")
      ->group("Camera");
  ptc::add_number(app, "--finest", sampling.finest, 0.001, 1,
                  "Minimum distance of neighbours, a share of the spacing")
      ->type_name("SHARE")
      ->group("Camera");
}

void declare_lights(CLI::App& app, Arguments& arguments) {
  arguments.lights.declare(app);
  app.add_flag("--no-default-lights", arguments.no_default_lights,
               "Leave out the default sun (40,50) and bluish sky\n"
               "They light meshes when no light is given and none emits light.")
      ->group("Lights");
  ptc::add_light_sampling(app, arguments.request.sampling.lights);
}

void declare_container(CLI::App& app, Arguments& arguments) {
  ptc::BuildRequest& request = arguments.request;
  ptc::add_profile(app, request.profile)->group("Container");
  ptc::add_tolerance(app, arguments.tolerance)->excludes("--append")->group("Container");
  ptc::add_page_size(app, request.page_shift)->group("Container");
  ptc::add_integer(app, "--leaf", request.tree.leaf_points, 1, ptc::kMaxLeafPoints,
                   "Maximum number of points in a leaf of the octree")
      ->excludes("--tolerance")
      ->group("Container");
  ptc::add_integer(app, "--levels-per-stream", request.tree.levels_per_stream, 1, 63,
                   "Octree levels that share one stream of node pages")
      ->excludes("--tolerance")
      ->group(ptc::kExpertGroup);
}

void declare_resume(CLI::App& app, ptc::BuildRequest& request) {
  constexpr char kGroup[] = "Resuming";
  CLI::Option* resume =
      app.add_flag(
             "--resume", request.resume,
             "Resume an interrupted build, and keep what a later run needs\n"
             "The same command, with any --memory, --threads and further --temp directories, comes "
             "to the same bytes. The state lies next to the output in files whose names begin with "
             "OUTPUT.resume, and in the directories for temporary files. It is removed when the "
             "container is complete. All points go through temporary files. An unfinished sort "
             "starts again.")
          ->excludes("--tolerance")
          ->group(kGroup);
  ptc::add_count(app, "--checkpoint", request.checkpoint_points,
                 "Maximum number of sorted points to build again, about")
      ->default_str("4M")
      ->needs(resume)
      ->group(kGroup);
}

/// Takes the settings that are not given from the scene that is appended to.
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

/// Notes options that are for meshes when no input is a mesh.
void note_options_of_meshes(const Arguments& arguments, const CLI::App& app,
                            ptc::Progress& progress) {
  if (!std::ranges::all_of(ptc::object_files(arguments.request.inputs), ptc::holds_points)) return;
  std::vector<std::string> options{"--points",    "--spacing",           "--adapt",  "--backdrop",
                                   "--one-sided", "--pixels-per-surfel", "--finest", "--sky-rays"};
  // Lamps light clouds, too
  if (!arguments.lights.given()) options.insert(options.end(), {"--sun-rays", "--area-rays"});
  ptc::note_unused(app, options, "no input is a mesh", progress);
}

/// Builds the container and reports it.
ptc::Outcome build(Arguments& arguments, ptc::Command& command, ptc::Progress& progress) {
  // Complete and check the request.
  ptc::BuildRequest& request = arguments.request;
  if (request.inputs.empty() && request.city_points == 0) {
    throw CLI::RequiredError("INPUT or --city");
  }
  request.run = command.run_options();
  const ptc::InputFiles inputs(request.inputs, arguments.format, request.run, arguments.output);
  inputs.name_in(command);
  request.inputs = inputs.paths();
  request.input_names = inputs.names();
  request.sampling.camera = arguments.camera.camera();
  if (arguments.lights.given() || arguments.no_default_lights)
    request.lights = arguments.lights.rig(ptc::up_of_files(request.inputs, request.up),
                                          *ptc::texture_store(request.run, arguments.output));
  if (request.city_points > 0 && arguments.lights.given())
    throw CLI::ExcludesError("--city", "lights: the city has its own");
  if (!request.append.empty()) adopt_settings(arguments, command);
  note_options_of_meshes(arguments, command.app(), progress);
  if (request.append.empty()) ptc::note_unknown_up(request.inputs, request.up, progress);
  if (arguments.tolerance) ptc::check_tolerance(*arguments.tolerance, request.profile);
  ptc::StageSeconds choosing;
  std::optional<ptc::SurfelChoice> choice;
  if (arguments.error) {
    choice = ptc::choose_surfels(request, *arguments.error, arguments.output, choosing, progress);
    request.sampling.count = choice->taken.count;
    request.sampling.adapts = choice->taken.adapts;
  }
  auto [report, simplified] =
      ptc::build_within(request, arguments.tolerance, arguments.output, progress);
  report.seconds.insert(report.seconds.begin(), choosing.begin(), choosing.end());

  // Report.
  const ptc::Superblock& made = report.superblock;
  nlohmann::ordered_json facts{{"output", arguments.output.string()}};
  facts.update(ptc::container_facts(made));
  if (request.resume) facts["resumed_points"] = report.resumed_points;
  facts["space"] = ptc::facts_of(report.space);
  facts["sort"] = ptc::facts_of(report.sort);
  if (choice) facts["error"] = ptc::facts_of(*choice);
  if (simplified) facts["tolerance"] = ptc::facts_of(*simplified);
  facts["seconds"] = ptc::facts_of(report.seconds);
  return {facts,
          fmt::format("{}: {} points, {} nodes on {} levels, {} pages, {}, {:.2f} s\n{}{}{}",
                      arguments.output.string(), made.points, made.nodes, made.levels,
                      made.page_count, ptc::bytes_text(made.file_bytes),
                      ptc::total_seconds(report.seconds), choice ? ptc::choice_text(*choice) : "",
                      simplified ? ptc::choice_text(*simplified) : "",
                      ptc::stages_text(report.seconds))};
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcbuild", kPurpose, kExamples);
  Arguments arguments;
  declare_scene(command, arguments);
  ptc::add_selection(command.app(), arguments.request.selection);
  declare_sampling(command.app(), arguments);
  declare_lights(command.app(), arguments);
  declare_container(command.app(), arguments);
  declare_camera(command.app(), arguments);
  declare_resume(command.app(), arguments.request);
  return command.run(argc, argv,
                     [&](ptc::Progress& progress) { return build(arguments, command, progress); });
}
