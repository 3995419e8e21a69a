// Compares the times of methods at equal error.
#pragma once

#include <vector>

#include "tools/bench/experiments/accuracy.h"

namespace ptc::bench {

/// A point of a method's curve of time against error.
struct TimedError {
  double error = 0;  ///< above 0
  double us = 0;     ///< time per receiver
};

/// Returns the time at an error between those measured, by linear interpolation of logarithms; NaN
/// outside of them.
[[nodiscard]] double time_at(const std::vector<TimedError>& measured, double error);

/// Keeps, of two rows of one scene and set that differ only in tracing single rays or packets, the
/// faster one.
void keep_faster_packets(std::vector<AccuracyRow>& rows);

/// Sets AccuracyRow::speedup_discs and speedup_mesh of the rows of one scene and set.
void set_speedups(std::vector<AccuracyRow>& rows);

}  // namespace ptc::bench
