// ptcconvert: converts between containers, clouds and meshes.
//
//   input        output
//   container    .ply, .xyz    container_to_ply(), container_to_xyz()
//   container    .ptcx         recode_container()
//   cloud, mesh  .ptcx         build_container()
#include <fmt/format.h>

#include "engine/io/cloud/points.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/run.h"
#include "tools/common.h"
#include "tools/options.h"
#include "tools/report.h"

namespace {

constexpr char kPurpose[] =
    "Converts containers, clouds and meshes into one another.\n"
    "The ending of OUTPUT says what to write. A container becomes a .ply with all its channels, an "
    ".xyz with its points, or a .ptcx in another profile or page size. A cloud or a mesh becomes a "
    ".ptcx as ptcbuild makes it, with the default light.";
constexpr char kExamples[] =
    "  # Write all points and channels as a cloud\n"
    "  ptcconvert lit.ptcx lit.ply\n"
    "  # Make a container of a cloud that is larger than memory\n"
    "  ptcconvert scan.xyz scan.ptcx --memory 512M --temp /scratch\n"
    "  # Store a container in fewer bytes\n"
    "  ptcconvert scene.ptcx small.ptcx --profile compact --page-size 16K\n";

/// What the command line says.
struct Arguments {
  std::filesystem::path input;
  std::filesystem::path output;
  ptc::Profile profile = ptc::Profile::exact;
  std::uint8_t page_shift = 16;
  bool page_size_given = false;
  ptc::SamplingOptions sampling;
};

/// Builds a container from a cloud or a mesh.
ptc::ConvertReport build(const Arguments& arguments, const ptc::RunOptions& run,
                         ptc::Progress& progress) {
  ptc::BuildRequest request;
  request.inputs = {arguments.input};
  request.sampling = arguments.sampling;
  request.profile = arguments.profile;
  request.page_shift = arguments.page_shift;
  request.run = run;
  ptc::BuildReport built = ptc::build_container(request, arguments.output, progress);
  return {.points = built.superblock.points,
          .superblock = built.superblock,
          .seconds = std::move(built.seconds)};
}

/// Notes options that the kinds of the input and of the output leave without effect.
void note_unused_options(const Arguments& arguments, const CLI::App& app, ptc::Progress& progress) {
  const bool is_container = ptc::is_container(arguments.input);
  if (is_container || ptc::is_point_file(arguments.input))
    ptc::note_unused(app, {"--points"}, "the input is no mesh", progress);
  if (!ptc::has_ending(arguments.output, ".ptcx"))
    ptc::note_unused(app, {"--profile", "--page-size"}, "the output is no container", progress);
}

/// Chooses the conversion by the contents of the input and the ending of the output.
ptc::ConvertReport convert(const Arguments& arguments, const ptc::RunOptions& run,
                           ptc::Progress& progress) {
  const bool to_container = ptc::has_ending(arguments.output, ".ptcx");
  if (!ptc::is_container(arguments.input)) {
    if (to_container) return build(arguments, run, progress);
    throw CLI::ValidationError("OUTPUT", "clouds and meshes are converted to .ptcx only, not to '" +
                                             arguments.output.string() + "'");
  }
  const ptc::ContainerReader container(arguments.input);
  if (to_container) {
    ptc::RecodeOptions options{.profile = arguments.profile, .run = run};
    if (arguments.page_size_given) options.page_shift = arguments.page_shift;
    return ptc::recode_container(container, arguments.output, options, progress);
  }
  ptc::MemoryBudget budget = ptc::budget_of(run.memory_bytes, "this conversion");
  ptc::charge_directory(budget, container);
  budget.require();
  const auto to_cloud =
      ptc::has_ending(arguments.output, ".ply") ? ptc::container_to_ply : ptc::container_to_xyz;
  return to_cloud(container, arguments.output, progress);
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcconvert", kPurpose, kExamples);
  Arguments arguments;
  std::vector<std::string> endings = ptc::input_endings();
  endings.insert(endings.begin(), ".ptcx");
  command.add_input("INPUT", arguments.input, endings, "Container, cloud or mesh to read")
      ->required();
  command.add_output("OUTPUT", arguments.output, {".ptcx", ".ply", ".xyz"},
                     "File to write (.ptcx, .ply or .xyz)");
  ptc::add_points(command.app(), arguments.sampling.count);
  ptc::add_profile(command.app(), arguments.profile)->group("Container");
  const CLI::Option* page_size =
      ptc::add_page_size(command.app(), arguments.page_shift)->group("Container");
  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    arguments.page_size_given = page_size->count() > 0;
    note_unused_options(arguments, command.app(), progress);
    const ptc::ConvertReport report = convert(arguments, command.run_options(), progress);
    const std::uint64_t bytes = std::filesystem::file_size(arguments.output);
    nlohmann::ordered_json facts{{"output", arguments.output.string()}, {"points", report.points}};
    if (report.superblock) facts.update(ptc::container_facts(*report.superblock));
    facts["bytes"]["file"] = bytes;
    facts["seconds"] = ptc::facts_of(report.seconds);
    return {facts,
            fmt::format("{}: {} points, {}, {:.2f} s\n", arguments.output.string(), report.points,
                        ptc::bytes_text(bytes), ptc::total_seconds(report.seconds))};
  });
}
