// ptclight: lights the surfels of a scene anew.
#include <fmt/format.h>

#include "engine/pipeline/budgets.h"
#include "engine/pipeline/light/built_scene.h"
#include "tools/common.h"
#include "tools/inputs.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Lights the surfels of a container by other suns, lamps and skies.\n"
    "The light that the surfels reflect is made anew, in place of what was there: suns, point "
    "lights, spot lights and the surfels that emit light them by shadow rays through the "
    "container, and the sky by a gather. No mesh is needed, and the container may be larger than "
    "memory. Positions, colours, channels and the tree stay as they are. Clouds are lit in the "
    "same way; of clouds and meshes a container is built first, in a temporary file.\n"
    "\n"
    "Without lights those that the container records light it again: after points were appended, "
    "for example. The same command gives the same bytes for any number of threads and any cap on "
    "memory.";
constexpr char kExamples[] =
    "  # Move the sun of a scene\n"
    "  ptclight dragon.ptcx --sun 200,15,4 --sky 0.2,0.3,0.5 -o evening.ptcx\n"
    "  # Light a scan by a picture of the sky\n"
    "  ptclight scan.laz --sky studio.exr -o scan.ptcx\n"
    "  # Light a room by a lamp and a spot light\n"
    "  ptclight room.ptcx --point 0,2,0,60W --spot 2,2,0,0,-1,0,40,0.2,300cd -o lit.ptcx\n"
    "  # Let the recorded lights shine on points that were added, too\n"
    "  ptclight joined.ptcx -o lit.ptcx\n";

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptclight", kPurpose, kExamples);
  CLI::App& app = command.app();
  ptc::LightRequest request;
  std::filesystem::path output;
  ptc::LightArguments lights;
  ptc::SceneArguments scene;
  scene.declare(command, "Container, clouds or meshes whose surfels are lit");
  command.add_output("-o,--output", output, {".ptcx"}, "Container to write (.ptcx)");
  lights.declare(app);
  ptc::add_shadow_rays(app, request.light_sampling);
  ptc::add_gather_options(app, request.gather, request.lift);
  ptc::add_back_end(app, request.back_end);

  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    request.run = command.run_options();
    scene.apply(request, output, progress);
    if (lights.given())
      request.lights = lights.rig(ptc::up_of_files(ptc::scene_files(request), request.up),
                                  *ptc::texture_store(request.run, output));
    const ptc::LightReport report = ptc::light_container(request, output, progress);
    nlohmann::ordered_json facts{{"output", output.string()}};
    facts.update(ptc::facts_of(report));
    return {facts, ptc::light_text(output.string(), report)};
  });
}
