#include "engine/pipeline/render/picture_checks.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/text/text.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/light/built_scene.h"

namespace ptc {
namespace {

/// @throws RequestError when there is no target, when the ending of one is none that the run
///         writes, when a layer is unknown or not asked for, or when estimates, shadows or groups
///         have no file of all layers to go to
void check_targets(const RenderRequest& request, std::span<const PictureTarget> targets) {
  if (targets.empty()) throw RequestError("targets", "no picture to write is named");
  bool has_all = false;
  for (const PictureTarget& target : targets) {
    const std::string ending = lower_extension(target.path);
    if (request.vertices && ending != ".ply" && ending != ".glb") {
      throw RequestError("targets", "the name of a baked mesh must end in .ply or .glb, but is " +
                                        target.path.string());
    }
    if (!request.vertices && ending != ".exr" && ending != ".png") {
      throw RequestError("targets", "the name of a picture must end in .exr or .png, but is " +
                                        target.path.string());
    }
    if (std::ranges::find(kPictureLayers, target.layer) == kPictureLayers.end()) {
      throw RequestError("targets", "there is no layer '" + target.layer + "' to show");
    }
    if (target.layer == "reflection" && ending == ".png" && !request.glossy.roughness) {
      throw RequestError(
          "targets",
          "the layer 'reflection' needs a roughness: ask for `glossy.roughness` as well");
    }
    if (target.layer == "irradiance" && !request.bakes()) {
      throw RequestError("targets",
                         "a picture has no layer 'irradiance': only what is baked has it");
    }
    const bool is_seen = target.layer == "depth" || target.layer == "normal",
               is_id = target.layer == "object_id" || target.layer == "material_id";
    if ((is_seen && request.bakes()) || (is_id && request.vertices)) {
      throw RequestError("targets", fmt::format("{} have no layer '{}': only pictures{} have it",
                                                request.vertices ? "vertices" : "textures",
                                                target.layer, is_id ? " and textures" : ""));
    }
    has_all |= ending == ".exr" || ending == ".ply";
  }
  const auto needs_all = [&](bool asked, const char* field) {
    if (!asked || has_all) return;
    const char* const all = request.vertices ? "a .ply" : "an .exr";
    throw RequestError(field, fmt::format("`{}` adds layers, which only {} has: name {} as output",
                                          field, all, all));
  };
  needs_all(!request.shadows.empty(), "shadows");
  needs_all(request.light_groups, "light_groups");
  needs_all(request.estimate, "estimate");
}

/// Returns the files that a run reads, also those that scene files name.
std::vector<std::filesystem::path> files_read(const RenderRequest& request) {
  std::vector<std::filesystem::path> files = scene_files(request);
  for (const auto& more : {request.meshes, request.camera_files})
    files.insert(files.end(), more.begin(), more.end());
  const std::vector<std::filesystem::path> named =
      read_scene_objects(files, nullptr, request.run.memory_bytes).named;
  files.insert(files.end(), named.begin(), named.end());
  return files;
}

std::filesystem::path whole_name(const std::filesystem::path& path) {
  return std::filesystem::absolute(path).lexically_normal();
}

}  // namespace

unsigned side_of(unsigned samples) {
  const auto side = static_cast<unsigned>(std::lround(std::sqrt(samples)));
  if (side == 0 || side * side != samples) {
    throw RequestError("samples", fmt::format("`samples` is {}: it must be a square number, such "
                                              "as 1, 4, 9 or 16",
                                              samples));
  }
  return side;
}

void check_names(const RenderRequest& request, std::span<const PictureTarget> targets,
                 const std::string& sky_picture) {
  std::vector<std::filesystem::path> taken = files_read(request);
  if (!sky_picture.empty()) taken.emplace_back(sky_picture);
  const std::size_t read = taken.size();
  const auto refuse = [](const std::filesystem::path& path, bool is_read) {
    throw RequestError("targets",
                       path.string() + (is_read ? " is read by this run: choose another name"
                                                : " is the name of two pictures"));
  };
  for (const PictureTarget& target : targets) {
    for (std::size_t i = 0; i < taken.size(); ++i) {
      if (same_name(target.path, taken[i])) refuse(target.path, i < read);
    }
    taken.push_back(target.path);
  }
  if (!request.sequence) return;

  // The numbers of frames may make two names one
  std::set<std::filesystem::path> names;
  for (std::size_t i = 0; i < read; ++i) names.insert(whole_name(taken[i]));
  const FrameRange& frames = request.sequence->frames;
  for (std::size_t i = 0; i < frames.count(); ++i) {
    std::set<std::filesystem::path> of_frame;
    for (const PictureTarget& target : targets_of_frame(targets, frames[i])) {
      const std::filesystem::path name = whole_name(target.path);
      if (names.contains(name)) refuse(target.path, true);
      if (!of_frame.insert(name).second) refuse(target.path, false);
    }
  }
}

void check_request(const RenderRequest& request, std::span<const PictureTarget> targets) {
  check_targets(request, targets);
  if (request.lights) check_lights(*request.lights);
  if (request.camera) check_camera(*request.camera, "camera");
  if (request.sequence) {
    check_sequence(*request.sequence);
    require_request(!request.bakes(), "sequence.frames",
                    "`sequence.frames` are for pictures: what is baked has none");
    require_request(!request.glossy.roughness || request.check.receivers == 0, "check",
                    "`check` compares reflections of one picture: leave out the frames");
    static_cast<void>(targets_of_frame(targets, request.sequence->frames.first));
  }
  require_request(!request.bakes() || (!request.camera && request.camera_name.empty()), "camera",
                  "`camera` is for pictures: what is baked has none");
  require_request(!request.bakes() || !request.crop, "crop",
                  "`crop` is for pictures: what is baked is baked whole");
  require_request(!request.camera || request.camera_name.empty(), "camera_name",
                  "`camera_name` and a camera exclude each other");
  require_request(!request.bakes() || !request.light_groups, "light_groups",
                  "`light_groups` is for pictures: what is baked has no layers for them");
  require_request(!request.vertices || !request.texture, "texture",
                  "a run bakes a texture or vertices, not both");
  require_request(!request.vertices || !request.size, "size",
                  "`size` is for pictures and textures: vertices have none");
  static_cast<void>(side_of(request.samples));
}

}  // namespace ptc
