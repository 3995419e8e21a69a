// Normals and radii of clouds that were sampled from meshes, compared with the mesh and with other
// libraries: the experiment `ptcbench scan`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/ptc.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// What `ptcbench scan` measures.
struct ScanBenchOptions {
  std::uint64_t points = 1'000'000;
  std::vector<double> noises{0, 0.5};  ///< Gaussian noise along each axis, in spacings
  std::filesystem::path python;        ///< an interpreter that has Open3D; empty: none
  std::filesystem::path pcl;           ///< the program pcl_normals; empty: none
  unsigned repeats = 5;
};

/// One method on one cloud. Angles are degrees between a normal and the line along the mesh's own.
struct ScanRow {
  std::string scene, method;
  double noise = 0;  ///< in spacings
  std::uint64_t points = 0;
  Spread cpu;                 ///< seconds of all threads, all that the method does
  double normals_us = kNone;  ///< CPU time a point of normals alone, where it is known
  double median = 0, mean = 0, percentile_95 = 0;
  double flipped = kNone;            ///< share of normals on the wrong side, where sides are told
  double area = kNone;               ///< sum of 2 r^2 over the area of the mesh
  std::uint64_t outliers = 0;        ///< points that are marked
  std::uint64_t resident_bytes = 0;  ///< maximum during a run, less those before it

  /// Points that a second of CPU time completes.
  [[nodiscard]] double rate() const { return static_cast<double>(points) / cpu.median; }
};

/// All rows of one scene.
struct SceneScans {
  std::string name;
  std::uint64_t triangles = 0;
  std::vector<ScanRow> rows;
};

/// Samples a mesh at random, adds noise, and completes the cloud by each method in turn. The result
/// of PTCX under a small cap and with two threads must have the same bytes.
/// @param work  directory for temporary files
/// @throws DataError when the results differ, or the scene is no mesh; std::system_error
[[nodiscard]] SceneScans measure_scans(const SceneChoice& choice, const ScanBenchOptions& options,
                                       const std::filesystem::path& work, const RunOptions& run,
                                       Progress& progress);

/// Makes the report "scan": the rows of all scenes, and a chart of errors against time.
/// @param scenes  one or more
[[nodiscard]] Report report_of(const std::vector<SceneScans>& scenes, unsigned runs);

}  // namespace ptc::bench
