// What each part of the model of a scene costs, in bytes and time, and what it is worth, in error:
// the experiment `ptcbench model`. It varies one part (axis) at a time:
//
//   payload      what a node holds of its surfels: a surfel, lobes, a vector, a cube, harmonics
//   node         all columns of a node, as floats or as stored
//   leaf         points in a leaf
//   directions   pixels of the direction buffer along a cube edge
//   pages        compression of pages of points and nodes
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

/// What `ptcbench model` measures.
struct ModelOptions {
  SceneOptions scene{.points = 500'000,
                     .shaded_width = 320,
                     .shaded_height = 180,
                     .own_points = 0,
                     .profile = Profile::exact};
  unsigned checked = 400;          ///< pixels of the picture whose error is measured
  unsigned reference_rays = 8192;  ///< rays per pixel and half of a reference
  unsigned repeats = 3;
  std::vector<float> solid_angles{0.1F, 0.03F,
                                  0.01F};  ///< solid angles of payloads, descending, sr
  unsigned study_resolution = 64;          ///< direction pixels along a cube edge, for payloads
  std::vector<std::uint32_t> leaf_points{2, 4, 8, 16, 32, 64};  ///< maximum of points in a leaf
  std::vector<unsigned> resolutions{16, 32, 48, 64};            ///< pixels along a cube edge
  std::vector<int> levels{1, 3, 9, 19};                         ///< compression levels of zstd
};

/// One variant of one part of the model. A value that was not measured is NaN.
struct ModelRow {
  std::string scene;
  /// The part that varies: payload, node (all columns, bounds included), leaf (points in it),
  /// directions (pixels along a cube edge) or pages.
  std::string axis;
  std::string variant;
  /// Payloads and nodes: float or stored. Pages: points (as they lie), packed, rounded (and packed)
  /// or nodes.
  std::string form;
  double solid_angle = kNone;  ///< solid angle of the gather, sr
  /// Bytes of one item of the kind `per`: a node without the 24 bytes of its group, or a point with
  /// its share of everything in the file.
  double bytes = kNone;
  std::string per;             ///< node, point or cube
  Spread us = kNoSpread;       ///< CPU time per receiver; payload, node: nodes are decoded before
  Spread wall_us = kNoSpread;  ///< wall time per receiver
  double evaluate_us = kNone;  ///< CPU time per receiver for the payloads alone
  double decode_ns = kNone;    ///< CPU time to decode one item of the kind `per`
  double moved = kNone;  ///< pages: maximum distance that rounding moves a point, in its radii
  /// Shares of the mean of a reference: all surfels in the same pixels (payload, node), or rays at
  /// the surfels (leaf, directions).
  ErrorStatistics occlusion{.rms = kNone, .bias = kNone, .percentile_99 = kNone};
  ErrorStatistics irradiance = occlusion;
};

/// Everything that was measured on one scene.
struct SceneModel {
  std::string scene;
  std::uint64_t surfels = 0, nodes = 0;
  std::size_t receivers = 0;
  unsigned rays = 0;  ///< rays of the reference per receiver
  /// RMS error of the reference itself, as a share of its mean.
  double occlusion_noise = 0, irradiance_noise = 0;
  std::vector<ModelRow> rows;
};

/// Measures all parts of the model on one scene.
/// @param work  directory for containers, which have no names there once they are open
/// @throws DataError when the camera sees nothing; std::system_error
[[nodiscard]] SceneModel measure_model(const BenchScene& scene, const ModelOptions& options,
                                       const std::filesystem::path& work, const Executor& executor,
                                       Progress& progress);

/// Measures the rows of the axes payload and node. Each node of a receiver's cut becomes the disc
/// of spec/shading.md#gather from the values of the payload; discs are drawn and summed as in the
/// gather. One more payload, "exact", sums over the surfels of the node.
[[nodiscard]] std::vector<ModelRow> study_payloads(const BenchScene& scene,
                                                   std::span<const Receiver> receivers,
                                                   const ModelOptions& options,
                                                   const Executor& executor, Progress& progress);

/// Measures the rows of the axis pages.
[[nodiscard]] std::vector<ModelRow> study_pages(const BenchScene& scene,
                                                const ModelOptions& options);

/// Makes the report "model": the rows, their scenes, and for each scene a chart: payloads over
/// bytes and over time, leaves over both, directions over time, pages.
[[nodiscard]] Report report_of(const std::vector<SceneModel>& scenes, unsigned runs);

/// Sets the errors of a row.
/// @param ours  shadings of the same receivers as `reference`, in the same order
void compare(ModelRow& row, std::span<const Shading> ours, std::span<const Shading> reference);

}  // namespace ptc::bench
