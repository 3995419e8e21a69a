// Pictures of rooms beside the same pictures by path tracing: the experiment `ptcbench rooms`.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/image/image.h"
#include "engine/ptc.h"
#include "tools/bench/references/path_tracer.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// What `ptcbench rooms` measures.
struct RoomsOptions {
  std::uint64_t points = 300'000;          ///< surfels wanted of a mesh
  std::array<unsigned, 2> size{192, 144};  ///< pixels of a picture
  unsigned side = 4;                       ///< samples along the side of a pixel
  unsigned bounces = 8;
  unsigned paths = 2048;  ///< of the reference, for each pixel
  /// Place and angle of the camera; empty: the scene's own.
  std::optional<Camera> camera;
  std::optional<LightRig> lights;  ///< of scenes from files; empty: as build_container() chooses
  std::filesystem::path pictures;  ///< directory for pictures as EXR; empty: none are written
};

/// One scene. Errors are those of pixels that show surfaces alone, in all three channels.
struct RoomRow {
  std::string scene;
  std::uint64_t triangles = 0, surfels = 0;
  double judged = 0;              ///< share of the pixels whose errors count
  double bias = 0;                ///< ratio of means, ours over that of the paths, less 1
  double rms = 0;                 ///< over the mean of the paths, without their noise
  double noise = 0;               ///< RMS of the paths' own error, over their mean
  double flip = 0, hdr_flip = 0;  ///< means over the picture
  double noise_hdr_flip = 0;      ///< between the two halves of the paths, each noisier than both
  double build_seconds = 0;       ///< wall time of the container
  double render_seconds = 0;      ///< wall time of our picture
  double path_seconds = 0;        ///< wall time of the paths
};

/// A scene and its pictures.
struct Room {
  RoomRow row;
  Image sheet;  ///< ours, paths and HDR-FLIP side by side
};

/// A scene that is built, with everything that both pictures need.
struct BuiltRoom {
  Mesh mesh;
  LightRig lights;
  Camera camera;
  std::uint64_t surfels = 0;
  double build_seconds = 0;
};

/// Builds the container of a scene, and finds its camera.
/// @param target  path of the container
/// @throws DataError when the scene is no mesh; RequestError; std::system_error
[[nodiscard]] BuiltRoom build_room(const SceneChoice& choice, const RoomsOptions& options,
                                   const std::filesystem::path& target, const RunOptions& run,
                                   Progress& progress);

/// Returns the mean of both halves of a picture.
[[nodiscard]] Image image_of(const PathPicture& paths, unsigned width, unsigned height);
/// Returns the factor by which a picture is shown: nine in ten of its lit pixels are below white.
[[nodiscard]] float exposure_of(const Image& image);
/// Returns a picture times a factor.
[[nodiscard]] Image scaled(Image image, float factor);

/// Builds and renders a scene with default options, traces paths from the same camera, and
/// compares.
/// @param work  directory for the container
/// @throws DataError when the scene is no mesh; RequestError; std::system_error
[[nodiscard]] Room measure_room(const SceneChoice& choice, const RoomsOptions& options,
                                const std::filesystem::path& work, const RunOptions& run,
                                Progress& progress);

/// Compares a picture with paths. @return the errors alone
[[nodiscard]] RoomRow compare_room(const Image& ours, const PathPicture& paths);

/// Makes the report "rooms". @param rooms  one or more
[[nodiscard]] Report report_of(const std::vector<Room>& rooms, unsigned runs);

}  // namespace ptc::bench
