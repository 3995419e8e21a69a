// ptcshade: computes the light that arrives at every point of a scene, or at given receivers.
#include <fmt/format.h>

#include "tools/common.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Computes occlusion and indirect light at the points of a container.\n"
    "The light is gathered from the surfels of the container: clusters of the octree stand for "
    "surfels that are far away. The receivers are the points of the container or those of another "
    "file.\n"
    "\n"
    "The output has the channels occlusion (0 to 1), bent_normal (the mean direction in which a "
    "point is not covered), irradiance (from surfaces, in W/m^2), sky (irradiance from the sky) "
    "and indirect (reflected light: albedo / pi times the sum of irradiance and sky). A .ptcx "
    "output is a container with these channels; in a .ply they are columns.";
constexpr char kExamples[] =
    "  # Shade every point of a container\n"
    "  ptcshade dragon.ptcx -o lit.ptcx\n"
    "  # Shade a scene that is larger than memory, and show progress\n"
    "  ptcshade city.ptcx --memory 1G --threads 8 --progress -o lit.ptcx\n"
    "  # Let light bounce four times\n"
    "  ptcshade room.ptcx --bounces 4 -o lit.ptcx\n"
    "  # Meet an error of 2 %, and measure the error at 1000 points\n"
    "  ptcshade dragon.ptcx --error 2% --check 1000 -o lit.ptcx\n"
    "  # Shade probes from another file under a grey sky\n"
    "  ptcshade room.ptcx --receivers probes.ply --sky 0.4 -o probes-lit.ply\n";

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcshade", kPurpose, kExamples);
  CLI::App& app = command.app();
  ptc::ShadeRequest request;
  std::filesystem::path output;
  ptc::LightArguments lights;
  command
      .add_input("SCENE", request.scene, {".ptcx"},
                 "Container whose surfels cast shadows and light")
      ->required();
  command.add_output("-o,--output", output, {".ptcx", ".ply"}, "File to write (.ptcx or .ply)");
  command.add_input("--receivers", request.receivers, {".ptcx", ".ply", ".ply.gz", ".xyz"},
                    "Cloud or container to shade [default: the points of SCENE]");
  ptc::add_count(app, "--count", request.count,
                 "Shade only COUNT points, evenly spread, into a .ply [default: all]")
      ->group(ptc::kFilesGroup);
  lights.declare_sky(app);
  app.get_option("--sky")->description(
      "Sky: colour, grey level or latitude-longitude picture [default: as built]\n"
      "+y is up: it is the upper edge of the picture.");
  ptc::add_bounces(app, request.bounces)->group("Lights");
  ptc::add_gather_options(app, request.gather, request.lift);
  ptc::add_error_option(app, request.error);
  ptc::add_check_options(app, request.check);
  ptc::add_estimate_option(app, request.estimate);
  ptc::add_tolerate_damage(app, request.tolerate_damage);
  ptc::add_back_end(app, request.back_end);

  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    request.run = command.run_options();
    if (lights.sky_given()) request.sky = lights.sky();
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
