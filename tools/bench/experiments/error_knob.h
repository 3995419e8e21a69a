// The error that --error is asked for compared with the error measured, and the errors of all
// settings that --error chooses from: the experiment `ptcbench error`.
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

/// What `ptcbench error` measures.
struct ErrorOptions {
  SceneOptions scene;
  std::vector<double> asked{0.1, 0.05, 0.03, 0.02};  ///< values of --error, shares
  unsigned checked = 1000;  ///< receivers of each run that are compared with rays
  unsigned rays = 8192;     ///< rays for each of those receivers
  unsigned climbed = 64;    ///< number of blocks of points that every setting shades
  std::vector<std::string> sets{kSets.begin(), kSets.end()};  ///< of kSets, those that are shaded
};

/// One run of ptcshade or ptcrender with --error.
struct ErrorRow {
  std::string scene, set;  ///< set: one of kSets; ptcrender shades "camera", ptcshade the others
  double asked = 0;        ///< value of --error, a share
  TuningReport tuning;
  CheckReport check;
  std::uint64_t receivers = 0;          ///< number of receivers shaded
  double us_per_receiver = 0;           ///< CPU time, without that of the pilots
  double wall_us_per_receiver = kNone;  ///< wall time of the stage that shades
  double pilot_share = 0;               ///< CPU time of the pilots over that of the whole run

  /// The error against rays at the same surfels, a share.
  [[nodiscard]] double measured() const noexcept { return check.discs.relative(); }
};

/// The runs of one scene, and the errors of its points at every setting of the ladder, coarse to
/// fine.
struct SceneErrors {
  std::string name;
  std::uint64_t surfels = 0;
  std::vector<ErrorRow> rows;
  std::vector<RungError> rungs;

  /// The exponent by which error depends on time over the ladder (fit_power_law()).
  [[nodiscard]] double slope() const;
};

/// Builds the scene, and shades its points, some of them far apart and its picture once for each
/// error asked.
/// @param work  a directory with room for the container and the outputs, which are gone at the end
/// @throws DataError, RequestError, std::system_error as build_container()
[[nodiscard]] SceneErrors measure_errors(const SceneChoice& choice, const ErrorOptions& options,
                                         const std::filesystem::path& work, const RunOptions& run,
                                         Progress& progress);

/// Makes the report "error": the rows, the ladder of all settings, its slopes, and a chart of
/// measured against asked and of error against time.
/// @param scenes  one or more
[[nodiscard]] Report report_of(const std::vector<SceneErrors>& scenes, unsigned runs = 1);

}  // namespace ptc::bench
