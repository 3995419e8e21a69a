// How many surfels meshes need for an error, evenly spread and adapted: the experiment
// `ptcbench surfels`.
//
//   counts x (even, adapted) -> container -> error against the mesh, bytes, time of the build
//                    error asked -> surfels that each needs -> time of a picture
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/pipeline/quality/surfel_choice.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// What `ptcbench surfels` measures.
struct SurfelsOptions {
  /// Surfels wanted, ascending.
  std::vector<std::uint64_t> counts{16'000, 32'000, 64'000, 125'000, 250'000, 500'000, 1'000'000};
  double asked = 0.03;   ///< error for which the surfels and the pictures are compared
  unsigned repeats = 5;  ///< pictures of each
  unsigned width = 480, height = 270;  ///< of the pictures, pixels
};

/// One container.
struct SurfelsRow {
  std::string scene;
  SurfelTrial trial;
};

/// What one of the two ways needs to keep an error, between the two containers around it.
struct SurfelsNeed {
  double surfels = kNone;
  double bytes = kNone;
  Spread picture_cpu = kNoSpread;  ///< CPU time of the gather of a picture, seconds
};

/// What both ways need on one scene.
struct SurfelsNeeds {
  std::string scene;
  double asked = 0;  ///< a share
  SurfelsNeed even, adapted;
};

/// Everything that is measured of one scene.
struct SurfelsScene {
  std::vector<SurfelsRow> rows;
  SurfelsNeeds needs;
};

/// Returns the number of surfels and the bytes at which trials of one way keep an error: the first
/// crossing of the lines through their errors, all in logarithms; those of the first trial where
/// that keeps it already; kNone where none does.
/// @param trials  by ascending count
[[nodiscard]] SurfelsNeed need_of(const std::vector<SurfelTrial>& trials, double asked);

/// Measures one scene.
/// @param work  a directory with room for the containers
/// @throws as choose_surfels() and render_picture()
[[nodiscard]] SurfelsScene measure_surfels(const SceneChoice& choice, const SurfelsOptions& options,
                                           const std::filesystem::path& work, const RunOptions& run,
                                           Progress& progress);

}  // namespace ptc::bench
