// Light of ptclight against rays at the mesh: the experiment `ptcbench relight`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// What `ptcbench relight` measures.
struct RelightOptions {
  std::uint64_t points = 2'000'000;  ///< surfels wanted of a mesh
  unsigned checked = 3'000;          ///< surfels that are compared with the reference
  unsigned timed = 100'000;          ///< surfels that Embree lights in a timed run
  unsigned reference_rays = 1'024;   ///< rays for each of four places of a surfel
  unsigned repeats = 5;
  std::vector<unsigned> sun_rays{4, 16,
                                 64};  ///< for each surfel; Embree takes them for the sky, too
};

/// One method with one setting under one light.
struct RelightRow {
  std::string scene, light, method, setting;
  std::uint64_t surfels = 0;  ///< that were lit in a timed run
  unsigned threads = 0;
  double rays = kNone;       ///< rays for each surfel
  Spread us, wall_us;        ///< CPU time and wall time for each surfel
  double mean = 0, rms = 0;  ///< error of irradiance, over its mean
  double away = kNone;       ///< RMS away from the borders of shadows
};

/// Measures one scene.
/// @param work  directory for the containers
[[nodiscard]] std::vector<RelightRow> measure_relight(const SceneChoice& choice,
                                                      const RelightOptions& options,
                                                      const std::filesystem::path& work,
                                                      const RunOptions& run, Progress& progress);

/// Reports the rows of all scenes.
[[nodiscard]] Report report_of(const std::vector<std::vector<RelightRow>>& scenes, unsigned runs);

}  // namespace ptc::bench
