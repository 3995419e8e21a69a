// What --quick makes of the options of a command of ptcbench.
#pragma once

#include <CLI/CLI.hpp>

#include "tools/bench/accuracy.h"
#include "tools/bench/build_bench.h"
#include "tools/bench/cache_bench.h"
#include "tools/bench/error_knob.h"
#include "tools/bench/growth.h"
#include "tools/bench/model.h"
#include "tools/bench/scale_bench.h"
#include "tools/bench/sort_bench.h"

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
