#include "engine/pipeline/render/frame_cameras.h"

#include <algorithm>
#include <cstddef>
#include <string>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/scene_record.h"

namespace ptc {
namespace {

/// @throws RequestError when a picture of this camera has no pixels or too many
void check_size(const Camera& camera) {
  if (is_image_size(camera.width, camera.height)) return;
  throw RequestError("size",
                     fmt::format("`size` is {} x {}: a picture has 1 to {} pixels along each "
                                 "side, and at most {} in all",
                                 camera.width, camera.height, kMaxImageSide, kMaxImagePixels));
}

/// Returns the index of the camera with a name. @throws RequestError when there is none
std::size_t index_of(const std::vector<MeshCamera>& cameras, const std::string& name) {
  const auto found = std::ranges::find(cameras, name, &MeshCamera::name);
  if (found != cameras.end()) return static_cast<std::size_t>(found - cameras.begin());
  std::string names;
  for (const MeshCamera& camera : cameras) {
    if (!camera.name.empty()) names += (names.empty() ? "\"" : ", \"") + camera.name + '"';
  }
  throw RequestError("camera_name",
                     fmt::format("no camera has the name \"{}\": {}", name,
                                 names.empty() ? "the files name none" : "there are " + names));
}

/// Returns the camera that does not come from a file.
Camera fixed_camera(const RenderRequest& request, const ContainerReader& scene,
                    const Subject& subject) {
  if (request.bakes()) {
    constexpr unsigned kSide = 1024;
    const Bounds box = subject.mesh.bounds();
    Camera camera{.position = 0.5 * (box.low + box.high), .width = kSide, .height = kSide};
    if (request.vertices) {
      // As wide as a tile, so that the vertices of one follow one another
      camera.width = TileRenderer::tile_of(1, subject.side).width;
      camera.height =
          static_cast<unsigned>((subject.mesh.positions.size() + camera.width - 1) / camera.width);
    }
    return camera;
  }
  if (request.camera) return *request.camera;
  std::optional<Bounds> box;
  if (request.backdrop && subject.has_mesh()) box = bounds_before_backdrop(subject.mesh);
  return default_camera(scene, {}, box, request.size);
}

/// Returns the middle of what a camera sees, scene units.
glm::dvec3 middle_of(const RenderRequest& request, const ContainerReader& scene,
                     const Subject& subject) {
  if (subject.has_mesh()) {
    const Bounds box =
        request.backdrop ? bounds_before_backdrop(subject.mesh) : subject.mesh.bounds();
    return 0.5 * (box.low + box.high);
  }
  const Superblock& s = scene.superblock();
  glm::dvec3 middle;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    middle[k] = 0.5 * (s.bounds_low[axis] + s.bounds_high[axis]);
  }
  return middle;
}

}  // namespace

Continuity continuity_of(const RenderRequest& request) {
  Continuity kept;
  if (request.exposure) kept.display = Display::at_exposure(*request.exposure);
  return kept;
}

std::optional<std::vector<MeshCamera>> cameras_of_files(const RenderRequest& request,
                                                        const ContainerReader& scene) {
  if (request.camera || request.bakes()) return {};
  const bool is_named = !request.camera_name.empty();
  const std::uint64_t memory = request.run.memory_bytes;

  // Find the camera among those of the files, and then of the meshes
  std::vector<std::filesystem::path> files = request.camera_files;
  std::vector<MeshCamera> still = file_cameras(files, {}, memory);
  if (is_named || (still.empty() && !scene.meta().text.contains(kCameraKey))) {
    files.insert(files.end(), request.meshes.begin(), request.meshes.end());
    still = file_cameras(files, {}, memory);
  }
  if (still.empty() && !is_named) return {};
  const std::size_t index = is_named ? index_of(still, request.camera_name) : 0;
  if (!request.sequence) return std::vector{still[index]};

  // Follow it
  const FrameRange& frames = request.sequence->frames;
  if (!cameras_may_move(files, memory)) return std::vector(frames.count(), still[index]);
  std::vector<MeshCamera> cameras;
  for (std::size_t i = 0; i < frames.count(); ++i) {
    const std::vector<MeshCamera> now =
        file_cameras(files, moment_of(*request.sequence, i), memory);
    if (now.size() != still.size()) {
      throw DataError(
          fmt::format("{}: a camera is missing at frame {}, because its node has a "
                      "scale of 0 there",
                      files.front().string(), frames[i]));
    }
    cameras.push_back(now[index]);
  }
  return cameras;
}

std::vector<Camera> cameras_of_frames(const RenderRequest& request, const ContainerReader& scene,
                                      const std::optional<std::vector<MeshCamera>>& of_files,
                                      const Subject& subject, Continuity& kept) {
  std::vector<Camera> cameras;
  if (of_files) {
    for (const MeshCamera& camera : *of_files) cameras.push_back(camera_of(camera, request.size));
  } else {
    if (!kept.camera) kept.camera = fixed_camera(request, scene, subject);
    cameras.assign(request.sequence ? request.sequence->frames.count() : 1, *kept.camera);
  }
  if (request.sequence && request.sequence->turntable > 0) {
    const glm::dvec3 up(up_of(scene.meta().text));
    if (!kept.middle)
      kept.middle = of_files ? middle_of(request, scene, subject) : cameras[0].look_at;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      cameras[i] = turned_around(cameras[i], *kept.middle, up,
                                 turntable_angle(*request.sequence, request.sequence->frames[i]));
    }
  }
  for (Camera& camera : cameras) {
    if (request.size) {
      camera.width = (*request.size)[0];
      camera.height = (*request.size)[1];
    }
    if (!request.vertices) check_size(camera);
  }
  return cameras;
}

ImageWindow window_of(const RenderRequest& request, const Camera& camera) {
  ImageWindow window = ImageWindow::whole(camera.width, camera.height);
  if (!request.crop) return window;
  const auto& [x0, y0, x1, y1] = *request.crop;
  if (x0 >= x1 || y0 >= y1 || x1 > camera.width || y1 > camera.height) {
    throw RequestError("crop", fmt::format("`crop` is {},{} to {},{}: it is empty, or leaves the "
                                           "picture of {} x {} pixels",
                                           x0, y0, x1, y1, camera.width, camera.height));
  }
  window.x = x0;
  window.y = y0;
  window.width = x1 - x0;
  window.height = y1 - y0;
  return window;
}

}  // namespace ptc
