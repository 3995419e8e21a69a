// Whether --error keeps its word: the experiment `ptcbench knob`.
//
//   receivers of a set ---> pilots of seed 1 -> tune() -> setting -+
//           |         `---> pilots of seed 2 -> tune() -> setting -+-> its error at many others
//           `-------------> many other receivers ------------------'   against what was asked
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/pipeline/quality/tuning.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// What `ptcbench knob` measures.
struct KnobOptions {
  SceneOptions scene;
  std::vector<double> asked{0.05, 0.03};  ///< errors asked, shares
  unsigned seeds = 20;                    ///< choices of pilots
  unsigned checked = 2048;                ///< receivers at which errors are measured, about
  unsigned rays = 4096;                   ///< rays for each of those receivers
  std::vector<std::string> sets{kSets.begin(), kSets.end()};  ///< of kSets, those that are shaded
};

/// What one choice of pilots led to.
struct KnobChoice {
  TuningReport tuning;
  double error = 0;  ///< of the setting or of the rays that were chosen, at the other receivers
  double cost = 0;   ///< of a receiver, as counts tell it, microseconds of CPU
  /// Whether another setting costs less and has a smaller error.
  bool is_dominated = false;
};

/// All choices for one set of receivers and one error asked.
struct KnobRow {
  std::string scene, set;
  double asked = 0;  ///< a share
  std::vector<KnobChoice> choices;
  std::optional<double> least_cost;  ///< of the cheapest setting that meets it, microseconds

  /// The number of choices that were said to meet what is asked and do not.
  [[nodiscard]] std::size_t missed() const;
  /// The number of choices that were not said to meet it.
  [[nodiscard]] std::size_t refused() const;
  /// The number of choices whose told bounds do not hold their error.
  [[nodiscard]] std::size_t outside() const;
};

/// Measures one scene.
/// @param work  a directory with room for the container
/// @throws DataError, RequestError, std::system_error as build_container()
[[nodiscard]] std::vector<KnobRow> measure_knob(const SceneChoice& choice,
                                                const KnobOptions& options,
                                                const std::filesystem::path& work,
                                                const RunOptions& run, Progress& progress);

}  // namespace ptc::bench
