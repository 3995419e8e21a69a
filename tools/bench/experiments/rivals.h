// Methods against each other at equal error.
#pragma once

#include <vector>

#include "tools/bench/experiments/accuracy.h"

namespace ptc::bench {

/// A method's time at one error.
struct TimedError {
  double error = 0;  ///< above 0
  double us = 0;
};

/// Time at an error between those measured, by linear interpolation of logarithms; NaN outside.
[[nodiscard]] double time_at(const std::vector<TimedError>& measured, double error);

/// Of rays of one scene and set that went out single and in packets, all else equal, the faster
/// stay.
void keep_faster_packets(std::vector<AccuracyRow>& rows);

/// Fills in the speedups of rows of one scene and set.
void set_speedups(std::vector<AccuracyRow>& rows);

}  // namespace ptc::bench
