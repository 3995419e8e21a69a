// What a tolerance saves, and what it costs: the experiment `ptcbench tolerance`.
//
//   scene -> exact container -> compact, and one for each tolerance -> bytes, error of what is
//   stored
//                    \-> the same receivers shaded from each            -> time of a receiver
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/pipeline/quality/simplification_choice.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// What `ptcbench tolerance` measures.
struct ToleranceOptions {
  std::vector<double> tolerances{0.01, 0.03, 0.1};  ///< shares, ascending
  std::uint64_t points = 1'000'000;                 ///< of the exact container, about
  std::uint64_t receivers = 50'000;                 ///< points of it that are shaded
  unsigned repeats = 5;                             ///< shadings with each container
};

/// One container.
struct ToleranceRow {
  std::string scene;
  double tolerance = 0;        ///< 0: the profile compact
  std::uint64_t points = 0;    ///< that are left
  std::uint64_t bytes = 0;     ///< of the file
  double bytes_per_point = 0;  ///< for each point of the exact container
  double ratio = 1;            ///< of the bytes to those of compact
  SimplificationTrial found;   ///< its errors; those of compact are of rounding alone
  double choosing = 0;         ///< seconds of all trials
  Spread shading;              ///< CPU time of a receiver, microseconds
};

/// All containers of a scene.
struct ToleranceScene {
  std::vector<ToleranceRow> rows;
};

/// Measures one scene.
/// @param work  a directory with room for three containers
/// @throws as build_container(), choose_simplification() and shade_container()
[[nodiscard]] ToleranceScene measure_tolerance(const SceneChoice& choice,
                                               const ToleranceOptions& options,
                                               const std::filesystem::path& work,
                                               const RunOptions& run, Progress& progress);

}  // namespace ptc::bench
