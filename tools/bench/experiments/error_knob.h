// What is asked of --error, and what comes of it; the errors of its settings.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/pipeline/quality/tuning.h"
#include "engine/ptc.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

struct ErrorOptions {
  SceneOptions scene;
  std::vector<double> asked{0.1, 0.05, 0.03, 0.02};  ///< shares
  unsigned checked = 1000;  ///< receivers of each run that are compared with rays
  unsigned rays = 8192;     ///< for each of them
  unsigned climbed = 64;    ///< blocks of points that every setting shades
};

/// One run that was asked for an error.
struct ErrorRow {
  std::string scene, set;  ///< "points" of ptcshade, or the "camera" of ptcrender
  double asked = 0;
  TuningReport tuning;
  CheckReport check;
  std::uint64_t receivers = 0;
  double us_per_receiver = 0;  ///< CPU time, without the pilots'
  double wall_us_per_receiver = kNone;
  double pilot_share = 0;  ///< of the CPU time of gather and pilots together

  [[nodiscard]] double measured() const noexcept { return check.discs.relative(); }
};

/// Errors of a scene's points over the whole ladder, coarse to fine.
struct SceneErrors {
  std::string name;
  std::uint64_t surfels = 0;
  std::vector<ErrorRow> rows;
  std::vector<RungError> rungs;

  /// Exponent of error over time by least squares of logarithms.
  [[nodiscard]] double slope() const;
};

/// Builds the scene, shades its points and its picture once for each error asked.
/// @param work  a directory with room for the container and what is shaded, which go again
/// @throws DataError, RequestError, std::system_error as build_container()
[[nodiscard]] SceneErrors measure_errors(const SceneChoice& choice, const ErrorOptions& options,
                                         const std::filesystem::path& work, const RunOptions& run,
                                         Progress& progress);

/// Files "error": the rows, the ladder of all settings, its slopes, and a chart of measured against
/// asked and of error against time.
/// @param scenes  one or more
[[nodiscard]] Report report_of(const std::vector<SceneErrors>& scenes, unsigned runs = 1);

}  // namespace ptc::bench
