// ptcbench: measures the costs and the errors of PTCX, next to those of its rivals and to the
// limits of the machine, in the same run. Each experiment is a subcommand
// (tools/bench/experiments):
//
//   command line -> Experiment -> Report -> DIR/NAME.json, .csv, .svg, .png     -o DIR
//                                        -> DIR/NAME.md                         --results DIR
#include <algorithm>
#include <filesystem>
#include <list>
#include <span>
#include <utility>

#include "engine/io/file/disk_space.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/report/results.h"
#include "tools/common.h"
#include "tools/values.h"

namespace {

using namespace ptc::bench;

constexpr char kPurpose[] =
    "Measures time, memory and accuracy of PTCX next to other methods.\n"
    "Each command measures one subject, and writes tables and draws charts. Errors are measured "
    "against rays that are traced in the same scene; sort, build and verification are compared "
    "with a disk that moves the same bytes.\n"
    "\n"
    "The scenes of accuracy, error, growth and model are held in memory whole, whatever the cap on "
    "memory.";
constexpr char kExamples[] =
    "  # Measure the accuracy in little time\n"
    "  ptcbench accuracy --quick -o charts\n"
    "  # Measure the accuracy in several scenes, or of one method with one setting\n"
    "  ptcbench accuracy fractal window city dragon.ply.gz+backdrop sponza.obj -o charts\n"
    "  ptcbench accuracy room.obj --set camera --method ptcx --setting 0.02,0.1,32 -o charts\n"
    "  # Measure the demo, and write a page of results\n"
    "  ptcbench demo dragon.ply.gz+backdrop --memory 256M -o charts --results results\n"
    "  # Compare the error that is asked for with the error that is met\n"
    "  ptcbench error fractal window city dragon.ply.gz+backdrop -o charts\n"
    "  # Measure how time grows with the number of surfels\n"
    "  ptcbench growth --points 2M --points 20M --points 200M --panel surfels --temp /scratch -o "
    "charts\n"
    "  # Compare what the nodes may hold\n"
    "  ptcbench model fractal window dragon.ply.gz+backdrop -o charts\n"
    "  # Compare pictures of rooms with path tracing, in little time and of a file\n"
    "  ptcbench rooms --quick -o charts\n"
    "  ptcbench rooms room.glb --size 320x240 --paths 4096 --pictures pictures -o charts\n"
    "  # Measure sort and build next to the disk\n"
    "  ptcbench build --points 1M --points 20M --points 200M --memory 1G --temp /scratch -o "
    "charts\n"
    "  # Measure sizes that are larger than memory\n"
    "  ptcbench scale --points 1700M --repeats 1 --memory 2G --temp /scratch -o charts\n"
    "  ptcbench sort --points 200M --panel disk --order city --memory 1G --temp /scratch -o "
    "charts\n"
    "  # Measure a verification in little time\n"
    "  ptcbench verify --quick -o charts\n";

/// The options that all experiments take.
struct Arguments {
  std::filesystem::path directory;  ///< directory of facts, tables and charts
  std::filesystem::path results;    ///< directory of NAME.md; empty: none is written
  std::string name;                 ///< NAME of all files; empty: the experiment's
  std::string commit;               ///< commit, where the build does not know it
  bool quick = false;
};

/// Refuses names of files in other directories, and names of hidden files.
std::string check_name(const std::string& name) {
  const bool plain = !name.empty() && name.front() != '.' && name.find('/') == std::string::npos;
  return plain ? std::string()
               : "expects the name of a file without its ending, not '" + name + "'";
}

void declare_results(CLI::App& command, Arguments& arguments) {
  constexpr char kGroup[] = "Results";
  command
      .add_option(
          "--results", arguments.results,
          "Also write NAME.md there, with machine, commit, date, command, tables and charts")
      ->type_name("DIR")
      ->group(kGroup);
  command
      .add_option("--name", arguments.name,
                  "NAME of all files that are written [default: the experiment's]")
      ->type_name("NAME")
      ->check(CLI::Validator(check_name, ""))
      ->group(kGroup);
  command
      .add_option("--commit", arguments.commit,
                  "Commit of the sources, where the program was built outside of git")
      ->type_name("TEXT")
      ->group(kGroup);
}

/// Declares the options of all experiments, and those of this one.
void declare(Declaration& declaration, const Experiment& experiment, Arguments& arguments) {
  CLI::App& command = declaration.command();
  command.fallthrough();
  command
      .add_option("-o,--output", arguments.directory,
                  "Directory for NAME.json, for tables (.csv) and for charts (.svg, .png)")
      ->type_name("DIR")
      ->required();
  command.add_flag("--quick", arguments.quick,
                   std::string(experiment.quick) + "; options that are given keep their values");
  experiment.declare(declaration);
  declare_results(command, arguments);
}

/// Runs an experiment, and writes its files after each part and at the end.
ptc::Outcome run(const Experiment& experiment, const Arguments& arguments,
                 const ptc::RunOptions& run_options, ptc::Progress& progress,
                 const Circumstances& circumstances) {
  // Refuse what cannot be measured, before anything is written
  if (experiment.check) experiment.check();
  std::filesystem::create_directories(arguments.directory);
  if (!arguments.results.empty()) std::filesystem::create_directories(arguments.results);
  nlohmann::ordered_json written;  // facts of the report whose files are there
  const auto write = [&](Report report) {
    if (!arguments.name.empty()) report.name = arguments.name;
    if (nlohmann::ordered_json facts = facts_of(report); facts != written) {
      write_files(arguments.directory, report);
      written = std::move(facts);
    }
    return report;
  };
  // Measure
  const std::filesystem::path work =
      run_options.temp_dirs.empty() ? arguments.directory : ptc::roomiest(run_options.temp_dirs);
  const Report report = write(
      experiment.run({.work = work, .run = run_options, .progress = progress, .publish = write}));
  if (!arguments.results.empty()) write_results(arguments.results, report, circumstances);
  return {facts_of(report), text_of(report)};
}

}  // namespace

int main(int argc, char** argv) {
  // Declare a subcommand for each experiment
  ptc::Command command("ptcbench", kPurpose, kExamples);
  Arguments arguments;
  std::list<std::pair<Experiment, Declaration>> all;
  for (const auto make :
       {make_accuracy_experiment,  make_build_experiment,        make_cache_experiment,
        make_demo_experiment,      make_error_experiment,        make_farm_experiment,
        make_formats_experiment,   make_glossy_experiment,       make_growth_experiment,
        make_hunt_experiment,      make_instructions_experiment, make_knob_experiment,
        make_model_experiment,     make_mutations_experiment,    make_relight_experiment,
        make_remote_experiment,    make_rooms_experiment,        make_scale_experiment,
        make_scan_experiment,      make_sort_experiment,         make_specks_experiment,
        make_stability_experiment, make_surfels_experiment,      make_tolerance_experiment,
        make_truth_experiment,     make_verify_experiment}) {
    const Experiment experiment = make();
    CLI::App* const app = command.app().add_subcommand(experiment.name, experiment.purpose);
    auto& [kept, declaration] = all.emplace_back(experiment, Declaration(*app));
    declare(declaration, kept, arguments);
  }
  // Run the one that was chosen
  command.app().require_subcommand(1);
  return command.run(argc, argv, [&](ptc::Progress& progress) {
    const auto& [experiment, declaration] =
        *std::ranges::find_if(all, [](const auto& one) { return one.second.command().parsed(); });
    if (arguments.quick) declaration.shorten();
    const std::span line(argv, static_cast<std::size_t>(argc));
    return run(experiment, arguments, command.run_options(), progress,
               circumstances_of(line, arguments.commit));
  });
}
