#include "engine/pipeline/farm/plan_json.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/pipeline/scene_record.h"

namespace ptc {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr char kFormat[] = "ptcfarm plan 4";

OrderedJson to_json(const std::filesystem::path& path) {
  return path.string();
}

OrderedJson to_json(const std::vector<std::filesystem::path>& paths) {
  OrderedJson list = OrderedJson::array();
  for (const auto& path : paths) list.push_back(path.string());
  return list;
}

OrderedJson to_json(const Channel& channel) {
  OrderedJson json{{"name", channel.name},
                   {"type", static_cast<unsigned>(channel.type)},
                   {"components", channel.components},
                   {"group", channel.group},
                   {"role", static_cast<unsigned>(channel.role)},
                   {"colour_space", static_cast<unsigned>(channel.colour_space)},
                   {"unit", channel.unit},
                   {"scale", channel.scale},
                   {"offset", channel.offset},
                   {"size", channel.size}};
  if (channel.no_value) json["no_value"] = *channel.no_value;
  return json;
}

Channel channel_of(const OrderedJson& json) {
  Channel channel{
      .name = json.at("name"),
      .type = static_cast<ChannelType>(json.at("type").get<std::uint8_t>()),
      .components = json.at("components"),
      .group = json.at("group"),
      .role = static_cast<ChannelRole>(json.at("role").get<std::uint8_t>()),
      .colour_space = static_cast<ColourSpace>(json.at("colour_space").get<std::uint8_t>()),
      .unit = json.at("unit"),
      .scale = json.at("scale"),
      .offset = json.at("offset"),
      .size = json.at("size")};
  if (json.contains("no_value")) channel.no_value = json.at("no_value").get<std::uint64_t>();
  return channel;
}

OrderedJson to_json(const std::vector<Channel>& channels) {
  OrderedJson list = OrderedJson::array();
  for (const Channel& channel : channels) list.push_back(to_json(channel));
  return list;
}

std::vector<Channel> channels_of(const OrderedJson& json) {
  std::vector<Channel> channels;
  for (const OrderedJson& channel : json) channels.push_back(channel_of(channel));
  return channels;
}

OrderedJson to_json(const std::vector<InputState>& states) {
  OrderedJson list = OrderedJson::array();
  for (const InputState& state : states) {
    list.push_back({{"path", state.path.string()},
                    {"bytes", state.bytes},
                    {"modified_ns", state.modified_ns},
                    {"xxh3", state.xxh3}});
  }
  return list;
}

std::vector<InputState> states_of(const OrderedJson& json) {
  std::vector<InputState> states;
  for (const OrderedJson& state : json) {
    states.push_back({.path = state.at("path").get<std::string>(),
                      .bytes = state.at("bytes"),
                      .modified_ns = state.at("modified_ns"),
                      .xxh3 = state.at("xxh3")});
  }
  return states;
}

OrderedJson to_json(const BuildRequest& request) {
  const Selection& selection = request.selection;
  OrderedJson json{{"city_points", request.city_points},
                   {"original_order", request.original_order},
                   {"remove_duplicates", request.remove_duplicates},
                   {"profile", static_cast<unsigned>(request.profile)},
                   {"page_shift", request.page_shift},
                   {"leaf_points", request.tree.leaf_points},
                   {"levels_per_stream", request.tree.levels_per_stream},
                   {"every", selection.every},
                   {"classes", selection.classes}};
  if (selection.channels) json["channels"] = *selection.channels;
  if (selection.level) json["level"] = *selection.level;
  if (selection.box) {
    const glm::dvec3 &low = selection.box->low, &high = selection.box->high;
    json["box"] = {low.x, low.y, low.z, high.x, high.y, high.z};
  }
  return json;
}

BuildRequest request_of(const OrderedJson& json) {
  BuildRequest request;
  request.city_points = json.at("city_points");
  request.original_order = json.at("original_order");
  request.remove_duplicates = json.at("remove_duplicates");
  const auto profile = json.at("profile").get<unsigned>();
  if (profile > static_cast<unsigned>(Profile::compact))
    throw DataError("there is no such profile");
  request.profile = static_cast<Profile>(profile);
  request.page_shift = json.at("page_shift");
  request.tree.leaf_points = json.at("leaf_points");
  request.tree.levels_per_stream = json.at("levels_per_stream");
  Selection& selection = request.selection;
  selection.every = json.at("every");
  selection.classes = json.at("classes").get<std::vector<std::uint64_t>>();
  if (json.contains("channels"))
    selection.channels = json.at("channels").get<std::vector<std::string>>();
  if (json.contains("level")) selection.level = json.at("level").get<unsigned>();
  if (json.contains("box")) {
    const auto box = json.at("box").get<std::array<double, 6>>();
    selection.box = {{box[0], box[1], box[2]}, {box[3], box[4], box[5]}};
  }
  return request;
}

OrderedJson to_json(const LightRequest& lighting) {
  return {{"rig", OrderedJson::parse(lights_record(lighting.lights.value()))},
          {"sun_rays", lighting.light_sampling.sun_rays},
          {"area_rays", lighting.light_sampling.area_rays}};
}

LightRequest lighting_of(const OrderedJson& json) {
  LightRequest lighting;
  lighting.lights = light_rig_from_json(json.at("rig").dump());
  lighting.light_sampling.sun_rays = json.at("sun_rays");
  lighting.light_sampling.area_rays = json.at("area_rays");
  return lighting;
}

/// Adds the number of bounces, the settings of the gather, and the lift of its receivers.
void put_gather(OrderedJson& json, const LightingRequest& request) {
  const GatherOptions& gather = request.gather;
  json["bounces"] = request.bounces;
  json["lift"] = request.lift;
  json["solid_angle"] = gather.solid_angle;
  json["parallax"] = gather.parallax;
  json["inflation"] = gather.inflation;
  json["resolution"] = gather.resolution;
  json["sides"] = static_cast<unsigned>(gather.sides);
}

/// Reads what put_gather() adds.
void get_gather(const OrderedJson& json, LightingRequest& request) {
  GatherOptions& gather = request.gather;
  request.bounces = json.at("bounces");
  request.lift = json.at("lift");
  gather.solid_angle = json.at("solid_angle");
  gather.parallax = json.at("parallax");
  gather.inflation = json.at("inflation");
  gather.resolution = json.at("resolution");
  if (json.at("sides").get<unsigned>() > static_cast<unsigned>(Sides::front))
    throw DataError("there are no such sides");
  gather.sides = static_cast<Sides>(json.at("sides").get<unsigned>());
}

OrderedJson to_json(const FarmShading& shading) {
  const ShadeRequest& request = shading.request;
  const Surroundings& around = request.gather.around;
  OrderedJson json{
      {"target", shading.target.string()},  {"ranges", shading.ranges}, {"count", request.count},
      {"colour_from", request.colour_from}, {"sphere", around.sphere},  {"cone", around.cone},
      {"falloff", around.falloff}};
  put_gather(json, request);
  if (std::isfinite(around.distance)) json["distance"] = around.distance;
  if (request.error) json["error"] = *request.error;
  return json;
}

FarmShading shading_of(const OrderedJson& json) {
  FarmShading shading;
  shading.target = json.at("target").get<std::string>();
  shading.ranges = json.at("ranges");
  ShadeRequest& request = shading.request;
  request.count = json.at("count");
  request.colour_from = json.at("colour_from");
  get_gather(json, request);
  Surroundings& around = request.gather.around;
  around.sphere = json.at("sphere");
  around.cone = json.at("cone");
  around.falloff = json.at("falloff");
  if (json.contains("distance")) around.distance = json.at("distance");
  if (json.contains("error")) request.error = json.at("error").get<double>();
  return shading;
}

OrderedJson to_json(const FarmFrames& frames) {
  OrderedJson json{{"options", frames.options},
                   {"directory", frames.directory.string()},
                   {"targets", to_json(frames.targets)}};
  put_gather(json, frames.lighting);
  if (frames.range) json["range"] = {frames.range->first, frames.range->last, frames.range->step};
  return json;
}

FarmFrames frames_of(const OrderedJson& json) {
  FarmFrames frames{.options = json.at("options").get<std::vector<std::string>>(),
                    .directory = json.at("directory").get<std::string>(),
                    .targets = {}};
  for (const OrderedJson& target : json.at("targets"))
    frames.targets.emplace_back(target.get<std::string>());
  get_gather(json, frames.lighting);
  if (json.contains("range")) {
    const auto range = json.at("range").get<std::array<std::int64_t, 3>>();
    frames.range = {range[0], range[1], range[2]};
  }
  return frames;
}

OrderedJson to_json(const FarmTask& task) {
  return {{"name", task.name()},
          {"kind", name_of(task.step.kind)},
          {"wave", task.step.wave},
          {"number", task.number},
          {"command", task.command},
          {"after", task.after ? OrderedJson(task.after->name()) : OrderedJson()},
          {"inputs", to_json(task.inputs)},
          {"outputs", to_json(task.outputs)},
          {"memory_bytes", task.memory_bytes},
          {"disk_bytes", task.disk_bytes},
          {"seconds", task.seconds}};
}

/// Returns a task without what follows from the plan: its command, its files and those before it.
FarmTask task_of(const OrderedJson& json) {
  FarmTask task;
  const auto kind = json.at("kind").get<std::string>();
  const auto known = std::ranges::find(kTaskKinds, kind, name_of);
  if (known == kTaskKinds.end()) throw DataError("there are no tasks `" + kind + "`");
  task.step = {*known, json.at("wave")};
  task.number = json.at("number");
  task.memory_bytes = json.at("memory_bytes");
  task.disk_bytes = json.at("disk_bytes");
  task.seconds = json.at("seconds");
  return task;
}

/// Keys are numbers of 126 bits: two halves, the high one first.
OrderedJson to_json(const std::vector<MortonKey>& keys) {
  OrderedJson list = OrderedJson::array();
  for (const MortonKey& key : keys) list.push_back({key.high, key.low});
  return list;
}

std::vector<MortonKey> keys_of(const OrderedJson& json) {
  std::vector<MortonKey> keys;
  for (const OrderedJson& key : json)
    keys.push_back({key.at(0).get<std::uint64_t>(), key.at(1).get<std::uint64_t>()});
  return keys;
}

FarmPlan plan_of(const OrderedJson& json) {
  if (json.at("format") != kFormat) throw DataError("it is no plan of this version");
  FarmPlan plan;
  plan.scene = json.at("scene").get<std::string>();
  plan.points = json.at("points");
  plan.emits = json.at("emits");
  plan.request = request_of(json.at("request"));
  plan.frame = {json.at("frame").at("origin").get<std::array<double, 3>>(),
                json.at("frame").at("edge")};
  for (const OrderedJson& input : json.at("inputs")) {
    plan.inputs.push_back(
        {.path = input.at("path").get<std::string>(),
         .blocks = {.first = input.at("blocks").at(0), .end = input.at("blocks").at(1)},
         .first = input.at("first"),
         .points = input.at("points"),
         .channels = channels_of(input.at("channels")),
         .taken = input.at("taken").get<std::vector<bool>>()});
  }
  for (const OrderedJson& file : json.at("files"))
    plan.files[file.at("path").get<std::string>()] = states_of(file.at("states"));
  plan.meta = {channels_of(json.at("channels")),
               json.at("texts").get<std::map<std::string, std::string>>()};
  plan.cuts = keys_of(json.at("cuts"));
  plan.borders = keys_of(json.at("borders"));
  if (json.contains("lighting")) plan.lighting = lighting_of(json.at("lighting"));
  if (json.contains("frames")) plan.frames = frames_of(json.at("frames"));
  if (json.contains("shading")) plan.shading = shading_of(json.at("shading"));
  for (const OrderedJson& task : json.at("tasks")) plan.tasks.push_back(task_of(task));
  return plan;
}

}  // namespace

std::string plan_to_json(const FarmPlan& plan) {
  OrderedJson inputs = OrderedJson::array(), files = OrderedJson::array(),
              tasks = OrderedJson::array();
  for (const FarmInput& input : plan.inputs) {
    inputs.push_back({{"path", input.path.string()},
                      {"blocks", {input.blocks.first, input.blocks.end}},
                      {"first", input.first},
                      {"points", input.points},
                      {"channels", to_json(input.channels)},
                      {"taken", input.taken}});
  }
  for (const auto& [path, states] : plan.files)
    files.push_back({{"path", path.string()}, {"states", to_json(states)}});
  for (const FarmTask& task : plan.tasks) tasks.push_back(to_json(task));
  OrderedJson json{{"format", kFormat},
                   {"scene", to_json(plan.scene)},
                   {"points", plan.points},
                   {"emits", plan.emits},
                   {"request", to_json(plan.request)},
                   {"frame", {{"origin", plan.frame.origin}, {"edge", plan.frame.edge}}},
                   {"inputs", inputs},
                   {"files", files},
                   {"channels", to_json(plan.meta.channels)},
                   {"texts", plan.meta.text},
                   {"cuts", to_json(plan.cuts)},
                   {"borders", to_json(plan.borders)},
                   {"tasks", tasks}};
  if (plan.lighting) json["lighting"] = to_json(*plan.lighting);
  if (plan.frames) json["frames"] = to_json(*plan.frames);
  if (plan.shading) json["shading"] = to_json(*plan.shading);
  return json.dump(1) + "\n";
}

FarmPlan plan_from_json(const std::string& text, const std::filesystem::path& file) {
  try {
    FarmPlan plan = plan_of(OrderedJson::parse(text));
    plan.file = file;
    return plan;
  } catch (const nlohmann::json::exception& error) {
    throw DataError(file.string() + ": " + error.what());
  } catch (const DataError& error) {
    throw DataError(file.string() + ": " + error.what());
  }
}

}  // namespace ptc
