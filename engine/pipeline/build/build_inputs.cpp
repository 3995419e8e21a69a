// The first of two passes over the inputs of a build.
//
//   read_inputs()   files --> bounds, about 2^16 sample positions, meshes in memory or spilled
//   feed_inputs()   files, meshes, city --> blocks of 2^14 surfels --> records --> sort
//
// Clouds are read twice, so that their points never have to fit in memory. The second pass counts
// them again: a file that changed in between is an error. A file that says the bounds of its points
// is read once, if it is the only one and they need nothing else of a first pass.
#include "engine/pipeline/build/build_inputs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/memory.h"
#include "engine/io/file/url.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/build/unknown_values.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/run.h"
#include "engine/pipeline/scene_record.h"
#include "engine/scene/procedural/city.h"

namespace ptc {
namespace {

/// Returns a grid of 256 x 256 positions on the ground of the city, in scene units.
std::vector<glm::dvec3> sample_ground(const Bounds& bounds) {
  const glm::dvec3 extent = bounds.high - bounds.low;
  const int up =
      extent.x < extent.y ? (extent.x < extent.z ? 0 : 2) : (extent.y < extent.z ? 1 : 2);
  std::vector<glm::dvec3> sample;
  for (int j = 0; j < 256; ++j) {
    for (int i = 0; i < 256; ++i) {
      glm::dvec3 p = bounds.low;
      p[(up + 1) % 3] += extent[(up + 1) % 3] * (i + 0.5) / 256;
      p[(up + 2) % 3] += extent[(up + 2) % 3] * (j + 0.5) / 256;
      sample.push_back(p);
    }
  }
  return sample;
}

/// Says whether a cloud was seen from above: it is far wider than high.
bool is_aerial(const Bounds& bounds, const glm::dvec3& up) {
  constexpr double kFlat = 0.3;  // height by width
  const glm::dvec3 extent = bounds.high - bounds.low;
  const double height = glm::dot(extent, up);
  double width = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (up[axis] == 0) width = std::min(width, extent[axis]);
  }
  return height <= kFlat * width;
}

BuildInputs lay_city(std::uint64_t points) {
  const Bounds bounds = city_bounds(points);
  return {.bounds = bounds, .sample = sample_ground(bounds), .lights = city_lights()};
}

/// Adds the channels of a container to a plan, as input 0.
/// @param clouds  that are added to its points
void plan_scene(const ContainerReader& scene, const Clouds& clouds, bool meshes,
                AttributePlan& plan) {
  // Its values matter where what is added may lack the channel, or may mark what is not known.
  // Numbers of points and marks say something of all points, unless a cloud has its own
  const std::vector<Channel>& channels = scene.meta().channels;
  const auto is_in = [](const Clouds::Cloud& cloud, const auto& matches) {
    return std::ranges::any_of(cloud.channels, matches);
  };
  std::vector<bool> wanted(channels.size());
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const Channel& channel = channels[i];
    const bool lacked =
        meshes || !std::ranges::all_of(clouds.files, [&](const Clouds::Cloud& c) {
          return is_in(c, [&](const Channel& other) { return same_but_for_group(other, channel); });
        });
    const bool named = std::ranges::any_of(clouds.files, [&](const Clouds::Cloud& c) {
      return is_in(c, [&](const Channel& other) { return other.name == channel.name; });
    });
    const bool complete = channel.name == kOriginalIndex || holds_marks(channel);
    wanted[i] = lacked && (named || !complete) && is_watched(channel);
  }
  plan.add_input(channels, taken_values(scene, wanted));
}

/// Plans the channels of all points, and settles what stands where points lack one.
void plan_channels(const BuildRequest& request, const ContainerReader* scene, bool meshes,
                   BuildInputs& inputs, Progress& progress) {
  AttributePlan& plan = inputs.attributes;
  std::vector<BuildSource> sources;
  bool indexed = request.original_order;
  if (scene) {
    plan_scene(*scene, inputs.clouds, meshes, plan);
    if (scene->superblock().points > 0) sources.push_back({file_name(scene->path()), 0});
    indexed |= find_in_row(scene->meta().channels, kOriginalIndex).has_value();
  }
  for (Clouds::Cloud& cloud : inputs.clouds.files) {
    if (!cloud.channels.empty()) cloud.input = plan.add_input(cloud.channels, cloud.taken);
    if (cloud.points > 0) sources.push_back({file_name(cloud.path), cloud.input});
  }
  if (meshes) sources.push_back({"what is sampled on meshes", AttributePlan::kNoInput});
  if (indexed) plan.add_original_index();
  mark_unknown_values(plan, sources, progress);
}

/// Says which points are lit how, once all inputs are known.
/// @param given  whether the request or a scene file gives the lights
void plan_light(const BuildRequest& request, const ContainerReader* scene, bool meshes, bool given,
                BuildInputs& inputs) {
  const Clouds& clouds = inputs.clouds;
  const bool has_clouds = clouds.points > 0, has_scene = scene && scene->superblock().points > 0;
  const auto files =
      std::ranges::count_if(clouds.files, [](const Clouds::Cloud& c) { return c.points > 0; });
  const bool several = files + (meshes ? 1 : 0) + (has_scene ? 1 : 0) > 1;
  // Emitters light by rays what they were built with: other points would stay without their light
  const bool baked = clouds.text.contains(kEmittersKey) || (has_scene && lit_by_emitters(*scene));
  // Radiance in other files is all the light that a point reflects, that of emitters included
  const bool whole = !clouds.unlit && !clouds.has_container && !meshes;
  const bool counted = whole && (has_scene ? lit_by_emitters(*scene) : clouds.emits);
  // Points that wait for the sky alone may stand beside others that were lit
  const bool scene_waits = has_scene && sky_is_gathered(*scene);
  const bool waiting = (has_clouds && clouds.unlit) || scene_waits,
             lit = meshes || clouds.has_lit_container || (has_scene && !scene_waits);
  const bool lamps = given && has_lamps(inputs.lights);
  inputs.relight = (several && baked && !counted) || (several && inputs.emitters && !has_clouds) ||
                   (waiting && lit) || (has_clouds && lamps && !scene);
  inputs.rays_at_emitters = inputs.emitters && request.sampling.lights.area_rays > 0 && !several;
  if (several) inputs.clouds.text.erase(kEmittersKey);
  if (counted) inputs.clouds.text[kEmittersKey] = "baked";
}

/// Reads the picture of the sky that an input recorded, from where it was or next to that input.
void load_recorded_sky(const SceneObjects& objects, BuildInputs& inputs, const MeshLimits& limits) {
  const auto name = inputs.clouds.named_by.find(kLightsKey);
  if (name == inputs.clouds.named_by.end()) return;
  const auto of = std::ranges::find_if(objects.objects, [&](const SceneObject& object) {
    return file_name(object.file) == name->second;
  });
  if (of == objects.objects.end()) return;
  const auto store = TextureStore::make(limits.textures, limits.temp_directory);
  static_cast<void>(load_sky_map(inputs.lights.sky, directory_of(of->file), *store));
}

BuildInputs read_files(const BuildRequest& request, BoundsFrom from, const ContainerReader* scene,
                       const MeshLimits& limits, Progress& progress) {
  BuildInputs inputs;
  Progress silent;
  SceneObjects objects =
      read_scene_objects(request.inputs, nullptr, limits.reading, request.moment);
  const bool alone = objects.objects.size() == 1 && objects.objects[0].places.size() <= 1 &&
                     !request.mesh && !scene;
  for (const SceneObject& object : objects.objects) {
    if (!holds_points(object.file)) continue;
    bool first = true;
    const auto measure = [&](const std::optional<Placement>& place) {
      inputs.clouds.measure(object.file, place, request.selection, from, alone,
                            std::exchange(first, false) ? progress : silent);
    };
    for (const Placement& place : object.places) measure(place);
    if (object.places.empty()) measure({});
  }
  for (SceneObject& object : objects.objects) object.places = {};  // load_meshes() reads them again
  const bool told = from == BoundsFrom::files && request.note_lost_records;
  inputs.clouds.shorten_records(told ? progress : silent);
  if (inputs.clouds.files.size() > 1) inputs.clouds.text.erase(kViewpointKey);
  if (!request.up.empty()) inputs.clouds.text[kUpKey] = request.up;
  if (inputs.clouds.scan) {
    inputs.clouds.scan->scanners = inputs.clouds.scanners;
    inputs.clouds.scan->up = glm::dvec3(up_of(inputs.clouds.text));
    inputs.clouds.scan->aerial = inputs.clouds.text.contains(kUpKey) &&
                                 is_aerial(inputs.clouds.bounds, inputs.clouds.scan->up);
  }
  inputs.bounds.add(inputs.clouds.bounds);
  inputs.sample = std::move(inputs.clouds.sample);
  LoadedMeshes meshes =
      load_meshes(request.inputs, request.mesh.get(),
                  {request.backdrop, request.one_sided, request.moment}, limits, progress);
  plan_channels(request, scene, !meshes.empty(), inputs, progress);
  const bool given = request.lights || objects.lights;
  if (request.lights) {
    inputs.lights = *request.lights;
  } else if (objects.lights) {
    inputs.lights = *objects.lights;
    const auto store = TextureStore::make(limits.textures, limits.temp_directory);
    static_cast<void>(load_sky_map(inputs.lights.sky, {}, *store));
  } else if (const std::string& lights = inputs.clouds.text[kLightsKey]; !lights.empty()) {
    inputs.lights = light_rig_from_json(lights);
  } else if (!meshes.lights.empty()) {
    inputs.lights = rig_of(meshes.lights);
  } else if (inputs.clouds.unlit) {
    inputs.lights = cloud_rig(up_of(inputs.clouds.text));
  }
  if (meshes.parts) {
    const bool lamps = !inputs.lights.points.empty() || !inputs.lights.spots.empty();
    SurfaceSurvey found = survey(*meshes.parts, kSampleKeys, lamps);
    inputs.emitters = found.emits;
    inputs.streamed = std::make_unique<StreamedMeshes>(
        StreamedMeshes{std::move(*meshes.parts), std::move(found)});
  } else {
    inputs.emitters = meshes.mesh.emits();
  }
  plan_light(request, scene, !meshes.empty(), given, inputs);
  if (meshes.empty()) {
    if (inputs.relight && !given) load_recorded_sky(objects, inputs, limits);
    return inputs;
  }
  if (!given && !inputs.clouds.text[kLightsKey].empty()) {
    load_recorded_sky(objects, inputs, limits);
  } else if (!given && !inputs.emitters && meshes.lights.empty()) {
    inputs.lights = default_rig(up_of(inputs.clouds.text));
  }
  if (inputs.streamed) {
    // Rays at the surfels light them, once all are in the container, unless all is dark
    inputs.relight |= inputs.emitters || has_lamps(inputs.lights) || inputs.clouds.points > 0 ||
                      scene || inputs.lights.sky.radiance != glm::vec3(0);
    inputs.rays_at_emitters = false;
    const StreamedMeshes& streamed = *inputs.streamed;
    inputs.bounds.add(streamed.parts.bounds());
    for (const std::vector<glm::dvec3>* places :
         {&streamed.found.by_area, &streamed.found.placed_by_area}) {
      inputs.sample.insert(inputs.sample.end(), places->begin(), places->end());
    }
    return_freed_memory();
    return inputs;
  }
  Mesh& mesh = meshes.mesh;
  inputs.bounds.add(mesh.bounds());
  const std::vector<glm::dvec3> on_mesh = places_on(mesh);
  inputs.sample.insert(inputs.sample.end(), on_mesh.begin(), on_mesh.end());
  const Solids solids = find_solids(mesh);  // before the ray scene, so that their peaks do not add
  inputs.lit = std::make_unique<LitMesh>(std::move(mesh), solids, inputs.lights, inputs.relight);
  return_freed_memory();  // that reading the files and building the ray scene took
  return inputs;
}

}  // namespace

std::vector<glm::dvec3> places_on(const Mesh& mesh, std::uint32_t first) {
  const auto area = [&](const std::array<std::uint32_t, 3>& t) {
    const glm::vec3& a = mesh.positions[t[0]];
    return glm::length(glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a));
  };
  double total = 0;
  const std::span triangles = std::span(mesh.triangles).subspan(first);
  for (const auto& t : triangles) total += static_cast<double>(area(t));
  const double step = total / static_cast<double>(kSampleKeys);
  std::vector<glm::dvec3> sample;
  double due = 0;     // area that was passed and has no position yet
  double golden = 0;  // place in the triangle; multiples of the golden ratio spread evenly
  for (const auto& t : triangles) {
    for (due += static_cast<double>(area(t)); due > 0 && step > 0; due -= step) {
      golden = std::fmod(golden + 0.618033988749895, 1.0);
      const glm::dvec3 a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
      sample.push_back(mesh.origin + a + std::sqrt(golden) * 0.5 * ((b - a) + (c - a)));
    }
  }
  return sample;
}

BuildInputs read_inputs(const BuildRequest& request, BoundsFrom from, const ContainerReader* scene,
                        const MeshLimits& limits, StageSeconds& seconds, Progress& progress) {
  if (request.city_points > 0) return lay_city(request.city_points);
  const Stage stage(seconds, progress, "read", 0, "points");
  return read_files(request, from, scene, limits, progress);
}

}  // namespace ptc
