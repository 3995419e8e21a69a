// A command of ptcbench: options, with the values that --quick gives them, and a measurement.
//
//   declare() -> command line -> shorten() with --quick -> check() -> run() -> Report -> files
//
// While it runs it publishes the report of each part that is measured.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/ptc.h"
#include "tools/bench/experiments/declaration.h"
#include "tools/bench/report/report.h"

namespace ptc::bench {

/// The label of an axis.
inline constexpr char kTimePerReceiver[] = "CPU time per receiver, \u00b5s";

/// Where and how an experiment runs.
struct Bench {
  std::filesystem::path work;  ///< directory for its temporary files, which are gone at the end
  RunOptions run;
  Progress& progress;
  std::function<void(const Report&)> publish;  ///< takes the report of what was measured so far
};

/// One command of ptcbench.
struct Experiment {
  const char* name;     ///< word on the command line, and name of the files
  const char* purpose;  ///< help text: what is measured against what
  const char* quick;    ///< help text: what --quick does
  /// Declares the experiment's own options.
  std::function<void(Declaration&)> declare;
  /// Measures, and returns the report.
  /// @throws DataError when an answer is wrong; std::system_error
  std::function<Report(const Bench&)> run;
  /// Refuses requests that cannot be measured, before anything is written; may be empty.
  /// @throws CLI::ValidationError, std::invalid_argument for options; DataError for files
  std::function<void()> check{};
};

[[nodiscard]] Experiment make_accuracy_experiment();
[[nodiscard]] Experiment make_build_experiment();
[[nodiscard]] Experiment make_cache_experiment();
[[nodiscard]] Experiment make_demo_experiment();
[[nodiscard]] Experiment make_error_experiment();
[[nodiscard]] Experiment make_farm_experiment();
[[nodiscard]] Experiment make_formats_experiment();
[[nodiscard]] Experiment make_glossy_experiment();
[[nodiscard]] Experiment make_growth_experiment();
[[nodiscard]] Experiment make_hunt_experiment();
[[nodiscard]] Experiment make_instructions_experiment();
[[nodiscard]] Experiment make_knob_experiment();
[[nodiscard]] Experiment make_model_experiment();
[[nodiscard]] Experiment make_mutations_experiment();
[[nodiscard]] Experiment make_relight_experiment();
[[nodiscard]] Experiment make_remote_experiment();
[[nodiscard]] Experiment make_rooms_experiment();
[[nodiscard]] Experiment make_scale_experiment();
[[nodiscard]] Experiment make_scan_experiment();
[[nodiscard]] Experiment make_sort_experiment();
[[nodiscard]] Experiment make_specks_experiment();
[[nodiscard]] Experiment make_stability_experiment();
[[nodiscard]] Experiment make_surfels_experiment();
[[nodiscard]] Experiment make_tolerance_experiment();
[[nodiscard]] Experiment make_truth_experiment();
[[nodiscard]] Experiment make_verify_experiment();

/// Runs an experiment that measures rows, and publishes a report whenever there are more rows.
/// @param measure  calls its last argument with all rows so far
/// @return the report of all rows
template <class Row, class Options>
[[nodiscard]] Report measure_rows(
    std::vector<Row> (*measure)(const Options&, const std::filesystem::path&, const RunOptions&,
                                Progress&, const std::function<void(const std::vector<Row>&)>&),
    const Options& options, const Bench& bench) {
  const auto so_far = [&](const std::vector<Row>& rows) {
    bench.publish(report_of(rows, options.repeats));
  };
  return report_of(measure(options, bench.work, bench.run, bench.progress, so_far),
                   options.repeats);
}

/// Measures scene after scene, and publishes a report after each.
/// @param measure  function of a SceneChoice, whose results report_of() takes
/// @return the report of all scenes
template <class Measure>
[[nodiscard]] Report measure_scenes(const SceneList& scenes, unsigned runs, const Bench& bench,
                                    const Measure& measure) {
  std::vector<std::invoke_result_t<Measure, const SceneChoice&>> done;
  for (const SceneChoice& choice : scenes.choices()) {
    done.push_back(measure(choice));
    bench.publish(report_of(done, runs));
  }
  return report_of(done, runs);
}

}  // namespace ptc::bench
