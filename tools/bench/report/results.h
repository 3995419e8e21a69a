// Files of results: one Markdown file for each command, with everything that a reader needs to
// judge the numbers.
#pragma once

#include <filesystem>
#include <string>

#include "tools/bench/report/circumstances.h"
#include "tools/bench/report/report.h"

namespace ptc::bench {

/// A file says so at its top when there were fewer runs than this.
inline constexpr unsigned kEnoughRuns = 5;

/// The Markdown of a report: title, how to read it, reservations, machine and command, tables,
/// notes, links to the charts, and pictures.
[[nodiscard]] std::string results_text(const Report& report, const Circumstances& circumstances);

/// Writes NAME.md, and the charts and pictures into the same directory. Each file is replaced whole
/// or not at all.
/// @throws std::system_error, std::invalid_argument as write_chart()
void write_results(const std::filesystem::path& directory, const Report& report,
                   const Circumstances& circumstances);

}  // namespace ptc::bench
