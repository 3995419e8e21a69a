// What --quick makes of the options of a command of ptcbench.
#pragma once

#include <CLI/CLI.hpp>

#include "tools/bench/experiments/accuracy.h"
#include "tools/bench/experiments/build_bench.h"
#include "tools/bench/experiments/cache_bench.h"
#include "tools/bench/experiments/error_knob.h"
#include "tools/bench/experiments/growth.h"
#include "tools/bench/experiments/model.h"
#include "tools/bench/experiments/scale_bench.h"
#include "tools/bench/experiments/sort_bench.h"

namespace ptc::bench {

/// Sets less to measure, but for what was given on the command line. References stay as good where
/// they take little time.
/// @param command  that was parsed
void shorten(AccuracyOptions& options, const CLI::App& command);
void shorten(BuildBenchOptions& options, const CLI::App& command);
void shorten(CacheBenchOptions& options, const CLI::App& command);
void shorten(ErrorOptions& options, const CLI::App& command);
void shorten(GrowthOptions& options, const CLI::App& command);
void shorten(ModelOptions& options, const CLI::App& command);
void shorten(ScaleOptions& options, const CLI::App& command);
void shorten(SortBenchOptions& options, const CLI::App& command);

}  // namespace ptc::bench
