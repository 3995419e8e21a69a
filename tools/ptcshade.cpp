// ptcshade: computes the light that arrives at every point of a scene, or at given receivers.
#include <fmt/format.h>

#include "engine/pipeline/budgets.h"
#include "engine/pipeline/light/built_scene.h"
#include "tools/common.h"
#include "tools/inputs.h"
#include "tools/options.h"
#include "tools/parse.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Computes occlusion and indirect light at the points of a container or a cloud.\n"
    "The light is gathered from the surfels of the container: clusters of the octree stand for "
    "surfels that are far away. The receivers are the points of the container or those of another "
    "file.\n"
    "\n"
    "The output has the channels occlusion (0 to 1), bent_normal (the mean direction in which a "
    "point is not covered), irradiance (from surfaces, in W/m^2), sky (irradiance from the sky) "
    "and indirect (reflected light: albedo / pi times the sum of irradiance and sky). A .ptcx "
    "output is a container with these channels; files of other formats have them beside everything "
    "that the input records of a point. Of clouds and meshes a container is built first, in a "
    "temporary file; the points of clouds are written in the order in which they came.";
constexpr char kExamples[] =
    "  # Shade every point of a container\n"
    "  ptcshade dragon.ptcx -o lit.ptcx\n"
    "  # Shade a scan, and look at it in another program\n"
    "  ptcshade scan.laz --colour-from occlusion -o scan.las\n"
    "  # Shade the tiles of a scan as one scene, or what another program writes\n"
    "  ptcshade 'tiles/*.laz' --colour-from occlusion -o scan.las\n"
    "  pdal translate in.copc.laz stdout.las | ptcshade - -o scan.las\n"
    "  # Shade a scene that is larger than memory, and show progress\n"
    "  ptcshade city.ptcx --memory 1G --threads 8 --progress -o lit.ptcx\n"
    "  # Show the corners of a closed room: only what is nearer than 2 units covers\n"
    "  ptcshade room.ptcx --distance 2 -o lit.ptcx\n"
    "  # Let light bounce four times\n"
    "  ptcshade room.ptcx --bounces 4 -o lit.ptcx\n"
    "  # Meet an error of 2 %, and measure the error at 1000 points\n"
    "  ptcshade dragon.ptcx --error 2% --check 1000 -o lit.ptcx\n"
    "  # What would the points reflect if they were rough mirrors, seen from a place?\n"
    "  ptcshade room.ptcx --glossy 0.3 --eye 0,1.6,4 -o lit.ptcx\n"
    "  # Shade probes from another file under a grey sky\n"
    "  ptcshade room.ptcx --receivers probes.ply --sky 0.4 -o probes-lit.ply\n";

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcshade", kPurpose, kExamples);
  CLI::App& app = command.app();
  ptc::ShadeRequest request;
  std::filesystem::path output;
  ptc::LightArguments lights;
  ptc::SceneArguments scene;
  std::vector<std::string> receiver_endings = ptc::cloud_endings();
  std::vector<std::string> output_endings = ptc::point_output_endings();
  for (auto* endings : {&receiver_endings, &output_endings})
    endings->insert(endings->begin(), ".ptcx");
  scene.declare(command, "Container, clouds or meshes whose surfels cast shadows and light");
  command.add_output("-o,--output", output, output_endings,
                     "File to write: .ptcx, or a file of points\n"
                     "Files of points: .las, .ply, .xyz, .pcd, .ptc, .bgeo, .usda, .usdc.");
  command.add_input("--receivers", request.receivers, receiver_endings,
                    "Cloud or container to shade [default: the points of SCENE]");
  ptc::add_count(app, "--count", request.count,
                 "Shade COUNT points, evenly spread [default: all]\n"
                 "They go into a file of points.")
      ->group(ptc::kFilesGroup);
  ptc::add_original_order(app, request.original_order,
                          "Write points in the order of the inputs of the container\n"
                          "The container must record it: ptcbuild --original-order.")
      ->group(ptc::kFilesGroup);
  ptc::add_colour_from(app, request.colour_from)->group(ptc::kFilesGroup);
  lights.declare_sky(app);
  app.get_option("--sky")->description(
      "Sky: colour, grey level or picture [default: as built]\n"
      "The picture has latitudes and longitudes; its upper edge is up: +y, or what the scene "
      "says.");
  ptc::add_bounces(app, request.bounces)->group("Lights");
  ptc::add_light_groups(app, request.light_groups, "a channel");
  ptc::Preset preset = ptc::Preset::none;
  ptc::add_preset(app, preset);
  ptc::add_surroundings(app, request.gather.around);
  ptc::add_shadows(app, request.shadows, "channel");
  ptc::add_glossy(app, request.glossy, "channel");
  app.add_option_function<std::string>(
         "--eye",
         [&request](const std::string& text) {
           const std::vector<double> n = ptc::parse_numbers("--eye", text, {3}, "X,Y,Z");
           request.eye = glm::dvec3(n[0], n[1], n[2]);
         },
         "Place from which --glossy looks [default: camera of a picture]")
      ->type_name("X,Y,Z")
      ->needs("--glossy")
      ->group("Reflections");
  ptc::add_quality_options(app, request);
  ptc::add_back_end(app, request.back_end);

  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    request.run = command.run_options();
    ptc::apply_preset(app, preset, request);
    if (lights.sky_given()) request.sky = lights.sky(*ptc::texture_store(request.run, output));
    scene.apply(request, output, progress);
    if (request.sky) request.sky->up = ptc::up_of_files(ptc::scene_files(request), request.up);
    const ptc::LightingReport report = ptc::shade_container(request, output, progress);
    const bool all_left = !report.damage || report.damage->points == 0;
    if (request.count > report.receivers && all_left) {
      progress.note(fmt::format("--count is more than there are points: all {} are shaded",
                                report.receivers));
    }
    nlohmann::ordered_json facts{{"output", output.string()}};
    facts.update(ptc::facts_of(report));
    return {facts, ptc::shade_text(output.string(), report)};
  });
}
