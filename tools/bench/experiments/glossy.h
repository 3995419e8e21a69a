// Reflections of rough mirrors by rays against many more: the experiment `ptcbench glossy`.
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

/// What `ptcbench glossy` measures.
struct GlossyOptions {
  std::uint64_t points = 2'000'000;  ///< surfels wanted of a mesh or the city
  std::uint64_t receivers = 20'000;  ///< neighbours in blocks that a timed run shades
  unsigned checked = 400;            ///< of them, compared with the reference
  unsigned reference_rays = 8'192;   ///< of Embree for each receiver, in two halves
  unsigned repeats = 5;
  std::vector<unsigned> rays{16, 64, 256};
  std::vector<double> roughnesses{0.1, 0.3, 0.6, 1.0};
};

/// One method with one number of rays at one roughness.
struct GlossyRow {
  std::string scene, method;
  double roughness = 0;
  unsigned rays = 0;            ///< of each receiver
  std::uint64_t receivers = 0;  ///< that a timed run shades
  unsigned threads = 0;
  Spread us, wall_us;             ///< CPU time and wall time for each receiver
  double radiance = 0, bias = 0;  ///< error of radiance, RMS and mean, over its mean
  double occlusion = 0;           ///< RMS error of occlusion, absolute
  double noise = 0;               ///< RMS error of the reference's radiance, over its mean
};

/// Measures one scene.
/// @param work  directory for the container
[[nodiscard]] std::vector<GlossyRow> measure_glossy(const SceneChoice& choice,
                                                    const GlossyOptions& options,
                                                    const std::filesystem::path& work,
                                                    const RunOptions& run, Progress& progress);

/// Reports the rows of all scenes.
[[nodiscard]] Report report_of(const std::vector<std::vector<GlossyRow>>& scenes, unsigned runs);

}  // namespace ptc::bench
