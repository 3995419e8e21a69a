// ptcfarm: builds one scene by many tasks, on one machine or on many.
//
//   plan      inputs --> plan.json
//   route, part, join, light, ...   one task of a plan
//   run       all tasks, on this machine
//   submit, cancel       all tasks, by Slurm
//   status    how far they are
//   export    the tasks for another scheduler
#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <wordexp.h>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/text_file.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/farm/plan.h"
#include "engine/pipeline/farm/tasks.h"
#include "format/node_page.h"
#include "format/text.h"
#include "tools/common.h"
#include "tools/farm_export.h"
#include "tools/farm_run.h"
#include "tools/farm_status.h"
#include "tools/inputs.h"
#include "tools/options.h"
#include "tools/render_arguments.h"
#include "tools/report.h"
#include "tools/scene_options.h"
#include "tools/slurm_jobs.h"
#include "tools/values.h"

namespace {

constexpr char kPurpose[] =
    "Builds one container by many tasks, on one machine or on many.\n"
    "A plan says what is built, where its points are cut into parts, and by which tasks. Each task "
    "is one command line: route sends the points of an input to the parts that they belong to, "
    "part sorts and builds the points of one part, join writes the scene file over all parts; "
    "light "
    "lights the points of a part by the whole scene, and join_light joins the parts again; bounce "
    "and join_bounce do so for each bounce of the light but the last; tune chooses settings that "
    "meet an error, shade computes the light at a range of the points, and collect writes the "
    "shaded points; frame renders a picture. A task that is done does nothing when it is run "
    "again, and what a task writes appears whole or not at all.\n"
    "\n"
    "The scene refers to its parts, which stay files of their own. Its tree, and all that is "
    "shaded "
    "from it, has the bits of a container that one machine builds of the same inputs.\n"
    "\n"
    "Inputs are clouds and containers whose points have normals and radii. They keep the light "
    "that "
    "they have, unless lights are given. Build meshes, and clouds that lack something, to a "
    "container first.";
constexpr char kExamples[] =
    "  # Plan a scene of eight parts, and run the tasks on this machine\n"
    "  ptcfarm plan tiles/*.ptcx --parts 8 -o town.json\n"
    "  ptcfarm run town.json --memory 8G\n"
    "  # Light its points by tasks, too, and shade them with three bounces\n"
    "  ptcfarm plan tiles/*.ptcx --sun 200,35 --sky 0.3,0.4,0.6 --shade lit.ply --bounces 3 "
    "-o town.json\n"
    "  # Go once around it, a task for each picture\n"
    "  ptcfarm plan town.ptcx --scene turn.ptcx --render '-o turn.##.exr --turntable 48' "
    "-o turn.json\n"
    "  # Run one task, as a farm does\n"
    "  ptcfarm part town.json --number 3\n"
    "  # Let a cluster run them\n"
    "  ptcfarm submit town.json --slurm\n"
    "  # See how far the tasks are, and what failed\n"
    "  ptcfarm status town.json\n";

enum class Action { plan, run, submit, cancel, status, export_tasks, task };

/// What is to be done: an action, or one task of a kind.
using Chosen = std::pair<Action, ptc::TaskKind>;

struct Arguments {
  Chosen action{Action::plan, {}};
  std::vector<std::filesystem::path> files;
  std::filesystem::path output, scene;
  ptc::BuildRequest request;
  ptc::FarmOptions farm;
  ptc::FarmShading shading;
  std::string pictures;
  ptc::LightArguments lights;
  ptc::LightRequest lighting;
  std::size_t number = 0;
  unsigned wave = 0;
  ptc::Scheduler scheduler = ptc::Scheduler::parallel;
  bool slurm = false;
};

void declare(ptc::Command& command, Arguments& arguments) {
  CLI::App& app = command.app();
  ptc::BuildRequest& request = arguments.request;
  std::vector<std::pair<std::string, Chosen>> actions{
      {"plan", {Action::plan, {}}},     {"run", {Action::run, {}}},
      {"submit", {Action::submit, {}}}, {"cancel", {Action::cancel, {}}},
      {"status", {Action::status, {}}}, {"export", {Action::export_tasks, {}}}};
  for (const ptc::TaskKind kind : ptc::kTaskKinds)
    actions.push_back({ptc::name_of(kind), {Action::task, kind}});
  ptc::add_choice<Chosen>(app, "ACTION", arguments.action, actions,
                          "plan, run, submit, cancel, status, export, or the kind of a task\n"
                          "plan measures the inputs and writes a plan. run runs its tasks, those "
                          "that are done left out. submit has a cluster run them, and cancel ends "
                          "its jobs. status says how far they are. export writes them for another "
                          "scheduler. route, part, join, light, join_light, bounce, join_bounce, "
                          "tune, shade, collect and frame run one task.")
      ->required()
      ->type_name("ACTION")
      ->default_str("")
      ->group(ptc::kFilesGroup);
  ptc::offer(app.add_option("FILE", arguments.files,
                            "Inputs of a plan, as ptcbuild takes them; else the plan"),
             {".json", ".ptcx", ".ply", ".las", ".laz", ".e57"})
      ->type_name("FILE")
      ->group(ptc::kFilesGroup);
  command
      .add_output("-o,--output", arguments.output, {".json", ".sh"},
                  "Plan (.json), or tasks for another scheduler, to write")
      ->required(false);
  command
      .add_output("--scene", arguments.scene, {".ptcx"},
                  "Scene that the tasks will write [default: the name of the plan, .ptcx]\n"
                  "Its parts go into a folder beside it, NAME.parts.")
      ->required(false);
  ptc::add_count(app, "--city", request.city_points,
                 "Plan a procedural city of about COUNT points instead of inputs")
      ->group(ptc::kFilesGroup);
  app.add_flag("--remove-duplicates", request.remove_duplicates,
               "Keep one of the points that lie at the same place")
      ->group(ptc::kFilesGroup);
  ptc::add_up(app, request.up)->group(ptc::kFilesGroup);
  ptc::add_original_order(app, request.original_order, "Record the order of the inputs")
      ->group(ptc::kFilesGroup);
}

void declare_tasks(CLI::App& app, Arguments& arguments) {
  constexpr char kGroup[] = "Tasks";
  ptc::add_integer(app, "--parts", arguments.farm.parts, 0, 10'000,
                   "Parts to plan; 0: as many as memory needs\n"
                   "The points of each part then fit in half of the memory of a task.")
      ->group(kGroup);
  ptc::add_size(app, "--task-memory", arguments.farm.memory_bytes,
                "Cap on the memory of each planned task")
      ->group(kGroup);
  ptc::add_choice<ptc::Scheduler>(app, "--for", arguments.scheduler,
                                  {{"parallel", ptc::Scheduler::parallel},
                                   {"slurm", ptc::Scheduler::slurm},
                                   {"openjd", ptc::Scheduler::openjd}},
                                  "Scheduler to export for: parallel, slurm or openjd\n"
                                  "parallel and slurm are shell scripts: one calls GNU parallel, "
                                  "one submits jobs to Slurm. openjd is a job template of Open Job "
                                  "Description, which other farms take.")
      ->group(kGroup);
  app.add_flag("--slurm", arguments.slurm,
               "Submit to Slurm: an array of jobs for each step\n"
               "Scripts and numbers of jobs go into a folder beside the plan, NAME.slurm.")
      ->group(kGroup);
  ptc::add_integer(app, "--number", arguments.number, 0, 1'000'000,
                   "Number of the task among those of its kind, from 0")
      ->group(kGroup);
  ptc::add_integer(app, "--wave", arguments.wave, 0, 1000,
                   "Number of the bounce whose task it is, from 1 on")
      ->group(kGroup);
}

void declare_shading(ptc::Command& command, ptc::FarmShading& shading) {
  CLI::App& app = command.app();
  CLI::Option* shade =
      command
          .add_output("--shade", shading.target, ptc::point_output_endings(),
                      "Also shade the points of the scene, into this file of points\n"
                      "It gets what ptcshade writes with the same options. The sky is the one of "
                      "the scene. With #### in its name, each range gets a file of its own, whose "
                      "number takes that place.")
          ->required(false)
          ->group("Shading");
  ptc::add_integer(app, "--ranges", shading.ranges, 0, 10'000,
                   "Ranges of points to shade; 0: one for each million")
      ->group("Shading");
  ptc::add_count(app, "--count", shading.request.count,
                 "Shade COUNT points, evenly spread [default: all]")
      ->group("Shading");
  ptc::add_colour_from(app, shading.request.colour_from)->group("Shading");
  ptc::add_integer(app, "--bounces", shading.request.bounces, 0, 1000,
                   "Bounces of light; 0 gives occlusion and sky alone\n"
                   "For each bounce but the last, tasks light all parts once more.")
      ->group("Shading");
  ptc::add_surroundings(app, shading.request.gather.around);
  ptc::add_gather_options(app, shading.request.gather, shading.request.lift);
  ptc::add_error_option(app, shading.request.error);
  for (const char* name : {"--ranges", "--count", "--colour-from", "--bounces", "--error",
                           "--sphere", "--cone", "--distance", "--solid-angle", "--parallax",
                           "--inflation", "--resolution", "--sides", "--lift"})
    app.get_option(name)->needs(shade);
}

void declare_pictures(CLI::App& app, std::string& pictures) {
  app.add_option("--render", pictures,
                 "Also render pictures of the scene, with these options of ptcrender\n"
                 "OPTIONS is one text, quoted as a shell has it, such as \"-o turn.##.exr "
                 "--turntable 48 --size 960x540\". Each frame is a task of its own. The scene and "
                 "the resources are those of the plan. For each bounce but the last, tasks light "
                 "all parts once more, unless --shade lights them with other settings.")
      ->type_name("OPTIONS")
      ->group("Pictures");
}

void declare_container(CLI::App& app, ptc::BuildRequest& request) {
  ptc::add_profile(app, request.profile)->group("Container");
  ptc::add_page_size(app, request.page_shift)->group("Container");
  ptc::add_integer(app, "--leaf", request.tree.leaf_points, 1, ptc::kMaxLeafPoints,
                   "Maximum number of points in a leaf of the octree")
      ->group("Container");
}

nlohmann::ordered_json facts_of(const ptc::FarmPlan& plan) {
  return {{"plan", plan.file.string()},
          {"scene", plan.scene.string()},
          {"points", plan.points},
          {"parts", plan.parts()},
          {"tasks", plan.tasks.size()}};
}

/// Returns the words of a text as a shell has them, without running anything.
std::vector<std::string> words_of(const std::string& text) {
  wordexp_t found{};
  const int error = wordexp(text.c_str(), &found, WRDE_NOCMD | WRDE_UNDEF | WRDE_SHOWERR);
  if (error != 0) {
    throw CLI::ValidationError("--render",
                               fmt::format("cannot be read as words of a shell: {}", text));
  }
  std::vector<std::string> words(found.we_wordv, found.we_wordv + found.we_wordc);
  wordfree(&found);
  return words;
}

/// The options of ptcrender for some pictures.
struct Pictures {
  /// @throws CLI::ParseError
  Pictures(const std::filesystem::path& scene, const std::vector<std::string>& words)
      : command("ptcrender", "Renders pictures of a plan.", "") {
    arguments.declare(command);
    std::vector<std::string> all(words.rbegin(), words.rend());  // as parse() takes them
    all.push_back(scene.string());
    command.app().parse(all);
  }
  ptc::Command command;
  ptc::RenderArguments arguments;
};

/// Refuses pictures of a plan. @param why  what is wrong
[[noreturn]] void refuse_pictures(const std::string& why) {
  throw CLI::ValidationError("--render", why);
}

/// Returns the pictures of a plan. @param text  options of ptcrender, as a shell has them
ptc::FarmFrames frames_of(const std::string& text, const std::filesystem::path& scene) {
  // Read the options as ptcrender does
  const std::vector<std::string> words = words_of(text);
  std::optional<Pictures> pictures;
  try {
    pictures.emplace(scene, words);
  } catch (const CLI::ParseError& error) {
    refuse_pictures(error.what());
  }
  ptc::RenderArguments& arguments = pictures->arguments;
  if (arguments.scenes() != 1 || std::ranges::find(words, "--") != words.end())
    refuse_pictures("the pictures are of the scene of the plan: name no other one");
  if (arguments.has_light_groups())
    refuse_pictures("--light-groups needs a scene in one file, and that of a plan has parts");
  const ptc::LightingRequest& lighting = arguments.lighting(pictures->command);
  if (lighting.tolerate_damage && lighting.bounces > 1)
    refuse_pictures("--tolerate-damage excludes --bounces above 1, which need every point");

  // Take what tasks need, and leave the frames out
  ptc::FarmFrames frames{.directory = std::filesystem::current_path(),
                         .lighting = lighting,
                         .seconds = arguments.expected_seconds()};
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i].starts_with("--frames=")) continue;
    if (words[i] == "--frames") {
      ++i;
    } else {
      frames.options.push_back(words[i]);
    }
  }
  if (arguments.sequence()) frames.range = arguments.sequence()->frames;
  for (const std::filesystem::path& target : arguments.targets()) {
    frames.targets.push_back(std::filesystem::absolute(target));
    const std::string name = target.string();
    if (!std::filesystem::is_directory(frames.targets.back().parent_path()))
      refuse_pictures(name + ": there is no such folder");
    if (!frames.range) continue;
    if (!ptc::frame_name(target, 1)) {
      refuse_pictures(name +
                      ": the name of a sequence needs a mark for the number of the frame, such as "
                      "####");
    }
    if (ptc::has_ending(target, ".png") && !arguments.has_exposure())
      refuse_pictures(name + ": tasks cannot agree on an exposure: give --exposure, or write .exr");
  }
  return frames;
}

/// Renders the picture of a task.
/// @throws DataError when the plan has options that ptcrender does not know; as render_picture()
void render_frame(const ptc::FarmPlan& plan, const ptc::FarmTask& task, const ptc::RunOptions& run,
                  ptc::Progress& progress) {
  const ptc::FarmFrames& frames = plan.frames.value();
  std::vector<std::string> words = frames.options;
  if (frames.range) words.push_back(fmt::format("--frames={}", (*frames.range)[task.number]));
  ptc::RunOptions own = run;
  for (std::filesystem::path& directory : own.temp_dirs)
    directory = std::filesystem::absolute(directory);
  std::filesystem::current_path(frames.directory);
  std::optional<Pictures> pictures;
  try {
    pictures.emplace(plan.scene, words);
  } catch (const CLI::ParseError& error) {
    throw ptc::DataError(fmt::format("{}: its pictures: {}", plan.file.string(), error.what()));
  }
  if (plan.renders_bounces()) {
    if (!ptc::has_same_bounces(pictures->arguments.lighting(pictures->command), frames.lighting))
      throw ptc::DataError(plan.file.string() + ": its pictures have other bounces than it says");
    pictures->arguments.use_bounces(plan.bounced(frames.lighting.bounces));
  }
  static_cast<void>(pictures->arguments.render(pictures->command, own, progress));
}

/// The command line of a task. The cap is that of the plan.
std::vector<std::string> command_of(const ptc::FarmPlan& plan, const ptc::FarmTask& task) {
  std::vector<std::string> words{"ptcfarm", ptc::name_of(task.step.kind), plan.file.string()};
  if (task.step.wave > 0) words.insert(words.end(), {"--wave", std::to_string(task.step.wave)});
  words.insert(words.end(), {"--number", std::to_string(task.number), "--memory",
                             std::to_string(task.memory_bytes)});
  return words;
}

ptc::Outcome plan(Arguments& arguments, ptc::Command& command, ptc::Progress& progress) {
  if (arguments.output.empty()) throw CLI::RequiredError("--output");
  if (!ptc::has_ending(arguments.output, ".json"))
    throw CLI::ValidationError("--output", "the name of a plan must end in .json");
  ptc::BuildRequest& request = arguments.request;
  if (arguments.files.empty() && request.city_points == 0)
    throw CLI::RequiredError("FILE or --city");
  if (std::ranges::find(arguments.files, "-") != arguments.files.end())
    throw CLI::ValidationError("FILE", "tasks cannot read standard input");
  request.run = command.run_options();
  const ptc::InputFiles inputs(arguments.files, "", request.run, arguments.output);
  request.inputs = inputs.paths();
  request.input_names = inputs.names();
  std::filesystem::path scene = arguments.scene;
  if (scene.empty()) scene = std::filesystem::path(arguments.output).replace_extension(".ptcx");
  arguments.farm.command = command_of;
  if (!arguments.shading.target.empty()) arguments.farm.shading = arguments.shading;
  if (arguments.lights.given()) {
    arguments.lighting.lights = arguments.lights.rig(ptc::up_of_files(request.inputs, request.up),
                                                     *ptc::texture_store(request.run, scene));
    arguments.farm.lighting = arguments.lighting;
  }
  if (!arguments.pictures.empty()) arguments.farm.frames = frames_of(arguments.pictures, scene);
  for (const char* name : {"--sun-rays", "--area-rays"}) {
    if (command.app().count(name) > 0 && !arguments.farm.lighting)
      throw CLI::RequiresError(name, "a light, such as --sun");
  }
  ptc::FarmPlan plan = ptc::make_plan(request, scene, arguments.output, arguments.farm, progress);
  ptc::write_plan(plan);
  return {facts_of(plan),
          fmt::format("{}: {} points, {} parts, {} tasks\n", arguments.output.string(), plan.points,
                      plan.parts(), plan.tasks.size())};
}

/// Reads the plan of an action that takes nothing else.
ptc::FarmPlan only_plan(const Arguments& arguments) {
  if (arguments.files.size() != 1) throw CLI::ValidationError("FILE", "takes one plan");
  ptc::check_input(arguments.files[0]);
  return ptc::read_plan(arguments.files[0], command_of);
}

ptc::Outcome run(const Arguments& arguments, ptc::Command& command, ptc::Progress& progress) {
  const ptc::FarmPlan plan = only_plan(arguments);
  const ptc::FarmRun done = ptc::run_plan(plan, command.run_options(), progress);
  ptc::Outcome outcome{.facts = facts_of(plan), .summary = {}};
  outcome.facts["ran"] = done.ran;
  outcome.facts["skipped"] = done.skipped;
  outcome.facts["retried"] = done.retried;
  outcome.facts["failed"] = done.failed;
  outcome.exit_code = static_cast<ptc::ExitCode>(done.exit_code);
  outcome.summary = done.failed.empty() ? fmt::format("{}: {} tasks ran, {} were done before\n",
                                                      plan.scene.string(), done.ran, done.skipped)
                                        : done.errors;
  if (done.failed.empty()) ptc::tell_tuning(plan, outcome);
  return outcome;
}

ptc::Outcome run_one(const Arguments& arguments, ptc::Command& command, ptc::Progress& progress) {
  const ptc::FarmPlan plan = only_plan(arguments);
  const ptc::TaskStep step{arguments.action.second, arguments.wave};
  const auto task = std::ranges::find_if(plan.tasks, [&](const ptc::FarmTask& other) {
    return other.step == step && other.number == arguments.number;
  });
  if (task == plan.tasks.end()) {
    const bool lacks_wave = step.wave == 0 && (step.kind == ptc::TaskKind::bounce ||
                                               step.kind == ptc::TaskKind::join_bounce);
    if (lacks_wave) throw CLI::RequiredError("--wave");
    throw CLI::ValidationError(
        "--number", fmt::format("the plan has no task {}.{}", step.name(), arguments.number));
  }
  const ptc::RunOptions& run = command.run_options();
  const bool ran = ptc::run_task(plan, *task, run, progress, [&](const ptc::FarmTask& frame) {
    render_frame(plan, frame, run, progress);
  });
  return {{{"plan", plan.file.string()}, {"task", task->name()}, {"ran", ran}},
          fmt::format("{}: {}\n", task->name(), ran ? "done" : "was done before")};
}

ptc::Outcome submit(const Arguments& arguments, const ptc::Command& command) {
  if (!arguments.slurm) throw CLI::RequiredError("--slurm, the scheduler to submit to,");
  const ptc::FarmPlan plan = only_plan(arguments);
  const std::vector<std::string> jobs = ptc::submit_to_slurm(plan, command.run_options().threads);
  ptc::Outcome outcome{.facts = facts_of(plan), .summary = {}};
  outcome.facts["jobs"] = jobs;
  outcome.summary = jobs.empty()
                        ? fmt::format("{}: all tasks are done\n", plan.scene.string())
                        : fmt::format("{}: jobs {}\n", plan.scene.string(), fmt::join(jobs, ", "));
  return outcome;
}

ptc::Outcome cancel(const Arguments& arguments) {
  const ptc::FarmPlan plan = only_plan(arguments);
  const std::vector<std::string> jobs = ptc::cancel_in_slurm(plan);
  ptc::TaskMarks marks(plan);
  const auto done = std::ranges::count_if(
      plan.tasks, [&](const ptc::FarmTask& task) { return marks.is_done(task); });
  const std::size_t left = plan.tasks.size() - static_cast<std::size_t>(done);
  ptc::Outcome outcome{.facts = facts_of(plan), .summary = {}};
  outcome.facts["cancelled"] = jobs;
  outcome.facts["done"] = done;
  outcome.facts["left"] = left;
  outcome.summary = fmt::format("{}: {} jobs cancelled, {} tasks done, {} left\n",
                                plan.scene.string(), jobs.size(), done, left);
  return outcome;
}

ptc::Outcome export_tasks(const Arguments& arguments, const ptc::Command& command) {
  if (arguments.output.empty()) throw CLI::RequiredError("--output");
  const ptc::FarmPlan plan = only_plan(arguments);
  if (ptc::same_name(arguments.output, plan.file))
    throw CLI::ValidationError("--output", "it is the plan itself");
  ptc::write_text(arguments.output,
                  ptc::exported(plan, arguments.scheduler, command.run_options().threads));
  ptc::Outcome outcome{.facts = facts_of(plan), .summary = {}};
  outcome.facts["output"] = arguments.output.string();
  outcome.summary = fmt::format("{}: {} tasks\n", arguments.output.string(), plan.tasks.size());
  return outcome;
}

ptc::Outcome act(Arguments& arguments, ptc::Command& command, ptc::Progress& progress) {
  switch (arguments.action.first) {
    case Action::plan:
      return plan(arguments, command, progress);
    case Action::run:
      return run(arguments, command, progress);
    case Action::submit:
      return submit(arguments, command);
    case Action::cancel:
      return cancel(arguments);
    case Action::status:
      return ptc::farm_status(only_plan(arguments));
    case Action::export_tasks:
      return export_tasks(arguments, command);
    case Action::task:
      break;
  }
  return run_one(arguments, command, progress);
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcfarm", kPurpose, kExamples);
  Arguments arguments;
  declare(command, arguments);
  ptc::add_selection(command.app(), arguments.request.selection);
  declare_tasks(command.app(), arguments);
  declare_container(command.app(), arguments.request);
  arguments.lights.declare(command.app());
  ptc::add_shadow_rays(command.app(), arguments.lighting.light_sampling);
  declare_shading(command, arguments.shading);
  declare_pictures(command.app(), arguments.pictures);
  return command.run(argc, argv,
                     [&](ptc::Progress& progress) { return act(arguments, command, progress); });
}
