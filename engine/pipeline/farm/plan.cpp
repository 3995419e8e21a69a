// Measures the inputs as a build on one machine does, then writes down what the tasks follow from.
#include "engine/pipeline/farm/plan.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/file/text_file.h"
#include "engine/io/file/url.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/build_inputs.h"
#include "engine/pipeline/build/build_record.h"
#include "engine/pipeline/build/placed_points.h"
#include "engine/pipeline/farm/build_tasks.h"
#include "engine/pipeline/farm/cuts.h"
#include "engine/pipeline/farm/plan_checks.h"
#include "engine/pipeline/farm/plan_json.h"
#include "engine/pipeline/farm/plan_tasks.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/shade_ranges.h"
#include "format/checksum.h"
#include "format/node_page.h"

namespace ptc {
namespace {

// The share of a task's memory that the points of a part may take, so that its sort spills nothing.
constexpr std::uint64_t kSortShare = 2;
constexpr std::uint64_t kShadedPoints = 1'000'000;  // of a task
constexpr double kMaxSeconds = 1e9;                 // of a task
constexpr std::uint64_t kMaxShares = 10'000;        // of a file
// Points that a task routes at least, where it may choose, and how many such tasks are enough.
constexpr std::uint64_t kSharePoints = 4'000'000, kEnoughRoutes = 2'000;

/// @param lit  the points are lit anew
void check_inputs(const BuildInputs& inputs, bool lit) {
  require_request(!inputs.has_meshes(), "inputs",
                  "a farm builds clouds and containers: build the meshes to a container first");
  require_request(!inputs.clouds.scan, "inputs",
                  "a farm builds points with normals and radii: build each cloud that lacks them "
                  "to a container first");
  require_request(!inputs.relight || lit, "inputs",
                  "lamps of one input would light another: give the lights of the scene, or build "
                  "these on one machine");
}

std::vector<MortonKey> sorted_keys(const std::vector<glm::dvec3>& places, const Frame& frame) {
  std::vector<MortonKey> keys;
  keys.reserve(places.size());
  for (const glm::dvec3& p : places) keys.push_back(encode_morton(frame.to_lattice(to_array(p))));
  std::ranges::sort(keys);
  return keys;
}

/// Returns how many parts let the points of each fit in the memory of a task.
std::size_t parts_for(const FarmPlan& plan, const FarmOptions& options) {
  if (options.parts > 0) return options.parts;
  const std::uint64_t memory = std::max<std::uint64_t>(options.memory_bytes / kSortShare, 1);
  const std::uint64_t groups = plan.row().group_bytes.size();
  const std::uint64_t bytes = plan.points * (groups + 1) * 2 * sizeof(PointRecord);
  return static_cast<std::size_t>(std::min<std::uint64_t>(bytes / memory + 1, kMaxParts));
}

/// Returns into how many ranges a part is divided at most: each is worth a sort of its own, a route
/// has so many points of each that a part opens its file for them, and blocks of each fit in
/// memory.
std::size_t ranges_for(const FarmPlan& plan, const FarmOptions& options) {
  if (options.ranges > 0) return options.ranges;
  constexpr std::uint64_t kRangePoints = 5 << 16, kRoutePoints = 1 << 15, kMost = 64;
  constexpr std::uint64_t kBlockPoints = 1 << 13;
  const std::uint64_t parts = plan.parts();
  const std::uint64_t by_sort = plan.points / parts / kRangePoints;
  const std::uint64_t by_route = plan.points / plan.inputs.size() / parts / kRoutePoints;
  const std::uint64_t by_memory =
      options.memory_bytes / 2 / parts / (kBlockPoints * plan.row().bytes());
  return static_cast<std::size_t>(
      std::clamp<std::uint64_t>(std::min({by_sort, by_route, by_memory}), 1, kMost));
}

void require(const FarmPlan& plan, bool holds, const char* rule) {
  if (!holds) throw DataError(plan.file.string() + ": " + rule);
}

void check_channels(const FarmPlan& plan, const FarmInput& input) {
  require(plan, input.taken.empty() || input.taken.size() == input.channels.size(),
          "an input has another number of channels than of marks");
  for (const Channel& channel : input.channels) {
    const std::size_t bytes = channel.component_bytes();
    require(plan, (bytes == 1 || bytes == 2 || bytes == 4 || bytes == 8) && channel.components > 0,
            "a channel has no component of 1, 2, 4 or 8 bytes");
  }
}

/// Checks that shares of a file follow each other, and that the states of all files are known.
void check_files(const FarmPlan& plan) {
  for (std::size_t i = 0; i < plan.inputs.size(); ++i) {
    const FarmInput& input = plan.inputs[i];
    require(plan, input.path.empty() || plan.files.contains(input.path),
            "the state of an input is missing");
    if (input.first == 0) continue;
    const auto follows = [&](const FarmInput& before) {
      return before.path == input.path && before.channels == input.channels &&
             before.taken == input.taken && before.points <= input.first &&
             before.first == input.first - before.points;
    };
    require(plan, i > 0 && !input.path.empty() && follows(plan.inputs[i - 1]),
            "a share of an input does not follow the one before");
  }
}

/// Checks how a plan lights its points.
void check_lighting(const LightRequest& lighting) {
  check_ranges(lighting);
  check_lights(lighting.lights.value());
  const auto check_rays = [](unsigned rays, const char* field) {
    require_request(rays >= 1 && rays <= LightSampling::kMost, field,
                    "a point has 1 to 65536 shadow rays to lights of a kind");
  };
  check_rays(lighting.light_sampling.sun_rays, "light_sampling.sun_rays");
  check_rays(lighting.light_sampling.area_rays, "light_sampling.area_rays");
  const LightRequest usual;
  require_request(
      has_usual_settings(lighting.gather) && lighting.gather.sides == usual.gather.sides &&
          lighting.gather.around.is_plain() && lighting.lift == usual.lift && lighting.emission,
      "gather", "a farm lights with the usual settings of the gather");
}

/// Checks the pictures of a plan.
void check_frames(const FarmPlan& plan) {
  const FarmFrames& frames = *plan.frames;
  for (const std::filesystem::path& target : frames.targets) {
    require(plan, target.is_absolute() && !has_control_characters(target),
            "a picture is no absolute path without control characters");
    require(plan, !frames.range || frame_name(target, 1).has_value(),
            "the name of a picture has no mark for the number of a frame");
  }
  require(plan, !frames.targets.empty() && frames.directory.is_absolute(), "it has no pictures");
  check_ranges(frames.lighting);
  if (!frames.range) return;
  try {
    check_sequence({.frames = *frames.range});
  } catch (const RequestError&) {
    require(plan, false, "the frames are out of range");
  }
}

/// Returns the number of tasks that a plan implies.
std::size_t count_tasks(const FarmPlan& plan) {
  const std::size_t tune = plan.shading && plan.shading->request.error ? 1 : 0;
  const std::size_t shading = plan.shading ? tune + plan.shading->ranges + 1 : 0;
  const std::size_t builds = 1 + (plan.lighting ? 1 : 0) + plan.waves();
  const std::size_t frames = plan.frames ? plan.frames->count() : 0;
  return plan.inputs.size() + builds * (plan.parts() + 1) + shading + frames;
}

/// Checks what a plan says, but for its tasks.
void check_plan(const FarmPlan& plan) {
  require(
      plan,
      plan.scene.is_absolute() && plan.scene.has_filename() && !has_control_characters(plan.scene),
      "the scene is no absolute path without control characters");
  require(plan, !has_control_characters(plan.file), "a path has no control characters in a farm");
  const BuildRequest& request = plan.request;
  check_page_shift(request.page_shift);
  const BuildOptions& tree = request.tree;
  require(plan, tree.leaf_points >= 1 && tree.leaf_points <= kMaxLeafPoints,
          "the number of points in a leaf is out of range");
  require(plan, tree.levels_per_stream >= 1 && tree.levels_per_stream <= kLatticeBits,
          "the number of levels in a stream is out of range");
  require(plan, request.selection.every >= 1, "it takes the first of every 0 points");
  require(plan, std::isfinite(plan.frame.edge) && plan.frame.edge > 0, "the frame has no edge");
  require(plan, !plan.inputs.empty(), "it has no inputs");
  const bool city = request.city_points > 0;
  for (const FarmInput& input : plan.inputs) {
    require(plan, input.path.empty() == city, "its inputs are neither files nor the city");
    require(plan, input.blocks.first <= input.blocks.end, "the blocks of an input do not ascend");
    check_channels(plan, input);
  }
  check_files(plan);
  const auto ascends = [](const std::vector<MortonKey>& keys) {
    return std::ranges::adjacent_find(keys, std::ranges::greater_equal()) == keys.end();
  };
  require(plan, ascends(plan.cuts), "the cuts do not ascend");
  require(plan, ascends(plan.borders), "the borders do not ascend");
  require(plan, std::ranges::includes(plan.borders, plan.cuts), "a cut is no border");
  if (plan.lighting) check_lighting(*plan.lighting);
  if (plan.frames) check_frames(plan);
  if (!plan.shading) return;
  require(plan, plan.shading->target.is_absolute() && !has_control_characters(plan.shading->target),
          "the shaded points are no absolute path without control characters");
  require(plan, plan.shading->ranges >= 1 && plan.shading->ranges <= kMaxRanges,
          "the number of ranges to shade is out of range");
  check_shade_by_ranges(plan.shading->request, plan.shading->target);
}

/// Replaces the tasks that a file says by those that its plan implies. What a task needs may have
/// been changed.
void complete_tasks(FarmPlan& plan, const TaskCommand& command) {
  constexpr char kTasks[] =
      "the tasks are not a route for each input, a part between all cuts, and a join, nor those "
      "that light and shade";
  const std::vector<FarmTask> said = std::exchange(plan.tasks, {});
  require(plan, said.size() == count_tasks(plan), kTasks);
  add_tasks(plan, 0);
  const auto same = [](const FarmTask& a, const FarmTask& b) {
    return a.step == b.step && a.number == b.number;
  };
  require(plan, std::ranges::equal(said, plan.tasks, same), kTasks);
  for (std::size_t i = 0; i < said.size(); ++i) {
    FarmTask& task = plan.tasks[i];
    require(plan, said[i].seconds >= 0 && said[i].seconds <= kMaxSeconds,
            "the seconds of a task are out of range");
    task.memory_bytes = said[i].memory_bytes;
    task.disk_bytes = said[i].disk_bytes;
    task.seconds = said[i].seconds;
    task.command = command(plan, task);
  }
}

/// Returns into how many shares a cloud is divided: one, where its points can only be read from the
/// first one on.
std::uint64_t shares_of(const Clouds::Cloud& cloud, const Selection& selection,
                        std::uint64_t share_points) {
  const std::uint64_t shares = std::min<std::uint64_t>(cloud.points / share_points, kMaxShares);
  if (shares < 2 || !selection.takes_all()) return 1;
  return open_placed_points(cloud.path, selection, {}).source->skip(0) ? shares : 1;
}

/// Divides the city into shares of so many points.
std::vector<FarmInput> city_shares(std::uint64_t points, std::uint64_t share_points) {
  const std::uint64_t blocks = city_blocks(points);
  const std::uint64_t shares = std::clamp<std::uint64_t>(points / share_points, 1, blocks);
  std::vector<FarmInput> inputs;
  for (std::uint64_t i = 0; i < shares; ++i) {
    inputs.push_back({.blocks = {.first = blocks * i / shares, .end = blocks * (i + 1) / shares},
                      .points = points / shares});
  }
  return inputs;
}

/// Returns positions of points of some blocks of the city.
std::vector<glm::dvec3> sample_city(std::uint64_t points) {
  constexpr std::uint64_t kBlocks = 128, kEvery = 4;
  const std::uint64_t blocks = city_blocks(points);
  const auto city = make_city(points, {.end = blocks, .step = blocks / kBlocks + 1});
  std::vector<glm::dvec3> places;
  std::vector<Surfel> surfels(1 << 12);
  while (const std::size_t count = city->next(surfels)) {
    for (std::size_t i = 0; i < count; i += kEvery) places.push_back(surfels[i].position);
  }
  return places;
}

}  // namespace

AttributePlan FarmPlan::attributes() const {
  AttributePlan plan;
  for (const FarmInput& input : inputs) {
    if (!input.channels.empty() && input.first == 0)  // the shares of a file are one input
      static_cast<void>(plan.add_input(input.channels, input.taken));
  }
  const std::vector<Channel>& wanted = meta.channels;
  if (request.original_order) plan.add_original_index();
  for (std::size_t i = 0; i < std::min(wanted.size(), plan.channels().size()); ++i) {
    if (wanted[i].no_value) static_cast<void>(plan.mark_unknown(i));
  }
  if (plan.channels() != wanted)
    throw DataError(file.string() + ": the channels are not those of the inputs");
  return plan;
}

std::array<std::size_t, 2> FarmPlan::ranges_of(std::size_t part) const {
  const auto first_of = [&](std::size_t number) {
    if (number == 0) return std::size_t{0};
    if (number == parts()) return borders.size() + 1;
    const auto at = std::ranges::lower_bound(borders, cuts[number - 1]);
    return static_cast<std::size_t>(at - borders.begin()) + 1;
  };
  return {first_of(part), first_of(part + 1)};
}

RangeRow FarmPlan::row() const {
  RangeRow row;
  const AttributePlan plan = attributes();
  for (std::size_t group = 0; group < plan.groups(); ++group)
    row.group_bytes.push_back(plan.group_bytes(group));
  return row;
}

FarmPlan make_plan(const BuildRequest& request, const std::filesystem::path& scene,
                   const std::filesystem::path& file, const FarmOptions& options,
                   Progress& progress) {
  // Measure the inputs
  check_plan_request(request);
  FarmPlan plan{.file = std::filesystem::absolute(file),
                .scene = std::filesystem::absolute(scene),
                .request = request,
                .lighting = options.lighting,
                .shading = options.shading,
                .frames = options.frames};
  if (plan.lighting) check_lighting(*plan.lighting);
  if (plan.shading) {
    plan.shading->target = std::filesystem::absolute(plan.shading->target);
    check_shade_by_ranges(plan.shading->request, plan.shading->target);
  }
  for (const std::filesystem::path& input : request.inputs) {
    if (is_url(input))
      throw DataError(input.string() + ": a plan takes files that all machines see, and no URL");
  }
  if (plan.frames && plan.frames->range) check_sequence({.frames = *plan.frames->range});
  check_plan_paths(request, plan);
  for (const std::filesystem::path& input : request.inputs) {
    const std::filesystem::path path = std::filesystem::absolute(input);
    plan.files[path] = states_of(path);
  }
  const MeshLimits limits{.reading = request.run.memory_bytes,
                          .kept = request.run.memory_bytes,
                          .traced = request.run.memory_bytes,
                          .textures = texture_cap(request.run),
                          .temp_directory = roomiest_temp_dir(request.run, scene)};
  StageSeconds seconds;
  const BuildInputs inputs =
      read_inputs(request, BoundsFrom::points, nullptr, limits, seconds, progress);
  check_inputs(inputs, plan.lighting.has_value());
  if (inputs.bounds.empty()) throw DataError("the inputs have no points");

  // Write down what follows from them
  plan.points = request.city_points + inputs.clouds.points;
  const std::uint64_t share_points = options.share_points > 0
                                         ? options.share_points
                                         : std::max(kSharePoints, plan.points / kEnoughRoutes);
  for (const Clouds::Cloud& cloud : inputs.clouds.files) {
    if (cloud.place)
      throw RequestError("inputs",
                         "a farm builds clouds where they are: build scene files on one "
                         "machine");
    const std::filesystem::path path = std::filesystem::absolute(cloud.path);
    const std::uint64_t shares = shares_of(cloud, request.selection, share_points);
    for (std::uint64_t i = 0; i < shares; ++i) {
      const std::uint64_t first = cloud.points * i / shares;
      plan.inputs.push_back({.path = path,
                             .first = first,
                             .points = cloud.points * (i + 1) / shares - first,
                             .channels = cloud.channels,
                             .taken = cloud.taken});
    }
  }
  if (request.city_points > 0) plan.inputs = city_shares(request.city_points, share_points);
  plan.frame = frame_around(to_array(inputs.bounds.low), to_array(inputs.bounds.high));
  plan.emits = inputs.clouds.emits;
  plan.meta = complete_record(make_meta(request, inputs), 0, nullptr, request.page_shift);
  check_meta(plan.meta, request.page_shift, plan.emits ? kEmittingPointBytes : kPointBytes);

  // Choose the cuts
  const bool city = request.city_points > 0;
  const std::vector<MortonKey> keys =
      sorted_keys(city ? sample_city(request.city_points) : inputs.sample, plan.frame);
  plan.cuts = choose_cuts(keys, parts_for(plan, options), request.tree.leaf_points);
  plan.borders = choose_borders(keys, plan.cuts, ranges_for(plan, options));
  if (plan.shading && plan.shading->ranges == 0) {
    plan.shading->ranges = static_cast<std::size_t>(
        std::clamp<std::uint64_t>(plan.shaded_points() / kShadedPoints, 1, kMaxRanges));
  }
  require_request(count_tasks(plan) <= kMaxTasks, "bounces",
                  "the plan has more than 1,000,000 tasks: take fewer parts, bounces or frames");
  require_task_memory(plan, options.memory_bytes);
  add_tasks(plan, options.memory_bytes);
  for (const auto& [path, states] : plan.files) require_unchanged(states);
  for (FarmTask& task : plan.tasks) task.command = options.command(plan, task);
  return plan;
}

void write_plan(FarmPlan& plan) {
  const std::string text = plan_to_json(plan);
  plan.id = xxh3_64(std::as_bytes(std::span(text)));
  write_text(plan.file, text);
}

FarmPlan read_plan(const std::filesystem::path& file, const TaskCommand& command) {
  const std::string text = read_text(file);
  FarmPlan plan = plan_from_json(text, std::filesystem::absolute(file));
  try {
    check_plan(plan);
    complete_tasks(plan, command);
  } catch (const RequestError& error) {
    throw DataError(plan.file.string() + ": " + error.what());
  }
  plan.id = xxh3_64(std::as_bytes(std::span(text)));
  return plan;
}

}  // namespace ptc
