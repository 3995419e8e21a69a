// The whole build, from unsorted records to a container, against the disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/ptc.h"
#include "tools/bench/chart/statistics.h"
#include "tools/bench/report/report.h"

namespace ptc::bench {

struct BuildBenchOptions {
  std::vector<std::uint64_t> points{1'000'000, 5'000'000, 20'000'000};  ///< of the city, ascending
  /// Caps under which the largest of them is built, ascending. The others are built under the run's
  /// cap.
  std::vector<std::uint64_t> caps{std::uint64_t{128} << 20, std::uint64_t{256} << 20,
                                  std::uint64_t{512} << 20, std::uint64_t{1} << 30,
                                  std::uint64_t{2} << 30};
  std::vector<std::string> profiles{"compact", "fast"};
  std::vector<std::string> panels{"points", "cap"};
  unsigned repeats = 5;
};

/// One measurement. Methods: compact and fast, the profiles, from a file of records of 40 bytes in
/// the city's order through sort and tree to a published container; floor, a disk that moves the
/// same bytes: reads the input, writes and reads what is spilled, and writes as much as the
/// container has.
struct BuildRow {
  std::string panel, method;
  std::uint64_t points = 0;
  unsigned threads = 0;
  std::uint64_t memory_bytes = 0;  ///< cap; 0 of the floor
  Spread wall;                     ///< seconds
  Spread cpu;                      ///< seconds, user and system, all threads
  std::uint64_t moved_bytes = 0;   ///< read and written, all passes
  std::uint64_t input_bytes = 0;
  std::uint64_t resident_bytes = 0;  ///< most at once during a run, less what was there before it
  std::uint64_t nodes = 0;
  double bytes_per_point = 0, bytes_per_node = 0;  ///< on the disk, of pages of points and of nodes
};

/// Runs everything asked for in one process; the profiles and the floor of a size and cap in turn.
/// Of each, one container is verified whole, tree and all (level 4) up to 2 million points, else
/// every byte of it (level 2); all of one size and profile must have the same content whatever the
/// cap.
/// @param work  directory for the files; they are gone at the end
/// @throws std::system_error (ENOSPC) before a file is written that the disk has no room for;
/// DataError when a
///         container is wrong
[[nodiscard]] std::vector<BuildRow> measure_build(
    const BuildBenchOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<BuildRow>&)>& report = {});

/// Files "build": the rows, and charts over points and over the cap.
[[nodiscard]] Report report_of(const std::vector<BuildRow>& rows, unsigned runs);

}  // namespace ptc::bench
