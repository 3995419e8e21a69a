// Files of results: one Markdown file for each command, with all that tells what it is worth.
#pragma once

#include <filesystem>
#include <string>

#include "tools/bench/report/circumstances.h"
#include "tools/bench/report/report.h"

namespace ptc::bench {

/// Fewer runs than this are stated in the file.
inline constexpr unsigned kEnoughRuns = 5;

/// Title, how to read it, what it ran on, tables, notes, and links to the charts.
[[nodiscard]] std::string results_text(const Report& report, const Circumstances& circumstances);

/// Writes NAME.md and the charts beside it. Each file is there whole or as it was before.
/// @throws std::system_error; as write_chart()
void write_results(const std::filesystem::path& directory, const Report& report,
                   const Circumstances& circumstances);

}  // namespace ptc::bench
