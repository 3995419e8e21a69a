// The external sort compared with the disk alone, and its core compared with other sorts: the
// experiment `ptcbench sort`.
#pragma once

#include <array>
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

/// The orders in which keys come:
///
///   city       block of houses by block of houses
///   random     uniformly at random
///   sorted     ascending
///   reversed   descending
///   equal      one key for all
///   clusters   two clusters as far apart and as dense as the lattice allows, at random
inline constexpr std::array kSortOrders{"city",     "random", "sorted",
                                        "reversed", "equal",  "clusters"};
inline constexpr std::array kSortPanels{"memory", "disk"};

/// What `ptcbench sort` measures.
struct SortBenchOptions {
  std::vector<std::uint64_t> points{1'000'000, 5'000'000, 20'000'000};  ///< records, ascending
  std::uint64_t memory_points = 20'000'000;  ///< maximum of records that are sorted in memory
  std::vector<std::string> orders{kSortOrders.begin(), kSortOrders.end()};
  std::vector<std::string> panels{kSortPanels.begin(), kSortPanels.end()};
  unsigned repeats = 5;
};

/// One measurement.
///
///   panel    method      what is timed
///   memory   ptcx, tbb   the core of the sort, and oneTBB's parallel_sort, by all threads
///            std::sort   one thread
///            memcpy      one thread copies the records
///   disk     ptcx        input file -> sort -> output file, under the run's cap
///            floor       the same bytes are read and written twice
struct SortRow {
  std::string panel, order, method;
  std::uint64_t points = 0;
  unsigned threads = 0;
  std::uint64_t memory_bytes = 0;    ///< cap; 0 for sorts in memory and the floor
  Spread wall;                       ///< seconds
  Spread cpu;                        ///< seconds, user and system, all threads
  std::uint64_t moved_bytes = 0;     ///< read and written by all passes together
  std::uint64_t resident_bytes = 0;  ///< maximum during a run, less those before it
};

/// Runs everything that was asked for in one process; the methods of a panel, order and size take
/// turns. One result of ptcx is checked for each: ascending, stable where keys are equal, and the
/// same records.
/// @param work    directory for the files, which have no names
/// @param report  called with all rows so far, whenever there are more
/// @throws std::system_error (ENOSPC) before a file is written that the disk has no room for;
///         DataError when a result is wrong
[[nodiscard]] std::vector<SortRow> measure_sort(
    const SortBenchOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<SortRow>&)>& report = {});

/// Makes the report "sort": the rows, and a chart of both panels.
[[nodiscard]] Report report_of(const std::vector<SortRow>& rows, unsigned runs);

}  // namespace ptc::bench
