// How the time of a receiver grows: with surfels, solid angle, depth of the scene, and less memory.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// What varies, in the order of charts: surfels of the city, solid angle there, sheets of
/// make_layers(), and the page cache as a share of all decoded pages, at the city.
inline constexpr std::array kGrowthPanels{"surfels", "solid-angle", "depth", "cap"};

struct GrowthOptions {
  std::vector<std::uint64_t> points{500'000, 2'000'000, 6'000'000,
                                    20'000'000};  ///< ascending; the last one also under caps
  std::uint64_t middle_points = 2'000'000;        ///< of the panels of solid angle and depth
  std::vector<float> solid_angles{0.1F, 0.03F, 0.01F, 0.003F, 0.001F};
  std::vector<unsigned> layers{1, 2, 4, 8, 16};
  std::vector<double> caps{1, 0.29, 0.09, 0.04};
  std::vector<unsigned> rays{64, 256, 1024, 4096};  ///< of Embree, powers of two
  std::vector<std::string> panels{kGrowthPanels.begin(), kGrowthPanels.end()};
  std::uint64_t own_points = 50'000;  ///< receivers, in blocks of neighbours spread over the scene
  unsigned checked = 300;             ///< of them, whose error is measured
  unsigned reference_rays = 16384;    ///< as of AccuracyOptions
  unsigned repeats = 5;
  /// Surfels. Where there are more, nothing is checked against rays, which need all of them in
  /// memory, and the page cache, empty at first, has the run's cap.
  std::uint64_t ray_reach = 40'000'000;
};

/// One measurement. NaN: not measured.
struct GrowthRow {
  std::string panel;
  double x = 0;  ///< what varies: surfels, sr, sheets, share of the decoded pages
  std::string scene;
  std::uint64_t surfels = 0;
  unsigned threads = 0;
  std::size_t receivers = 0;
  Spread us;  ///< CPU time of a receiver, all threads together
  Spread wall_us;
  double occlusion_rms = 0, irradiance_rms = 0;  ///< over the mean of rays at the same discs
  double speedup_discs = 0,
         speedup_mesh = 0;  ///< Embree's CPU time at the same error of irradiance over ours
  double hit_rate = 0, pages = 0, bytes = 0;  ///< under caps: of lookups; read, of a receiver
};

/// Measures what was asked for, in one process; within a panel's scene in turn.
/// @param report  called with all rows so far, whenever there are more
/// @param work  directory for the containers, one after another, without names there once they are
/// open
/// @throws std::system_error (ENOSPC) before a build when `work` has no room for it; as BenchScene
[[nodiscard]] std::vector<GrowthRow> measure_growth(
    const GrowthOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<GrowthRow>&)>& report = {});

/// Files "growth": the rows, and a panel for time against each of what varied; under caps wall time
/// and what was read, too.
/// @param rows  one or more
[[nodiscard]] Report report_of(const std::vector<GrowthRow>& rows, unsigned runs);

/// Bytes on the disk while a city or a mesh of so many surfels is built, at most.
[[nodiscard]] std::uint64_t build_disk_bytes(std::uint64_t points) noexcept;

}  // namespace ptc::bench
