// Reading and writing of point files, compared with other libraries: the experiment
// `ptcbench formats`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/bench/chart/statistics.h"
#include "tools/bench/experiments/bench_run.h"
#include "tools/bench/report/report.h"

namespace ptc::bench {

/// What `ptcbench formats` measures.
struct FormatsOptions {
  std::uint64_t points = 2'000'000;          ///< of the city that is written in every format
  std::vector<std::filesystem::path> files;  ///< further files, which are only read
  std::filesystem::path python;  ///< an interpreter that has laspy and Open3D; empty: none
  unsigned repeats = 5;
};

/// One program that reads or writes one file.
struct FormatRow {
  std::string file;    ///< its ending, or the name of a further file
  std::string work;    ///< "write" or "read"
  std::string method;  ///< "ptcx", or the library that is compared with it
  std::uint64_t points = 0;
  std::uint64_t bytes = 0;  ///< of the file
  Spread cpu, wall;         ///< seconds; CPU time of all threads together
  /// The largest difference of a coordinate from what was written; of a library, from what PTCX
  /// reads of the same file. Scene units.
  double difference = kNone;

  /// Points that a second of CPU time works on.
  [[nodiscard]] double rate() const { return static_cast<double>(points) / cpu.median; }
};

/// Writes a city in every format that can be written, reads the files into a sort, and reads the
/// further files likewise.
/// @throws DataError when a count differs, or the interpreter fails; std::system_error
[[nodiscard]] std::vector<FormatRow> measure_formats(
    const FormatsOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const BenchRun<FormatsOptions, FormatRow>::Report& report);

/// Makes the report "formats".
/// @param rows  one or more
[[nodiscard]] Report report_of(const std::vector<FormatRow>& rows, unsigned runs);

}  // namespace ptc::bench
