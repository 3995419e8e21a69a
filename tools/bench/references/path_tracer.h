// Pictures by path tracing on the mesh: a judge of pictures that shares little code with the
// renderer.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"

namespace ptc::bench {

/// How a picture is traced.
struct PathOptions {
  unsigned paths = 1024;  ///< paths of each pixel, rounded up to a multiple of 2 x side x side
  unsigned side = 4;      ///< the rays of a pixel go through the middles of side x side squares
  /// The maximum number of reflections of a path. A picture with `bounces` of render_picture() has
  /// bounces + 1: the surface that the camera sees reflects once more.
  unsigned reflections = 9;
};

/// A picture as two independent halves, row by row from the top.
struct PathPicture {
  std::vector<glm::vec3> a, b;  ///< radiance by one half of the paths each, W/(m^2 sr)
  /// Whether every ray through the pixel meets a surface that does not emit. Other pixels show
  /// lamps or the sky, which say nothing about lighting.
  std::vector<char> judged;

  /// Returns the mean of both halves in a pixel.
  [[nodiscard]] glm::vec3 at(std::size_t pixel) const { return 0.5F * (a[pixel] + b[pixel]); }
};

/// Traces paths from the camera.
///
///     camera ---> surface ---> surface ---> ...    each continues along a random cosine ray,
///                    |            |                and asks one random place of the emitters,
///                  lamps        lamps              every sun, and every lamp without extent
///
/// Emitters that a cosine ray happens to meet count, too; the balance heuristic weighs both ways.
/// The back of a surface is black unless its material is double-sided or the camera looks at it. A
/// back does not emit. Shared with the renderer are RayScene (Embree, textures, interpolated
/// normals), Camera, Sky::at() and spot_share(); sampling, weights and the choice of emitters are
/// not.
/// @param lights    the directions of its suns and spots are unit
/// @param progress  gets one stage of as many steps as the picture has rows
/// The result depends on the arguments alone. Memory: 28 bytes a pixel, 8 bytes a triangle.
[[nodiscard]] PathPicture trace_paths(const RayScene& scene, const LightRig& lights,
                                      const Camera& camera, const PathOptions& options,
                                      const Executor& executor, Progress& progress);

}  // namespace ptc::bench
