// From a procedural city to shaded receivers at growing sizes, end to end under one memory cap: the
// experiment `ptcbench scale`.
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

/// What `ptcbench scale` measures.
struct ScaleOptions {
  std::vector<std::uint64_t> points{1'000'000, 5'000'000,
                                    20'000'000};  ///< points of the city, 1000 or more, ascending
  std::uint64_t receivers = 100'000;              ///< among its points, evenly spread; all of fewer
  unsigned repeats = 5;
};

/// One measurement.
///
///   stage          what is timed
///   build          the city is generated, sorted and built into a container
///   verify         every byte of the container is read and checked (level 2)
///   shade          receivers get occlusion and bleeding; the page cache has what the cap leaves
///   build floor    limit: the disk moves the bytes of build past the system's cache
///   verify floor   limit: the disk moves the bytes of verify past the system's cache
///   memcpy         limit: one thread copies the records once in memory
///
/// Verify and shade begin with the file out of the system's cache.
struct ScaleRow {
  std::string stage;
  std::uint64_t points = 0;
  std::uint64_t receivers = 0;  ///< number of receivers, for "shade" only
  unsigned threads = 0;
  std::uint64_t memory_bytes = 0;    ///< cap; 0 for limits
  Spread wall, cpu;                  ///< seconds; user and system, all threads
  std::uint64_t resident_bytes = 0;  ///< maximum during a run, less those before it
  std::uint64_t moved_bytes = 0;  ///< read and written; for "shade" read by the page cache, stored
  std::uint64_t disk_bytes = 0;   ///< read from the disk in the last run, as the system reports
  std::uint64_t spilled_bytes = 0, file_bytes = 0, nodes = 0;  ///< "build" only
  double bytes_per_point = 0, bytes_per_node = 0;              ///< "build" only: StoredBytes
  bool rebuilt = false;  ///< "verify" only: also verified at level 4, which is not timed
  std::uint64_t hits = 0, misses = 0;  ///< "shade" only: lookups of pages in the last run
  double cap_share = 0;                ///< "shade" only: frames over pages

  /// The number of items that times are divided by: receivers for "shade", else points.
  [[nodiscard]] std::uint64_t items() const noexcept {
    return stage == "shade" ? receivers : points;
  }
};

/// Runs all sizes in one process; the stages and limits of a size take turns. Every container is
/// verified and holds the points asked for; up to 2 million points its tree is also built again and
/// compared (level 4). All runs of a size must give the same container and the same finite values.
/// @param work    directory for the files, which are gone at the end
/// @param report  called with all rows so far, whenever there are more
/// @throws std::system_error (ENOSPC) before anything is built when there is no room for the
///         largest size; DataError when an answer is wrong; as build_container() and
///         shade_container()
[[nodiscard]] std::vector<ScaleRow> measure_scale(
    const ScaleOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<ScaleRow>&)>& report = {});

/// Makes the report "scale": the rows, their laws, and a chart of time, memory and bytes over
/// points.
/// @param rows  of one or more sizes, ascending
[[nodiscard]] Report report_of(const std::vector<ScaleRow>& rows, unsigned runs);

}  // namespace ptc::bench
