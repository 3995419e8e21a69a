// The law by which the stages of a scale bench grow.
#pragma once

#include <string>
#include <vector>

#include "tools/bench/experiments/scale_bench.h"

namespace ptc::bench {

/// How a stage grows with the points of the city. NaN: not enough sizes.
struct ScaleLaw {
  std::string stage;
  double time_exponent = 0;      ///< of wall seconds of the whole stage, over all sizes
  double resident_exponent = 0;  ///< of most resident, likewise
  double predicted_seconds = 0;  ///< wall, of kPredictedPoints; NaN when as many were measured
  /// Of the greatest size over that of the least of kLargePoints or more: wall time of a point (of
  /// "shade", a receiver), and most resident.
  double time_ratio = 0, resident_ratio = 0;
};

inline constexpr std::uint64_t kLargePoints = 20'000'000, kPredictedPoints = 1'700'000'000;

/// One for each of build, verify and shade. @param rows  of one or more sizes, ascending
[[nodiscard]] std::vector<ScaleLaw> laws_of(const std::vector<ScaleRow>& rows);

}  // namespace ptc::bench
