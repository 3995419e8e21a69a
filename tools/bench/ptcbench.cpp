// ptcbench: what shading costs and how wrong it is, beside a ray tracer in the same run.
#include <bit>
#include <filesystem>
#include <functional>
#include <map>

#include "engine/base/error.h"
#include "engine/io/file/disk_space.h"
#include "tools/bench/experiments/accuracy.h"
#include "tools/bench/experiments/accuracy_report.h"
#include "tools/bench/experiments/bench_quick.h"
#include "tools/bench/experiments/build_report.h"
#include "tools/bench/experiments/cache_report.h"
#include "tools/bench/experiments/error_knob.h"
#include "tools/bench/experiments/error_report.h"
#include "tools/bench/experiments/growth.h"
#include "tools/bench/experiments/growth_report.h"
#include "tools/bench/experiments/model.h"
#include "tools/bench/experiments/model_report.h"
#include "tools/bench/experiments/options.h"
#include "tools/bench/experiments/scale_report.h"
#include "tools/bench/experiments/sort_report.h"
#include "tools/common.h"
#include "tools/values.h"

namespace {

using namespace ptc::bench;

constexpr char kPurpose[] =
    "Measures time and error together, against rays at the same scene in the same run, and draws "
    "charts\n"
    "of one against the other, of how time grows, or of what each part of the model is worth; sort "
    "and build\n"
    "beside the disk; the page cache; and all of it at growing sizes. Scenes are held in memory "
    "whole; --memory caps\n"
    "sort, build and scale alone.";
constexpr char kExamples[] =
    "  ptcbench accuracy --quick -o charts\n"
    "  ptcbench accuracy fractal window city dragon.ply.gz+backdrop sponza.obj -o charts\n"
    "  ptcbench accuracy room.obj --set camera --method ptcx --setting 0.02,0.1,32 -o charts\n"
    "  ptcbench error fractal window city dragon.ply.gz+backdrop -o charts\n"
    "  ptcbench growth --quick -o charts\n"
    "  ptcbench growth --points 2M --points 20M --points 200M --panel surfels --temp /scratch -o "
    "charts\n"
    "  ptcbench model fractal window dragon.ply.gz+backdrop -o charts\n"
    "  ptcbench build --points 1M --points 20M --points 200M --memory 1G --temp /scratch -o "
    "charts\n"
    "  ptcbench cache --quick -o charts\n"
    "  ptcbench scale --quick -o charts\n"
    "  ptcbench scale --points 1700M --repeats 1 --memory 2G --temp /scratch -o charts\n"
    "  ptcbench sort --quick -o charts\n"
    "  ptcbench sort --points 200M --panel disk --order city --memory 1G --temp /scratch -o "
    "charts\n";
constexpr char kScenes[] = "fractal, window, city, or files of meshes and clouds";

struct Arguments {
  std::vector<std::string> scenes;
  std::filesystem::path directory;
  AccuracyOptions accuracy;
  BuildBenchOptions build;
  CacheBenchOptions cache;
  ErrorOptions error;
  GrowthOptions growth;
  ModelOptions model;
  ScaleOptions scale;
  SortBenchOptions sort;
  bool quick = false;
  const CLI::App* command = nullptr;  ///< that was chosen: knows which options were given
};

void declare_choices(CLI::App& command, AccuracyOptions& options) {
  constexpr char kGroup[] = "Expert";
  const auto set = [&options](const std::vector<std::string>& values) {
    options.settings.clear();
    for (const std::string& text : values) options.settings.push_back(parse_setting(text));
  };
  command
      .add_option_function<std::vector<std::string>>(
          "--setting", set,
          "Measure PTCX with this solid angle, parallax, resolution and inflation, in place "
          "of a list from coarse to fine; repeatable")
      ->type_name("SR,RAD,R[,X]")
      ->allow_extra_args(false)
      ->group(kGroup);
  add_words(command, "--method", options.methods, "Measure this method, not all; repeatable")
      ->group(kGroup);
  add_words(command, "--set", options.sets,
            "Shade these receivers: pixels of a picture, or the scene's own points; repeatable")
      ->group(kGroup);
}

/// What every subcommand takes.
CLI::App& declare(CLI::App& app, Arguments& arguments, const char* name, const char* description,
                  const char* files) {
  CLI::App& command = *app.add_subcommand(name, description);
  command.fallthrough();
  command
      .add_option("scenes", arguments.scenes,
                  std::string(kScenes) +
                      "; +backdrop behind a mesh's name sets it on a ground before a wall "
                      "[default: fractal window city, fractal with --quick]")
      ->type_name("SCENE");
  command.add_option("-o,--output", arguments.directory, std::string("Directory for ") + files)
      ->type_name("DIR")
      ->required();
  return command;
}

void declare_accuracy(CLI::App& app, Arguments& arguments) {
  CLI::App& command = declare(app, arguments, "accuracy",
                              "Time per receiver against error: PTCX over its settings, the plain "
                              "gather, Embree on the same "
                              "discs and on the mesh",
                              "accuracy.json, .csv, .svg and .png");
  command.add_flag(
      "--quick", arguments.quick,
      "Under a minute a scene on two cores: 200k points, fewer receivers of each set (192 x 108 "
      "pixels, "
      "8k points), 200 of them checked, 3 runs of fewer settings; what other options say stays");
  AccuracyOptions& options = arguments.accuracy;
  ptc::add_count(command, "--points", options.scene.points,
                 "Surfels wanted of a mesh or the city; k, M, G count by 1000")
      ->default_str("2M");
  ptc::add_integer(command, "--checked", options.checked, 10, 1'000'000,
                   "Receivers of each set whose error is measured");
  ptc::add_integer(command, "--reference-rays", options.reference_rays, 16, 65536,
                   "Rays of each half of a reference, a power of two")
      ->check([](const std::string& text) {
        const auto rays = ptc::parse_number<unsigned>(text);
        return rays && std::has_single_bit(*rays) ? std::string()
                                                  : "must be a power of two, is " + text;
      });
  ptc::add_integer(command, "--repeats", options.repeats, 1, 1000, "Runs of every method");
  declare_choices(command, options);
}

void declare_error(CLI::App& app, Arguments& arguments) {
  CLI::App& command = declare(app, arguments, "error",
                              "Error measured against --error asked, of points and of a picture; "
                              "error against time over the "
                              "settings that --error chooses from",
                              "error.json, .csv, .svg and .png, ladder.json and .csv");
  command.add_flag("--quick", arguments.quick,
                   "Small: 50k points, a picture of 320 x 180, 400 receivers checked of each run");
  ErrorOptions& options = arguments.error;
  options.scene.points = 500'000;
  ptc::add_count(command, "--points", options.scene.points,
                 "Surfels wanted of a mesh or the city; k, M, G count by 1000")
      ->default_str("500k");
  ptc::add_integer(command, "--checked", options.checked, 10, 1'000'000,
                   "Receivers of each run whose error is measured");
  ptc::add_integer(command, "--check-rays", options.rays, 16, 1 << 20, "Rays for each of them");
}

/// A subcommand that makes what it measures.
/// @param quick  what --quick does
CLI::App& declare_timed(CLI::App& app, Arguments& arguments, const std::string& name,
                        const char* description, const std::string& quick, unsigned& repeats) {
  CLI::App& command = *app.add_subcommand(name, description);
  command.fallthrough();
  command
      .add_option("-o,--output", arguments.directory,
                  "Directory for " + name + ".json, .csv, .svg and .png")
      ->type_name("DIR")
      ->required();
  command.add_flag("--quick", arguments.quick, quick + "; what other options say stays");
  ptc::add_integer(command, "--repeats", repeats, 1, 1000, "Runs of every measurement");
  return command;
}

constexpr char kQuickRecords[] = "Under a minute on two cores: 200k and 1M points, 3 runs";

void declare_growth(CLI::App& app, Arguments& arguments) {
  GrowthOptions& options = arguments.growth;
  CLI::App& command = declare_timed(
      app, arguments, "growth",
      "Time per receiver against surfels, solid angle, depth complexity and memory, with its error",
      "Under a minute on two cores: at most 500k surfels, 8k receivers, 100 of them checked, 3 "
      "runs, no cap below 9 %",
      options.repeats);
  add_points_list(command, options.points,
                  "Surfels of a city, in place of 500k, 2M, 6M and 20M; repeatable; the greatest "
                  "is also shaded under caps. "
                  "Above 40M without a check by rays");
  add_words(command, "--panel", options.panels, "Measure against this, not all; repeatable");
  ptc::add_integer(command, "--checked", options.checked, 10, 1'000'000,
                   "Receivers whose error is measured");
}

void declare_build(CLI::App& app, Arguments& arguments) {
  CLI::App& command = declare_timed(
      app, arguments, "build",
      "Time, bytes and memory of sort and build, over points and over the cap, beside a disk that "
      "moves the same bytes",
      kQuickRecords, arguments.build.repeats);
  BuildBenchOptions& options = arguments.build;
  add_points_list(command, options.points,
                  "Points of the city, in place of 1M, 5M and 20M; repeatable");
  const auto set = [&options](const std::vector<std::string>& values) {
    options.caps.clear();
    for (const std::string& text : values) options.caps.push_back(ptc::parse_size("--cap", text));
    std::ranges::sort(options.caps);
  };
  command
      .add_option_function<std::vector<std::string>>(
          "--cap", set, "Build the most points under this cap, not under 128M to 2G; repeatable")
      ->type_name("SIZE")
      ->allow_extra_args(false);
  add_words(command, "--profile", options.profiles, "Build in this profile, not both; repeatable");
  add_words(command, "--panel", options.panels, "Measure this, not both; repeatable");
}

void declare_sort(CLI::App& app, Arguments& arguments) {
  CLI::App& command = declare_timed(
      app, arguments, "sort",
      "Time and bytes of the external sort beside those of the disk alone, and of its core beside "
      "std::sort and oneTBB",
      kQuickRecords, arguments.sort.repeats);
  SortBenchOptions& options = arguments.sort;
  add_points_list(command, options.points,
                  "Records, in place of 1M, 5M and 20M; repeatable; above 20M on disk alone");
  add_words(command, "--order", options.orders,
            "Sort records that come in this order, not all; repeatable");
  add_words(command, "--panel", options.panels, "Sort there, not both; repeatable");
}

void declare_cache(CLI::App& app, Arguments& arguments) {
  CacheBenchOptions& options = arguments.cache;
  CLI::App& command = declare_timed(
      app, arguments, "cache",
      "A page cache below the size of the scene: lookups, back ends, threads, order of receivers "
      "and of pages",
      "Two minutes on two cores: 1M points, 8k receivers, 2 runs, no cap below 9 %, at most 4 "
      "threads",
      options.repeats);
  ptc::add_count(command, "--points", options.points, "Points of the city")->default_str("6M");
  ptc::add_count(command, "--receivers", options.receivers, "Of them, in blocks of neighbours")
      ->default_str("65536");
  add_words(command, "--panel", options.panels, "Measure this, not all; repeatable");
}

void declare_scale(CLI::App& app, Arguments& arguments) {
  ScaleOptions& options = arguments.scale;
  CLI::App& command = declare_timed(
      app, arguments, "scale",
      "From a procedural city to shaded receivers, end to end under the cap: time, bytes, memory "
      "and cache hits of build, verification and shading at growing sizes, and their law",
      "Under a minute on two cores: 200k and 1M points, 8k receivers, 2 runs", options.repeats);
  add_points_list(command, options.points,
                  "Points of the city, in place of 1M, 5M and 20M; repeatable; 1000 or more");
  ptc::add_count(command, "--receivers", options.receivers, "Of them, spread evenly")
      ->default_str("100k");
}

void declare_model(CLI::App& app, Arguments& arguments) {
  CLI::App& command = declare(
      app, arguments, "model",
      "Error against bytes and against time: what a node may hold (surfel, lobes, vector, cube, "
      "spherical harmonics), its rounding, points of a leaf, direction pixels; page compression",
      "model.json, .csv and, for each scene, model-SCENE.svg and .png");
  command.add_flag("--quick", arguments.quick,
                   "Under a minute on two cores: 100k points, 150 receivers checked, 2 runs");
  ModelOptions& options = arguments.model;
  ptc::add_count(command, "--points", options.scene.points,
                 "Surfels wanted of a mesh or the city; k, M, G count by 1000")
      ->default_str("500k");
  ptc::add_integer(command, "--checked", options.checked, 10, 1'000'000,
                   "Receivers whose error is measured");
  ptc::add_integer(command, "--repeats", options.repeats, 1, 1000, "Runs of every measurement");
}

/// The scenes asked for, whose files can be read.
std::vector<SceneChoice> choose_scenes(const Arguments& arguments) {
  std::vector<std::string> texts = arguments.scenes;
  if (texts.empty()) texts = {"fractal", "window", "city"};
  if (arguments.scenes.empty() && arguments.quick) texts.resize(1);
  const std::vector<SceneChoice> scenes = parse_scenes(texts);
  for (const SceneChoice& scene : scenes) {
    if (scene.file.empty()) continue;
    if (!std::filesystem::exists(scene.file)) {
      throw ptc::DataError(scene.file.string() + ": No such file or directory; scenes are " +
                           kScenes);
    }
    ptc::check_input(scene.file);
  }
  return scenes;
}

/// Where files of the measurement go: one directory, with most room.
std::filesystem::path work_directory(const Arguments& arguments, const ptc::RunOptions& run) {
  return run.temp_dirs.empty() ? arguments.directory : ptc::roomiest(run.temp_dirs);
}

ptc::Outcome run_accuracy(Arguments& arguments, const ptc::RunOptions& run,
                          ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments.accuracy, *arguments.command);
  const std::vector<SceneChoice> choices = choose_scenes(arguments);
  std::filesystem::create_directories(arguments.directory);
  const std::filesystem::path work = work_directory(arguments, run);
  const ptc::Executor executor(run.threads);
  std::vector<SceneAccuracy> scenes;
  for (const SceneChoice& choice : choices) {
    const BenchScene scene(choice, arguments.accuracy.scene, work, run, progress);
    scenes.push_back(measure_accuracy(scene, arguments.accuracy, executor, progress));
    write_reports(arguments.directory, scenes);  // of those done, should a later one fail
  }
  return {facts_of(scenes), accuracy_text(scenes)};
}

ptc::Outcome run_error(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments.error, *arguments.command);
  const std::vector<SceneChoice> choices = choose_scenes(arguments);
  std::filesystem::create_directories(arguments.directory);
  const std::filesystem::path work = work_directory(arguments, run);
  std::vector<SceneErrors> scenes;
  for (const SceneChoice& choice : choices) {
    scenes.push_back(measure_errors(choice, arguments.error, work, run, progress));
    write_reports(arguments.directory, scenes);  // of those done, should a later one fail
  }
  return {facts_of(scenes), error_text(scenes)};
}

/// Measures rows, whose reports are written as they come.
/// @param measure  given what takes the rows so far
template <class Row>
ptc::Outcome report_rows(
    const Arguments& arguments, std::string (*text)(const std::vector<Row>&),
    const std::function<std::vector<Row>(const std::function<void(const std::vector<Row>&)>&)>&
        measure) {
  std::filesystem::create_directories(arguments.directory);
  const std::vector<Row> rows =
      measure([&](const std::vector<Row>& so_far) { write_reports(arguments.directory, so_far); });
  return {facts_of(rows), text(rows)};
}

ptc::Outcome run_growth(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments.growth, *arguments.command);
  return report_rows<GrowthRow>(arguments, growth_text, [&](const auto& report) {
    return measure_growth(arguments.growth, arguments.directory, run, progress, report);
  });
}

ptc::Outcome run_build(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments.build, *arguments.command);
  return report_rows<BuildRow>(arguments, build_text, [&](const auto& report) {
    return measure_build(arguments.build, work_directory(arguments, run), run, progress, report);
  });
}

ptc::Outcome run_cache(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments.cache, *arguments.command);
  return report_rows<CacheRow>(arguments, cache_text, [&](const auto& report) {
    return measure_cache(arguments.cache, work_directory(arguments, run), run, progress, report);
  });
}

ptc::Outcome run_scale(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments.scale, *arguments.command);
  const std::uint64_t least = arguments.scale.points.front();
  if (least < 1000) ptc::refuse("--points", std::to_string(least), "1000 or more");
  return report_rows<ScaleRow>(arguments, scale_text, [&](const auto& report) {
    return measure_scale(arguments.scale, work_directory(arguments, run), run, progress, report);
  });
}

ptc::Outcome run_sort(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments.sort, *arguments.command);
  return report_rows<SortRow>(arguments, sort_text, [&](const auto& report) {
    return measure_sort(arguments.sort, work_directory(arguments, run), run, progress, report);
  });
}

ptc::Outcome run_model(Arguments& arguments, const ptc::RunOptions& run, ptc::Progress& progress) {
  if (arguments.quick) shorten(arguments.model, *arguments.command);
  const std::vector<SceneChoice> choices = choose_scenes(arguments);
  std::filesystem::create_directories(arguments.directory);
  const std::filesystem::path work = work_directory(arguments, run);
  const ptc::Executor executor(run.threads);
  std::vector<SceneModel> scenes;
  for (const SceneChoice& choice : choices) {
    const BenchScene scene(choice, arguments.model.scene, work, run, progress);
    scenes.push_back(measure_model(scene, arguments.model, work, executor, progress));
    write_reports(arguments.directory, scenes);  // of those done, should a later one fail
  }
  return {facts_of(scenes), model_text(scenes)};
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcbench", kPurpose, kExamples);
  Arguments arguments;
  declare_accuracy(command.app(), arguments);
  declare_build(command.app(), arguments);
  declare_cache(command.app(), arguments);
  declare_error(command.app(), arguments);
  declare_growth(command.app(), arguments);
  declare_model(command.app(), arguments);
  declare_scale(command.app(), arguments);
  declare_sort(command.app(), arguments);
  command.app().require_subcommand(1);
  return command.run(argc, argv, [&](ptc::Progress& progress) {
    arguments.command = command.app().get_subcommands().front();
    const std::string name = arguments.command->get_name();
    static const std::map<std::string, decltype(&run_accuracy)> kRuns{
        {"accuracy", run_accuracy}, {"build", run_build},   {"cache", run_cache},
        {"error", run_error},       {"growth", run_growth}, {"model", run_model},
        {"scale", run_scale},       {"sort", run_sort}};
    return kRuns.at(name)(arguments, command.run_options(), progress);
  });
}
