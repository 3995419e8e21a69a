// Pictures of a number of bounces beside a path tracer that is not ours: `ptcbench truth`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/bench/experiments/rooms.h"

namespace ptc::bench {

/// What `ptcbench truth` measures.
struct TruthOptions {
  /// Surfels, size, samples and paths; `bounces` counts for nothing.
  RoomsOptions room{.paths = 1024};
  std::vector<unsigned> bounces{1, 2, 4, 8};
  std::filesystem::path python;  ///< an interpreter that has Mitsuba 3; empty: trace_paths() judges
};

/// A picture of one scene with one number of bounces.
struct TruthRow {
  std::string judge;  ///< "Mitsuba 3.9.1" or "own paths"
  unsigned bounces = 0;
  RoomRow errors;
};

/// A scene, its pictures of all numbers of bounces, and the one with most of them to look at.
struct Truth {
  std::string scene;
  std::vector<TruthRow> rows;
  Image sheet;  ///< ours, the judge's and HDR-FLIP side by side
};

/// Builds a scene, renders it with each number of bounces, has the same pictures rendered by the
/// judge, and compares. Pixels in which more than one surface is seen do not count: the judge has
/// other rays through them.
/// @param work  directory for temporary files
/// @throws DataError when the scene is no mesh, or Mitsuba cannot be run; RequestError when it has
///         something that write_mitsuba_scene() does not write; std::system_error
[[nodiscard]] Truth measure_truth(const SceneChoice& choice, const TruthOptions& options,
                                  const std::filesystem::path& work, const RunOptions& run,
                                  Progress& progress);

/// Makes the report "truth". @param scenes  one or more
[[nodiscard]] Report report_of(const std::vector<Truth>& scenes, unsigned runs);

}  // namespace ptc::bench
