// Time per receiver against error, for PTCX and for what it competes with.
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

/// What can be measured, in the order of charts: the hierarchical gather, the plain one, rays at
/// the same discs, rays at the mesh.
inline constexpr std::array kMethods{"ptcx", "plain", "embree-discs", "embree-mesh"};
/// Receivers: pixels of a picture, points of the scene itself.
inline constexpr std::array kSets{"camera", "points"};

/// What is asked of a method: occlusion alone, or occlusion and irradiance together.
enum class Quantity { occlusion, bleeding };
[[nodiscard]] const char* name_of(Quantity job) noexcept;

struct AccuracyOptions {
  SceneOptions scene;
  unsigned checked = 1000;          ///< receivers of each set whose error is measured
  unsigned reference_rays = 16384;  ///< of each of the two halves of a reference, a power of two
  unsigned window_rays = 4096;      ///< of a reference for each pixel of the window, likewise
  unsigned repeats = 5;
  std::vector<std::string> methods{kMethods.begin(), kMethods.end()};
  std::vector<std::string> sets{kSets.begin(), kSets.end()};
  std::vector<GatherOptions> settings = default_settings();  ///< of PTCX, from coarse to fine
  std::vector<float> plain_solid_angles{0.03F, 0.01F};
  std::vector<unsigned> rays{64, 128, 256, 512, 1024, 2048, 4096};  ///< of Embree, powers of two

  [[nodiscard]] static std::vector<GatherOptions> default_settings();
  [[nodiscard]] bool measures(std::string_view method) const {
    return std::ranges::find(methods, method) != methods.end();
  }
};

/// One method at one setting on one set of receivers of one scene. Errors are shares of the
/// reference's mean; the reference is the same model's: discs for ptcx, plain and embree-discs, the
/// mesh for embree-mesh.
struct AccuracyRow {
  std::string scene, set, method, setting;
  Quantity job = Quantity::occlusion;
  std::size_t receivers = 0;  ///< that were timed
  Spread us_per_receiver;     ///< CPU time, all threads together
  Spread wall_us_per_receiver = kNoSpread;
  GatherCounts counts;  ///< of a receiver in the mean, times a thousand; zeros of rays
  ErrorStatistics occlusion;
  ErrorStatistics irradiance;  ///< over RGB; NaN for the job occlusion
  double flip = 0;             ///< mean over a window of the camera's picture; NaN for other sets
  double occlusion_rms_mesh = 0;  ///< against rays at the mesh; NaN without one
  double irradiance_rms_mesh = 0;
  /// Time of Embree at the same error over the time of this method, by linear interpolation of
  /// logarithms; NaN where Embree was not measured around that error.
  double speedup_discs = 0, speedup_mesh = 0;

  /// Of the quantity that the job is about.
  [[nodiscard]] const ErrorStatistics& error() const noexcept {
    return job == Quantity::occlusion ? occlusion : irradiance;
  }
};

/// What errors are measured against.
struct ReferenceNote {
  std::string scene, set;
  std::size_t receivers = 0;
  unsigned rays = 0;
  double occlusion_mean = 0, irradiance_mean = 0;
  double occlusion_noise = 0,
         irradiance_noise = 0;  ///< RMS of the reference's own error, over its mean
  double occlusion_floor = 0,
         irradiance_floor = 0;  ///< discs against mesh, RMS over the mean; NaN without one
};

struct SceneAccuracy {
  std::uint64_t surfels = 0, triangles = 0;
  std::vector<ReferenceNote> references;
  std::vector<AccuracyRow> rows;  ///< one or more, and a reference for each of their sets

  [[nodiscard]] const std::string& name() const { return rows.front().scene; }
};

/// Measures all methods that were asked for in turn, as often as asked, in one process.
/// @throws DataError when the scene has nothing to measure: no receiver, or no mesh for embree-mesh
/// alone
[[nodiscard]] SceneAccuracy measure_accuracy(const BenchScene& scene,
                                             const AccuracyOptions& options,
                                             const Executor& executor, Progress& progress);

/// Files "accuracy": the rows, what their errors are against, a chart of all scenes, and one of
/// each scene.
/// @param scenes  one or more, of different names
[[nodiscard]] Report report_of(const std::vector<SceneAccuracy>& scenes, unsigned runs);

}  // namespace ptc::bench
