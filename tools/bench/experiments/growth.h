// How the time per receiver grows with surfels, solid angle, depth of the scene, and less memory:
// the experiment `ptcbench growth`.
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

/// What varies, in the order of charts: surfels of the city, the solid angle of the gather, sheets
/// of make_layers(), and the page cache as a share of all decoded pages of the city.
inline constexpr std::array kGrowthPanels{"surfels", "solid-angle", "depth", "cap"};

/// What `ptcbench growth` measures.
struct GrowthOptions {
  std::vector<std::uint64_t> points{500'000, 2'000'000, 6'000'000,
                                    20'000'000};  ///< surfels, ascending; "cap" takes the last
  std::uint64_t middle_points = 2'000'000;  ///< surfels of the panels "solid-angle" and "depth"
  std::vector<float> solid_angles{0.1F, 0.03F, 0.01F, 0.003F, 0.001F};  ///< sr
  std::vector<unsigned> layers{1, 2, 4, 8, 16};                         ///< sheets above the ground
  std::vector<double> caps{1, 0.29, 0.09, 0.04};    ///< frames of the page cache over pages
  std::vector<unsigned> rays{64, 256, 1024, 4096};  ///< Embree's, per receiver, powers of two
  std::vector<std::string> panels{kGrowthPanels.begin(), kGrowthPanels.end()};
  std::uint64_t own_points = 50'000;  ///< receivers, in blocks of neighbours spread over the scene
  unsigned checked = 300;             ///< receivers whose error is measured
  unsigned reference_rays = 16384;    ///< rays per receiver and half of a reference
  unsigned repeats = 5;
  /// The number of surfels above which nothing is checked against rays, which need all surfels in
  /// memory. The page cache then has the run's cap and is empty at first.
  std::uint64_t ray_reach = 40'000'000;
};

/// One measurement. A value that was not measured is NaN.
struct GrowthRow {
  std::string panel;
  double x = 0;  ///< the value that varies: surfels, sr, sheets, share of the decoded pages
  std::string scene;
  std::uint64_t surfels = 0;
  unsigned threads = 0;
  std::size_t receivers = 0;
  Spread us;                                     ///< CPU time per receiver, all threads together
  Spread wall_us;                                ///< wall time per receiver
  double occlusion_rms = 0, irradiance_rms = 0;  ///< shares of the mean of rays at the same discs
  /// Embree's CPU time at the same error of irradiance over that of PTCX.
  double speedup_discs = 0, speedup_mesh = 0;
  /// The page cache's hits over lookups, and pages and stored bytes read for each receiver.
  double hit_rate = 0, pages = 0, bytes = 0;
};

/// Measures everything that was asked for in one process; the variants of a panel take turns.
/// @param work    directory for the containers, one after another, which have no names there once
///                they are open
/// @param report  called with all rows so far, whenever there are more
/// @throws std::system_error (ENOSPC) before a build when `work` has no room for it; as BenchScene
[[nodiscard]] std::vector<GrowthRow> measure_growth(
    const GrowthOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<GrowthRow>&)>& report = {});

/// Makes the report "growth": the rows, and a chart of time against each value that varied; under
/// caps also of wall time and of bytes read.
/// @param rows  one or more
[[nodiscard]] Report report_of(const std::vector<GrowthRow>& rows, unsigned runs);

/// An upper bound of the bytes on the disk during the build of a city or a mesh of this many
/// surfels.
[[nodiscard]] std::uint64_t build_disk_bytes(std::uint64_t points) noexcept;

}  // namespace ptc::bench
