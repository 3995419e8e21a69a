// The external sort against the disk, and its core against other sorts.
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

/// Orders in which keys come: the city's blocks, at random, those sorted and reversed, one key
/// alone, and two clusters as far apart as the lattice allows, each as dense as it allows.
inline constexpr std::array kSortOrders{"city",     "random", "sorted",
                                        "reversed", "equal",  "clusters"};
inline constexpr std::array kSortPanels{"memory", "disk"};

struct SortBenchOptions {
  std::vector<std::uint64_t> points{1'000'000, 5'000'000, 20'000'000};  ///< ascending
  std::uint64_t memory_points = 20'000'000;  ///< most that are sorted in memory
  std::vector<std::string> orders{kSortOrders.begin(), kSortOrders.end()};
  std::vector<std::string> panels{kSortPanels.begin(), kSortPanels.end()};
  unsigned repeats = 5;
};

/// One measurement. Panel "memory": methods ptcx, tbb (both by all threads), std::sort and memcpy,
/// of records in memory. Panel "disk": ptcx, from an input file of records through the sort to an
/// output file, under the run's cap; floor, the same bytes read and written twice with nothing done
/// to them.
struct SortRow {
  std::string panel, order, method;
  std::uint64_t points = 0;
  unsigned threads = 0;
  std::uint64_t memory_bytes = 0;    ///< cap; 0 in memory
  Spread wall;                       ///< seconds
  Spread cpu;                        ///< seconds, user and system, all threads
  std::uint64_t moved_bytes = 0;     ///< read and written, all passes
  std::uint64_t resident_bytes = 0;  ///< most at once during a run, less what was there before it
};

/// Runs everything asked for in one process; the methods of a panel, order and size in turn. Each
/// sorted result is checked once: ascending, stable where keys are equal, and the same records.
/// @param work  directory for the files, which have no names
/// @throws std::system_error (ENOSPC) before a file is written that the disk has no room for;
/// DataError when a
///         result is wrong
[[nodiscard]] std::vector<SortRow> measure_sort(
    const SortBenchOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<SortRow>&)>& report = {});

/// Files "sort": the rows, and a chart of both panels.
[[nodiscard]] Report report_of(const std::vector<SortRow>& rows, unsigned runs);

}  // namespace ptc::bench
