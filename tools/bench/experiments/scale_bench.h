// From a procedural city to shaded receivers at growing sizes, end to end under one cap.
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

struct ScaleOptions {
  std::vector<std::uint64_t> points{1'000'000, 5'000'000,
                                    20'000'000};  ///< of the city, 1000 or more, ascending
  std::uint64_t receivers = 100'000;  ///< of its points, evenly spread; all where there are fewer
  unsigned repeats = 5;
};

/// One measurement. Stages: build, the city generated, sorted and built into a container; verify,
/// every byte of it read and checked (level 2); shade, receivers with occlusion and bleeding, by a
/// page cache of all that the cap leaves; verify and shade with the file out of the system's cache.
/// Limits: build floor and verify floor, a disk that moves the same bytes past the system's cache;
/// memcpy, one thread that copies the records once in memory.
struct ScaleRow {
  std::string stage;
  std::uint64_t points = 0;
  std::uint64_t receivers = 0;  ///< of "shade" alone
  unsigned threads = 0;
  std::uint64_t memory_bytes = 0;    ///< cap; 0 of limits
  Spread wall, cpu;                  ///< seconds; user and system, all threads
  std::uint64_t resident_bytes = 0;  ///< most at once during a run, less what was there before it
  std::uint64_t moved_bytes =
      0;  ///< read and written; of "shade", stored bytes that the page cache read
  std::uint64_t disk_bytes =
      0;  ///< of them what the disk gave, as the system says, in the last run
  std::uint64_t spilled_bytes = 0, file_bytes = 0, nodes = 0;  ///< of "build" alone, with the next
  double bytes_per_point = 0, bytes_per_node = 0;  ///< on the disk, of pages of points and of nodes
  bool rebuilt = false;  ///< verified at level 4, too, without being timed
  std::uint64_t hits = 0,
                misses = 0;  ///< of "shade" alone, of pages in the last run, with the next
  double cap_share = 0;      ///< of the pages that have a frame

  /// What times are told of: points, of "shade" receivers.
  [[nodiscard]] std::uint64_t items() const noexcept {
    return stage == "shade" ? receivers : points;
  }
};

/// Runs all sizes in one process, the stages and limits of a size in turn. Every container is
/// verified, and holds the points asked for; up to 2 million points it is also built again and
/// compared (level 4). All runs of a size give the same container and the same values, which are
/// finite.
/// @param work  directory for the files; they are gone at the end
/// @throws std::system_error (ENOSPC) before anything is built when there is no room for the
/// largest; DataError when an
///         answer is wrong; as build_container() and shade_container()
[[nodiscard]] std::vector<ScaleRow> measure_scale(
    const ScaleOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<ScaleRow>&)>& report = {});

/// Files "scale": the rows, their laws, and a chart of time, memory and bytes over points.
/// @param rows  of one or more sizes, ascending
[[nodiscard]] Report report_of(const std::vector<ScaleRow>& rows, unsigned runs);

}  // namespace ptc::bench
