// ptcconvert: converts between containers, clouds and meshes.
//
//   input        output
//   container    .las, .ply, ...    container_to_points()
//   container    .ptcx              recode_container(), or build_container() of a selection
//   cloud        .las, .ply, ...    cloud_to_points()
//   cloud, mesh  .ptcx              build_container()
#include <algorithm>

#include <fmt/format.h>

#include "engine/io/cloud/points.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/pipeline/quality/simplification_choice.h"
#include "engine/pipeline/run.h"
#include "tools/common.h"
#include "tools/inputs.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Converts containers, clouds and meshes into one another.\n"
    "The ending of OUTPUT says what to write: LAS, PLY, XYZ, PCD, Pixar's .ptc, Houdini's .bgeo, "
    "USD "
    "or a container. Points keep everything that is recorded of them, as far as the format can "
    "hold "
    "it; --dry-run says what it cannot. A container becomes a container in another profile or page "
    "size. A cloud or a mesh becomes a container as ptcbuild makes it, with the default light.";
constexpr char kExamples[] =
    "  # Write all points and channels as a cloud\n"
    "  ptcconvert lit.ptcx lit.ply\n"
    "  # Write them as LAS, in the order in which they came, after a look at what would be lost\n"
    "  ptcconvert lit.ptcx lit.las --original-order --dry-run\n"
    "  ptcconvert lit.ptcx lit.las --original-order\n"
    "  # Convert a cloud\n"
    "  ptcconvert scan.laz scan.ply\n"
    "  # Take the ground within a box out of a container, and the whole scene at a coarse level\n"
    "  ptcconvert scan.ptcx ground.las --class 2 --bbox 0,0,0,100,100,50\n"
    "  ptcconvert scan.ptcx coarse.ply --level 6\n"
    "  # Make a container of a cloud that is larger than memory\n"
    "  ptcconvert scan.xyz scan.ptcx --memory 512M --temp /scratch\n"
    "  # Store a container in fewer bytes\n"
    "  ptcconvert scene.ptcx small.ptcx --profile compact --page-size 16K\n"
    "  # Store it in as few bytes as an error of 3 % allows\n"
    "  ptcconvert scene.ptcx smaller.ptcx --tolerance 3%\n";

/// What the command line says.
struct Arguments {
  std::filesystem::path input;  ///< an argument, later the file that it stands for
  std::filesystem::path output;
  ptc::Profile profile = ptc::Profile::exact;
  std::uint8_t page_shift = 16;
  bool page_size_given = false;
  ptc::PointFileOptions points;
  bool dry_run = false;
  std::string format;  ///< of standard input
  ptc::SamplingOptions sampling;
  std::optional<double> tolerance;
};

/// A conversion, and what it simplified.
struct Converted {
  ptc::ConvertReport report;
  std::optional<ptc::SimplificationChoice> choice;
};

/// Builds a container from a cloud or a mesh.
Converted build(const Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  ptc::BuildRequest request;
  request.inputs = {arguments.input};
  request.original_order = arguments.points.original_order;
  request.selection = arguments.points.selection;
  request.sampling = arguments.sampling;
  request.profile = arguments.profile;
  request.page_shift = arguments.page_shift;
  request.run = run;
  auto [built, choice] =
      ptc::build_within(request, arguments.tolerance, arguments.output, progress);
  return {{.points = built.superblock.points,
           .superblock = built.superblock,
           .seconds = std::move(built.seconds)},
          std::move(choice)};
}

/// Writes a container as a container, and simplifies it when that is asked for.
Converted recode(const Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  const ptc::ContainerReader container(arguments.input);
  ptc::RecodeOptions options{.profile = arguments.profile, .run = run};
  if (arguments.page_size_given) options.page_shift = arguments.page_shift;
  Converted made;
  ptc::StageSeconds choosing;
  if (arguments.tolerance) {
    made.choice = ptc::choose_simplification(container, *arguments.tolerance, options,
                                             arguments.output, choosing, progress);
    options = ptc::simplified(options, *made.choice);
  }
  made.report = ptc::recode_container(container, arguments.output, options, progress);
  made.report.seconds.insert(made.report.seconds.begin(), choosing.begin(), choosing.end());
  return made;
}

/// Notes options that the kinds of the input and of the output leave without effect.
void note_unused_options(const Arguments& arguments, const CLI::App& app, ptc::Progress& progress) {
  const bool is_container = ptc::is_container(arguments.input);
  if (is_container || ptc::is_point_file(arguments.input))
    ptc::note_unused(app, {"--points"}, "the input is no mesh", progress);
  if (!ptc::has_ending(arguments.output, ".ptcx"))
    ptc::note_unused(app, {"--profile", "--page-size", "--tolerance"}, "the output is no container",
                     progress);
  if (ptc::has_ending(arguments.output, ".ptcx"))
    ptc::note_unused(app, {"--colour-from"}, "the output is a container", progress);
}

/// Refuses an input that is no container and no cloud, where only these will do.
[[noreturn]] void refuse_mesh(const Arguments& arguments) {
  const auto names = [&](const std::string& ending) {
    return ptc::has_ending(arguments.input, ending);
  };
  if (std::ranges::none_of(ptc::mesh_endings(), names))
    static_cast<void>(ptc::read_mesh(arguments.input));  // says what can be read
  throw CLI::ValidationError("INPUT", "'" + arguments.input.string() +
                                          "' is a mesh, which is converted to .ptcx only, without "
                                          "--dry-run");
}

/// Returns what a container would round of points, a sentence each.
/// @param recoded   whether they are those of a container already
/// @param channels  whether they have channels
std::vector<std::string> container_losses(const Arguments& arguments, bool recoded, bool channels) {
  std::vector<std::string> losses;
  if (!recoded) {
    losses.emplace_back("Positions are rounded to 2^-42 of the edge of a cube around the points.");
    losses.emplace_back("Normals are rounded by up to 0.0001 rad, colours to 8 bits of sRGB.");
  }
  if (arguments.tolerance) {
    losses.push_back(fmt::format("Points are {}rounded as far as an error of {:.4g} % allows.",
                                 channels ? "" : "merged and ", 100 * *arguments.tolerance));
  } else if (ptc::is_rounded(arguments.profile)) {
    losses.emplace_back(
        "Positions are rounded by up to 0.001 radii, radii by 1/512, normals by 0.0021 rad, "
        "radiances by 1/256.");
  }
  return losses;
}

/// Says what the format of the output cannot hold of the points.
ptc::Outcome tell_losses(Arguments arguments, ptc::Progress& progress) {
  const bool from_container = ptc::is_container(arguments.input);
  if (!from_container && !ptc::is_point_file(arguments.input)) refuse_mesh(arguments);
  const bool to_container = ptc::has_ending(arguments.output, ".ptcx");
  const auto format = ptc::output_format(arguments.output);
  arguments.points.measure_rounding = true;
  const ptc::PointWriteInfo info =
      from_container
          ? ptc::describe_points(ptc::ContainerReader(arguments.input), arguments.points, format)
          : ptc::describe_points(arguments.input, arguments.points, format, progress);
  std::vector<std::string> losses;
  if (to_container) {
    losses = container_losses(arguments, from_container && !arguments.points.selection.level,
                              !info.channels.empty());
  } else if (format) {
    losses = ptc::losses(*format, info);
  }
  std::string text = fmt::format("{}: {} points, {} channels; {}\n", arguments.output.string(),
                                 info.count, info.channels.size(),
                                 losses.empty() ? "nothing would be lost" : "not kept as it is:");
  for (const std::string& loss : losses) text += "  " + loss + "\n";
  return {{{"output", arguments.output.string()}, {"points", info.count}, {"losses", losses}},
          text};
}

/// Chooses the conversion by the contents of the input and the ending of the output.
Converted convert(const Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  const bool to_container = ptc::has_ending(arguments.output, ".ptcx");
  if (!ptc::is_container(arguments.input)) {
    if (to_container) return build(arguments, run, progress);
    if (ptc::is_point_file(arguments.input))
      return {ptc::cloud_to_points(arguments.input, arguments.output, arguments.points, progress)};
    refuse_mesh(arguments);
  }
  const ptc::Selection& selection = arguments.points.selection;
  if (to_container && !(selection.takes_all() && !selection.channels))
    return build(arguments, run, progress);
  if (to_container) return recode(arguments, run, progress);
  return {ptc::container_to_points(ptc::ContainerReader(arguments.input), arguments.output,
                                   arguments.points, progress)};
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcconvert", kPurpose, kExamples);
  Arguments arguments;
  std::vector<std::string> endings = ptc::input_endings();
  endings.insert(endings.begin(), ".ptcx");
  std::vector<std::string> outputs = ptc::point_output_endings();
  outputs.insert(outputs.begin(), ".ptcx");
  CLI::App& app = command.app();
  ptc::offer(app.add_option("INPUT", arguments.input,
                            "Container, cloud or mesh to read, or - for standard input"),
             endings)
      ->type_name("FILE")
      ->required()
      ->group(ptc::kFilesGroup);
  command.add_output("OUTPUT", arguments.output, outputs,
                     "File to write (.ptcx, .las, .ply, .xyz, .pcd, .ptc, .bgeo, .usda, .usdc)");
  ptc::add_format(app, arguments.format);
  ptc::add_original_order(app, arguments.points.original_order,
                          "Write points in the order of the inputs of the container\n"
                          "The container must record it. A cloud that becomes a container gets the "
                          "record.")
      ->group(ptc::kFilesGroup);
  ptc::add_colour_from(app, arguments.points.colour_from)->group(ptc::kFilesGroup);
  app.add_flag("--dry-run", arguments.dry_run,
               "Write nothing; say what the format cannot hold of the points")
      ->group(ptc::kFilesGroup);
  ptc::add_selection(app, arguments.points.selection);
  ptc::add_level(app, arguments.points.selection);
  ptc::add_points(command.app(), arguments.sampling.count);
  const CLI::Option* profile =
      ptc::add_profile(command.app(), arguments.profile)->group("Container");
  ptc::add_tolerance(command.app(), arguments.tolerance)->group("Container");
  const CLI::Option* page_size =
      ptc::add_page_size(command.app(), arguments.page_shift)->group("Container");
  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    const ptc::InputFiles inputs({arguments.input}, arguments.format, command.run_options(),
                                 arguments.output);
    if (inputs.paths().size() != 1)
      throw CLI::ValidationError("INPUT", "stands for more than one file: ptcbuild joins files");
    inputs.name_in(command);
    arguments.input = inputs.paths().front();
    arguments.points.run = command.run_options();
    arguments.page_size_given = page_size->count() > 0;
    if (arguments.tolerance && profile->count() == 0) arguments.profile = ptc::Profile::compact;
    if (arguments.tolerance) ptc::check_tolerance(*arguments.tolerance, arguments.profile);
    if (arguments.dry_run) return tell_losses(arguments, progress);
    note_unused_options(arguments, command.app(), progress);
    const auto [report, choice] = convert(arguments, command.run_options(), progress);
    if (report.points == 0 && !arguments.points.selection.takes_all())
      progress.note("the selection takes no point");
    const std::uint64_t bytes = std::filesystem::file_size(arguments.output);
    nlohmann::ordered_json facts{{"output", arguments.output.string()}, {"points", report.points}};
    if (report.superblock) facts.update(ptc::container_facts(*report.superblock));
    facts["bytes"]["file"] = bytes;
    if (choice) facts["tolerance"] = ptc::facts_of(*choice);
    facts["seconds"] = ptc::facts_of(report.seconds);
    return {facts,
            fmt::format("{}: {} points, {}, {:.2f} s\n{}", arguments.output.string(), report.points,
                        ptc::bytes_text(bytes), ptc::total_seconds(report.seconds),
                        choice ? ptc::choice_text(*choice) : "")};
  });
}
