// Occlusion at the points of a scan against rays at the mesh that it was drawn from: the experiment
// `ptcbench specks`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/ptc.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// What `ptcbench specks` measures.
struct SpecksOptions {
  std::uint64_t points = 300'000;
  unsigned checked = 5'000;  ///< points that are compared with rays
  unsigned rays = 1'024;     ///< for each of them
  GatherOptions gather;
  float lift = LightingRequest{}.lift;
};

/// One cloud.
struct SpecksRow {
  std::string scene, cloud;
  std::uint64_t points = 0, checked = 0;
  double rms = 0, mean = 0;  ///< of the difference of occlusion, ours less that of the rays
  double specks = 0;         ///< share of points that are off by more than 0.3
  /// Share of the pixels inside the silhouette of the mesh in which the picture of the points shows
  /// the background or a farther surface: the greater one of two pictures, of the whole scene and
  /// of its middle at a fourth of the angle.
  double holes = 0;
  double picture_rms = 0;  ///< of the difference of occlusion in these pictures, the greater one
  double build_us = 0, shade_us = 0;  ///< wall time a point
};

/// Draws a clean cloud from a mesh, one with noise, one with gaps and one of uneven density; builds
/// and shades each as ptcshade does, and compares.
/// @throws DataError when the scene is no mesh; std::system_error
[[nodiscard]] std::vector<SpecksRow> measure_specks(const SceneChoice& choice,
                                                    const SpecksOptions& options,
                                                    const std::filesystem::path& work,
                                                    const RunOptions& run, Progress& progress);

/// Makes the report "specks". @param scenes  one or more
[[nodiscard]] Report report_of(const std::vector<std::vector<SpecksRow>>& scenes, unsigned runs);

}  // namespace ptc::bench
