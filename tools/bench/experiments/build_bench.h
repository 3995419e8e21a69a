// The whole build, from unsorted records to a container, compared with the disk alone: the
// experiment `ptcbench build`.
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

/// What `ptcbench build` measures. Panel "points": builds of growing size under the run's cap.
/// Panel "cap": the largest size under each of the caps.
struct BuildBenchOptions {
  std::vector<std::uint64_t> points{1'000'000, 5'000'000, 20'000'000};  ///< points of the city
  /// Memory caps under which the panel "cap" builds the largest city, bytes, ascending.
  std::vector<std::uint64_t> caps{std::uint64_t{128} << 20, std::uint64_t{256} << 20,
                                  std::uint64_t{512} << 20, std::uint64_t{1} << 30,
                                  std::uint64_t{2} << 30};
  std::vector<std::string> profiles{"compact", "fast"};
  std::vector<std::string> panels{"points", "cap"};
  unsigned repeats = 5;
};

/// One measurement.
///
///   method            what is timed
///   compact, fast     the profile's build: file of records of 40 bytes in the city's order -> sort
///                     -> tree -> published container
///   floor             the disk moves the same bytes: the input is read, the spilled bytes are
///                     written and read, and as many bytes as the container has are written
struct BuildRow {
  std::string panel, method;
  std::uint64_t points = 0;
  unsigned threads = 0;
  std::uint64_t memory_bytes = 0;  ///< cap; 0 for the floor
  Spread wall;                     ///< seconds
  Spread cpu;                      ///< seconds, user and system, all threads
  std::uint64_t moved_bytes = 0;   ///< read and written by all passes together
  std::uint64_t input_bytes = 0;
  std::uint64_t resident_bytes = 0;  ///< maximum of the whole program during a run
  std::uint64_t nodes = 0;
  double bytes_per_point = 0, bytes_per_node = 0;  ///< StoredBytes
};

/// Runs everything that was asked for in one process; profiles and floor of a size and cap take
/// turns. The first container of each is verified: its tree is built again up to 2 million points
/// (level 4), else every byte is checked (level 2). All containers of a size and profile must have
/// the same content, whatever the cap.
/// @param work    directory for the files, which are gone at the end
/// @param report  called with all rows so far, whenever there are more
/// @throws std::system_error (ENOSPC) before a file is written that the disk has no room for;
///         DataError when a container is wrong
[[nodiscard]] std::vector<BuildRow> measure_build(
    const BuildBenchOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<BuildRow>&)>& report = {});

/// Makes the report "build": the rows, and a chart over points and over the cap.
[[nodiscard]] Report report_of(const std::vector<BuildRow>& rows, unsigned runs);

}  // namespace ptc::bench
