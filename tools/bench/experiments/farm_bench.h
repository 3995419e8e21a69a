// A scene built in parts beside the same scene built in one run, and a model of what many machines
// would take: the experiment `ptcbench farm`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/pipeline/run.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/experiments/farm_model.h"
#include "tools/bench/report/report.h"

namespace ptc::bench {

/// What `ptcbench farm` measures.
struct FarmBenchOptions {
  std::uint64_t points = 20'000'000;  ///< of the city
  std::uint64_t parts = 8;
  std::uint64_t shaded = 300'000;          ///< points of a smaller city, which is shaded as well
  std::vector<unsigned> workers{1, 2, 4};  ///< tasks at once, of one thread each
  std::uint64_t task_memory = std::uint64_t{512} << 20;
  std::uint64_t model_points = 100'000'000'000;
  std::vector<std::uint64_t> nodes{1, 3, 10, 30, 100, 300, 1000};
  FarmHardware hardware;  ///< of the model, but for the number of machines
  unsigned repeats = 5;
};

/// One way to build the city.
struct FarmRow {
  std::string way;       ///< "one run", "parts"
  unsigned workers = 0;  ///< threads of one run, or tasks at once
  Spread wall, cpu;      ///< seconds
  double overhead = 0;   ///< CPU time over that of one run with as many threads, less 1
  double model = 0;      ///< wall time by the model, seconds; NaN for one run
};

/// A run by the model.
struct FarmModelRow {
  FarmLoad load;
  std::uint64_t nodes = 0;
  FarmTimes times;
  double efficiency = 0;  ///< computing of all tasks over cores times seconds
  double plan_bytes = 0;
};

struct FarmResult {
  std::vector<FarmRow> rows;
  TaskCosts costs;
  std::vector<FarmModelRow> by_nodes, by_parts;
  double collect_seconds = 0;  ///< of the model, where all points are collected in one file
};

/// Builds the city in one run and in parts, by turns, compares what they hold, and plays the model
/// with what the tasks took.
/// @param work  directory for the files, which are gone at the end
/// @throws std::system_error (ENOSPC) when the disk has no room; DataError when the two differ
[[nodiscard]] FarmResult measure_farm(const FarmBenchOptions& options,
                                      const std::filesystem::path& work, const RunOptions& run,
                                      Progress& progress);

/// Plays the model with growing numbers of machines, and of parts on the most machines.
void play_all(FarmResult& result, const FarmBenchOptions& options);

/// Makes the report "farm".
[[nodiscard]] Report report_of(const FarmResult& result, const FarmBenchOptions& options);

}  // namespace ptc::bench
