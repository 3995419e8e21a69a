// Time per receiver against error, for PTCX and for the methods that it competes with: the
// experiment `ptcbench accuracy`.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/executor.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// The methods in the order of charts: the hierarchical gather, rays through the octree, the plain
/// gather, Embree's rays at the same discs, Embree's rays at the mesh.
inline constexpr std::array kMethods{"ptcx", "ptcx-rays", "plain", "embree-discs", "embree-mesh"};

/// What a method computes: occlusion alone, or occlusion and irradiance together.
enum class Quantity { occlusion, bleeding };
/// The word for a quantity in tables: "occlusion" or "bleeding".
[[nodiscard]] const char* name_of(Quantity job) noexcept;

/// What `ptcbench accuracy` measures.
struct AccuracyOptions {
  SceneOptions scene;
  unsigned checked = 1000;          ///< receivers of each set whose error is measured
  unsigned reference_rays = 16384;  ///< rays per receiver and half of a reference, a power of two
  unsigned window_rays = 4096;      ///< rays per pixel of the window, a power of two
  unsigned repeats = 5;
  std::vector<std::string> methods{kMethods.begin(), kMethods.end()};
  std::vector<std::string> sets{kSets.begin(), kSets.end()};
  std::vector<GatherOptions> settings = default_settings();  ///< settings of "ptcx"
  std::vector<float> plain_solid_angles{0.03F, 0.01F};       ///< solid angles of "plain", sr
  std::vector<unsigned> rays{64,   128,  256, 512,
                             1024, 2048, 4096};  ///< Embree's rays per receiver, powers of two
  std::vector<unsigned> own_rays{64, 256, 1024, 4096};  ///< those of "ptcx-rays", squares

  /// Six settings from 0.2 sr to 0.003 sr.
  [[nodiscard]] static std::vector<GatherOptions> default_settings();
  /// Whether a method of kMethods is to be measured.
  [[nodiscard]] bool measures(std::string_view method) const {
    return std::ranges::find(methods, method) != methods.end();
  }
};

/// The time and the error of one method at one setting on one set of receivers of one scene. Errors
/// are shares of the mean of a reference, which is many rays at the model that the method shades:
/// the mesh for embree-mesh, the discs for all others.
struct AccuracyRow {
  std::string scene, set, method, setting;
  Quantity job = Quantity::occlusion;
  std::size_t receivers = 0;  ///< number of receivers that were timed
  Spread us_per_receiver;     ///< CPU time, all threads together
  Spread wall_us_per_receiver = kNoSpread;
  GatherCounts counts;  ///< mean of a receiver times 1000; zeros for rays
  ErrorStatistics occlusion;
  ErrorStatistics irradiance;      ///< over all three channels; NaN for the job occlusion
  double flip = 0;                 ///< mean over the camera's window; NaN for other sets
  double occlusion_rms_mesh = 0;   ///< against rays at the mesh; NaN without a mesh
  double irradiance_rms_mesh = 0;  ///< against rays at the mesh; NaN without a mesh
  /// The time of Embree (on discs, on the mesh) at the error of this row, divided by the time of
  /// this row, by linear interpolation of logarithms; NaN where Embree was not measured around that
  /// error.
  double speedup_discs = 0, speedup_mesh = 0;

  /// The errors of occlusion for the job occlusion, else those of irradiance.
  [[nodiscard]] const ErrorStatistics& error() const noexcept {
    return job == Quantity::occlusion ? occlusion : irradiance;
  }
};

/// The reference that the errors of one scene and set are measured against.
struct ReferenceNote {
  std::string scene, set;
  std::size_t receivers = 0;  ///< number of receivers whose error is measured
  unsigned rays = 0;          ///< rays per receiver, both halves together
  double occlusion_mean = 0, irradiance_mean = 0;
  /// RMS error of the reference itself, as a share of its mean.
  double occlusion_noise = 0, irradiance_noise = 0;
  /// RMS difference between discs and mesh, as a share of the mesh's mean; NaN without a mesh.
  double occlusion_floor = 0, irradiance_floor = 0;
};

/// Everything that was measured on one scene.
struct SceneAccuracy {
  std::uint64_t surfels = 0, triangles = 0;
  std::vector<ReferenceNote> references;
  std::vector<AccuracyRow> rows;  ///< one or more; each of their sets has a reference

  /// The name of the scene.
  [[nodiscard]] const std::string& name() const { return rows.front().scene; }
};

/// Measures the chosen methods in turn, AccuracyOptions::repeats times, in one process.
/// @throws DataError when there is nothing to measure: no receiver, or no mesh where embree-mesh is
///         the only method
[[nodiscard]] SceneAccuracy measure_accuracy(const BenchScene& scene,
                                             const AccuracyOptions& options,
                                             const Executor& executor, Progress& progress);

/// Makes the report "accuracy": the rows, their references, a chart of all scenes, and one chart
/// for each scene.
/// @param scenes  one or more, of different names
[[nodiscard]] Report report_of(const std::vector<SceneAccuracy>& scenes, unsigned runs);

}  // namespace ptc::bench
