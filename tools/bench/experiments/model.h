// What the model of a scene costs and what it is worth: payloads of nodes, rounding, leaves,
// directions, pages.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

struct ModelOptions {
  SceneOptions scene{.points = 500'000,
                     .shaded_width = 320,
                     .shaded_height = 180,
                     .own_points = 0,
                     .profile = Profile::exact};
  unsigned checked = 400;          ///< pixels of the camera whose error is measured
  unsigned reference_rays = 8192;  ///< of each half of a reference
  unsigned repeats = 3;
  std::vector<float> solid_angles{0.1F, 0.03F, 0.01F};  ///< of payloads, descending, sr
  unsigned study_resolution = 64;  ///< direction pixels of payloads along a cube edge
  std::vector<std::uint32_t> leaf_points{2, 4, 8, 16, 32, 64};
  std::vector<unsigned> resolutions{16, 32, 48, 64};
  std::vector<int> levels{1, 3, 9, 19};  ///< of zstd
};

/// One variant of one part of the model. NaN: not measured.
struct ModelRow {
  std::string scene;
  /// payload; node (all columns, bounds too); leaf (points of one); directions (pixels along a cube
  /// edge); pages
  std::string axis;
  std::string variant;
  std::string form;  ///< of payloads and nodes: float or stored; of pages: points as they lie,
                     ///< packed, rounded and packed, or nodes
  double solid_angle = kNone;  ///< at which it was shaded, sr
  double bytes = kNone;  ///< of a `per`; of a node without its group's 24, of a point with its
                         ///< share of everything
  std::string per;       ///< node, point or cube
  /// Of a receiver; payloads and nodes: plain gather, decoded beforehand.
  Spread us = kNoSpread;  ///< CPU time
  Spread wall_us = kNoSpread;
  double evaluate_us = kNone;  ///< of the CPU time, what the payload takes
  double decode_ns = kNone;    ///< CPU time to decode one `per`
  double moved =
      kNone;  ///< of pages: the farthest that a point lies from where it was, in its radii
  /// Over the mean, against: all surfels in the same pixels (payload, node), rays at them (leaf,
  /// directions).
  ErrorStatistics occlusion{.rms = kNone, .bias = kNone, .percentile_99 = kNone};
  ErrorStatistics irradiance = occlusion;
};

struct SceneModel {
  std::string scene;
  std::uint64_t surfels = 0, nodes = 0;
  std::size_t receivers = 0;
  unsigned rays = 0;  ///< of the reference, whose own error, over its mean, is:
  double occlusion_noise = 0, irradiance_noise = 0;
  std::vector<ModelRow> rows;
};

/// @param work  directory for containers, which have no names there once they are open
/// @throws DataError when the camera sees nothing; std::system_error
[[nodiscard]] SceneModel measure_model(const BenchScene& scene, const ModelOptions& options,
                                       const std::filesystem::path& work, const Executor& executor,
                                       Progress& progress);

/// Of that, the rows of payload and node. Discs as spec/shading.md#gather has them from what a
/// payload tells of each node of a cut, drawn and summed as the gather does. One more payload,
/// "exact", sums over the surfels of the node.
[[nodiscard]] std::vector<ModelRow> study_payloads(const BenchScene& scene,
                                                   std::span<const Receiver> receivers,
                                                   const ModelOptions& options,
                                                   const Executor& executor, Progress& progress);

/// Of that, the rows of pages.
[[nodiscard]] std::vector<ModelRow> study_pages(const BenchScene& scene,
                                                const ModelOptions& options);

/// Files "model": the rows, their scenes, and for each scene a chart: payloads over bytes and over
/// time, leaves over both, directions over time, pages.
[[nodiscard]] Report report_of(const std::vector<SceneModel>& scenes, unsigned runs);

/// Sets a row's errors. @param ours  of the same receivers as the reference
void compare(ModelRow& row, std::span<const Shading> ours, std::span<const Shading> reference);

}  // namespace ptc::bench
