// ptcbench: what shading costs and how wrong it is, beside a ray tracer in the same run.
#include <filesystem>

#include "tools/bench/accuracy.h"
#include "tools/bench/accuracy_report.h"
#include "tools/common.h"
#include "tools/values.h"

namespace {

using namespace ptc::bench;

constexpr char kPurpose[] =
    "Measures time and error together, against rays at the same scene in the same run, and draws charts\n"
    "of one against the other.";
constexpr char kExamples[] =
    "  ptcbench accuracy --quick -o charts\n"
    "  ptcbench accuracy fractal window city dragon.ply.gz+backdrop sponza.obj -o charts\n";

struct Arguments {
  std::vector<std::string> scenes{"fractal", "window", "city"};
  std::filesystem::path directory;
  AccuracyOptions accuracy;
  bool quick = false;
};

void declare_accuracy(CLI::App& app, Arguments& arguments) {
  CLI::App& command = *app.add_subcommand("accuracy", "Time per receiver against error: PTCX over its settings, the plain "
                                                      "gather, Embree on the same discs and on the mesh");
  command.fallthrough();
  command.add_option("scenes", arguments.scenes,
                     "fractal, window, city, or files of meshes and clouds; +backdrop behind a mesh's name sets it on a "
                     "ground before a wall")
      ->type_name("SCENE")
      ->capture_default_str();
  command.add_option("-o,--output", arguments.directory, "Directory for accuracy.json, .csv, .svg and .png")
      ->type_name("DIR")
      ->required();
  command.add_flag("--quick", arguments.quick, "The first scene alone, smaller, in under a minute");
  AccuracyOptions& options = arguments.accuracy;
  ptc::add_count(command, "--points", options.scene.points, "Surfels wanted of a mesh or the city; k, M, G count by 1000")
      ->default_str("2M");
  ptc::add_integer(command, "--checked", options.checked, 10, 1'000'000, "Receivers of each set whose error is measured");
  ptc::add_integer(command, "--reference-rays", options.reference_rays, 16, 65536,
                   "Rays of each half of a reference, a power of two");
  ptc::add_integer(command, "--repeats", options.repeats, 1, 1000, "Runs of every method");
}

/// What --quick leaves of a run.
void shorten(Arguments& arguments) {
  arguments.scenes.resize(1);
  AccuracyOptions& options = arguments.accuracy;
  options.scene.points = std::min<std::uint64_t>(options.scene.points, 300'000);
  options.scene.width = 320;
  options.scene.height = 180;
  options.scene.window_width = 64;
  options.scene.window_height = 36;
  options.scene.own_points = 20'000;
  options.checked = std::min(options.checked, 200U);
  options.repeats = std::min(options.repeats, 3U);
  options.rays = {64, 256, 1024};
  options.plain_solid_angles = {0.01F};
}

ptc::Outcome measure(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments);
  std::filesystem::create_directories(arguments.directory);
  const std::filesystem::path work = run.temp_dir.empty() ? arguments.directory : run.temp_dir;
  const ptc::Executor executor(run.threads);
  std::vector<SceneAccuracy> scenes;
  for (const std::string& text : arguments.scenes) {
    const BenchScene scene(parse_scene(text), arguments.accuracy.scene, work, run, progress);
    scenes.push_back(measure_accuracy(scene, arguments.accuracy, executor, progress));
    write_reports(arguments.directory, scenes);  // of those done, should a later one fail
  }
  return {facts_of(scenes), accuracy_text(scenes)};
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcbench", kPurpose, kExamples);
  Arguments arguments;
  declare_accuracy(command.app(), arguments);
  command.app().require_subcommand(1);
  return command.run(argc, argv, [&](ptc::Progress& progress) { return measure(arguments, command.run_options(), progress); });
}
