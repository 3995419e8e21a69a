// Renders pictures: a container, and what a camera sees, to .exr and .png files.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/render/film.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// A picture of a mesh, or of the surfels themselves, by the light of a container's surfels.
struct RenderRequest : LightingRequest {
  std::vector<std::filesystem::path> meshes;  ///< what the camera sees; empty: the surfels
  std::shared_ptr<const Mesh> mesh;           ///< a mesh in memory, besides those
  bool backdrop = false;                      ///< sets the meshes on a ground before a red wall
  std::optional<Camera> camera;  ///< empty: the mesh's or the build's, else a view of everything
  std::optional<std::array<unsigned, 2>> size;  ///< width and height in place of the camera's
  unsigned samples = 4;                         ///< per pixel, a square number
  std::optional<LightRig> lights;               ///< empty: those that the scene was built with
  /// Shadow rays of the camera's samples. Emissive triangles are surfels, so the gather brings
  /// their light; area rays would add it once more.
  LightSampling light_sampling{.sun_rays = 4, .area_rays = 0, .sky_rays = 0};
  float exposure = 0;  ///< stops, for a .png of light
};

/// Renders to .exr (beauty as RGB and the layers direct, indirect, occlusion, bent_normal, albedo
/// and alpha) and .png (one of them).
///
/// direct = emission + albedo / pi * (lights + sky), indirect = albedo / pi * irradiance from
/// surfaces, beauty = direct + indirect. Pixels that meet nothing show the sky. Estimates add the
/// layers occlusion_error and irradiance_error to an .exr: the root mean square over the samples of
/// a pixel, which is an upper bound on the error of their mean.
/// @param targets  one or more files, all from one rendering
/// @throws RequestError when the request excludes itself, LimitError for a cap that is too small,
///         DataError and FormatError for damaged input, std::system_error
LightingReport render_picture(const RenderRequest& request, std::span<const PictureTarget> targets,
                              Progress& progress);

}  // namespace ptc
