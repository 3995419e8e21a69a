#include "engine/pipeline/render/picture_checks.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/text/text.h"
#include "engine/pipeline/light/built_scene.h"

namespace ptc {
namespace {

/// @throws RequestError when there is no target, when the ending of one is neither .exr nor .png,
///         when a layer is unknown or not asked for, or when estimates, shadows or groups have no
///         .exr to go to
void check_targets(const RenderRequest& request, std::span<const PictureTarget> targets) {
  if (targets.empty()) throw RequestError("targets", "no picture to write is named");
  bool exr = false;
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
      throw RequestError("targets", "a picture has no layer '" + target.layer + "' for a .png");
    }
    if (target.layer == "reflection" && ending == ".png" && !request.glossy.roughness) {
      throw RequestError(
          "targets",
          "the layer 'reflection' needs a roughness: ask for `glossy.roughness` as well");
    }
    if (target.layer == "irradiance" && !request.bakes()) {
      throw RequestError("targets", "a picture has no layer 'irradiance': only a texture has it");
    }
    exr |= ending == ".exr" || ending == ".ply";
  }
  if (!request.shadows.empty() && !exr) {
    throw RequestError("shadows",
                       "`shadows` adds layers, which only an .exr has: name an .exr as output");
  }
  if (request.light_groups && !exr) {
    throw RequestError("light_groups",
                       "`light_groups` adds layers, which only an .exr has: name "
                       "an .exr as output");
  }
  if (request.estimate && !exr) {
    throw RequestError("estimate",
                       "`estimate` adds layers, which only an .exr has: name an .exr as output");
  }
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
  std::vector<std::filesystem::path> taken = scene_files(request);
  taken.insert(taken.end(), request.meshes.begin(), request.meshes.end());
  if (!sky_picture.empty()) taken.emplace_back(sky_picture);
  const std::size_t read = taken.size();
  for (const PictureTarget& target : targets) {
    for (std::size_t i = 0; i < taken.size(); ++i) {
      if (!same_name(target.path, taken[i])) continue;
      throw RequestError(
          "targets", target.path.string() + (i < read ? " is read by this run: choose another name"
                                                      : " is the name of two pictures"));
    }
    taken.push_back(target.path);
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
