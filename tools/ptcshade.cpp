// ptcshade: the light that arrives at every point of a scene, or at given receivers.
#include "tools/common.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Gathers occlusion, bent normal and indirect light at every point of a container, or at other\n"
    "receivers, and writes them as channels of a container or columns of a PLY.";
constexpr char kExamples[] =
    "  ptcshade dragon.ptcx -o lit.ptcx\n"
    "  ptcshade city.ptcx --memory 1G --threads 8 --progress -o lit.ptcx\n"
    "  ptcshade room.ptcx --bounces 4 -o lit.ptcx\n"
    "  ptcshade dragon.ptcx --error 2% --check 1000 -o lit.ptcx\n"
    "  ptcshade room.ptcx --receivers probes.ply --sky 0.4 -o probes-lit.ply\n";

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcshade", kPurpose, kExamples);
  CLI::App& app = command.app();
  ptc::ShadeRequest request;
  std::filesystem::path output;
  ptc::LightArguments lights;
  command.add_input("scene", request.scene, "Container whose surfels occlude and emit")->required();
  command.add_output("-o,--output", output, {".ptcx", ".ply"}, "What to write: .ptcx or .ply");
  command.add_input("--receivers", request.receivers,
                    "Cloud or container to shade [default: the scene's own points]");
  ptc::add_count(app, "--count", request.count,
                 "Shade only so many of the points, evenly spread, into a .ply; k, M, G count by "
                 "1000 [default: all]");
  lights.declare_sky(app);
  app.get_option("--sky")->description(
      "Radiance from everywhere, or a latitude-longitude picture of it [default: as built]");
  ptc::add_bounces(app, request.bounces);
  ptc::add_gather_options(app, request.gather, request.lift);
  ptc::add_error_option(app, request.error);
  ptc::add_estimate_option(app, request.estimate);
  ptc::add_back_end(app, request.back_end);
  ptc::add_tolerate_damage(app, request.tolerate_damage);
  ptc::add_check_options(app, request.check);

  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    request.run = command.run_options();
    if (lights.sky_given()) request.sky = lights.sky();
    const ptc::LightingReport report = ptc::shade_container(request, output, progress);
    nlohmann::ordered_json facts{{"output", output.string()}};
    facts.update(ptc::facts_of(report));
    return {facts, ptc::shade_text(output.string(), report)};
  });
}
