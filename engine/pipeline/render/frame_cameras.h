// Internal to render_picture(): where the camera of each frame comes from.
#pragma once

#include <optional>
#include <vector>

#include "engine/pipeline/render/display.h"
#include "engine/pipeline/render/render_picture.h"
#include "engine/pipeline/render/subject.h"
#include "engine/store/reader.h"

namespace ptc {

/// What the pictures of a sequence have in common, as the first one has it.
struct Continuity {
  std::optional<Display> display;    ///< of a .png; empty: chosen by the first picture
  std::optional<Camera> camera;      ///< of a sequence without a camera of its own
  std::optional<glm::dvec3> middle;  ///< around which a turntable turns, scene units
};

/// Returns what a request says of it.
[[nodiscard]] Continuity continuity_of(const RenderRequest& request);

/// Returns the camera of a file at each frame of a request, or at the one picture of a request
/// without a sequence: of RenderRequest::camera_files, or else of its meshes. Nothing when the
/// request or the container names another camera, or no file has one.
/// @throws RequestError when no camera has the name that the request gives; as file_cameras()
[[nodiscard]] std::optional<std::vector<MeshCamera>> cameras_of_files(const RenderRequest& request,
                                                                      const ContainerReader& scene);

/// Returns the camera of each frame of a request.
/// @param of_files  as cameras_of_files() returns it
/// @param subject   loaded
/// @param kept      what is empty of its camera and middle is found
/// @throws RequestError when the size of the picture is out of range
[[nodiscard]] std::vector<Camera> cameras_of_frames(
    const RenderRequest& request, const ContainerReader& scene,
    const std::optional<std::vector<MeshCamera>>& of_files, const Subject& subject,
    Continuity& kept);

/// Returns the part of a camera's picture that a request asks for.
/// @throws RequestError when it is empty or leaves the picture
[[nodiscard]] ImageWindow window_of(const RenderRequest& request, const Camera& camera);

}  // namespace ptc
