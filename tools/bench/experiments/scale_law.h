// The power law by which the stages of `ptcbench scale` grow.
#pragma once

#include <string>
#include <vector>

#include "tools/bench/experiments/scale_bench.h"

namespace ptc::bench {

/// How a stage grows with the points of the city. A value is NaN where there are too few sizes.
struct ScaleLaw {
  std::string stage;
  double time_exponent = 0;      ///< exponent of the stage's wall time over points
  double resident_exponent = 0;  ///< exponent of the stage's peak memory over points
  double predicted_seconds = 0;  ///< wall time at kPredictedPoints; NaN if measured
  /// Wall time per point (for "shade", per receiver) and peak memory at the largest size, divided
  /// by those at the smallest size of kLargePoints or more.
  double time_ratio = 0, resident_ratio = 0;
};

/// The points from which on sizes count as large, and the points of the prediction.
inline constexpr std::uint64_t kLargePoints = 20'000'000, kPredictedPoints = 1'700'000'000;

/// Fits a law for each of build, verify and shade.
/// @param rows  of one or more sizes, ascending
[[nodiscard]] std::vector<ScaleLaw> laws_of(const std::vector<ScaleRow>& rows);

}  // namespace ptc::bench
