// The cost of a page cache that is smaller than the scene, by back end, replacement, threads and
// order of pages: the experiment `ptcbench cache`.
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

/// The parts of the experiment:
///
///   panel       what is measured                          what varies
///   hits        lookups of pages that are in the cache    level of the cache, replacement, threads
///   back-end    shading under caps                        the way in which pages are read, threads
///   threads     shading at CacheBenchOptions::middle_cap  threads, replacement
///   receivers   shading under caps                        receivers along the Z-curve or shuffled
///   pages       shading under caps                        the order in which node pages are filled
///   sizes       shading under caps                        bytes of a page
inline constexpr std::array kCachePanels{"hits",      "back-end", "threads",
                                         "receivers", "pages",    "sizes"};

/// What `ptcbench cache` measures.
struct CacheBenchOptions {
  std::uint64_t points = 6'000'000;  ///< points of the city
  std::uint64_t receivers = 65'536;  ///< among its points, in blocks of neighbours
  std::vector<double> caps{1, 0.29, 0.09, 0.04, 0.023};  ///< frames over pages, descending
  double middle_cap = 0.09;                              ///< frames over pages, of "threads"
  std::vector<unsigned> threads{
      1, 2, 4, 8, 16, 32, 64};  ///< ascending; counts above the number of blocks are left out
  std::vector<std::string> panels{kCachePanels.begin(), kCachePanels.end()};
  unsigned repeats = 5;
};

/// One measurement. A value that was not measured is NaN.
struct CacheRow {
  std::string panel, method;
  unsigned threads = 0;
  double cap = 0;  ///< share of the pages that have a frame
  std::uint64_t frames = 0;
  std::uint64_t receivers = 0;  ///< number of receivers shaded; in "hits", of lookups
  Spread wall, cpu;             ///< seconds
  Spread wait;                  ///< time spent waiting for pages, all threads together, seconds
  double hit_rate = 0;          ///< hits over lookups
  double pages = 0, bytes = 0;  ///< read by the cache for each receiver; bytes as they are stored
  double disk_bytes = 0;        ///< read from the disk for each receiver, as the system reports
};

/// Runs everything that was asked for in one process; the variants of a panel take turns. Each run
/// begins with an empty cache and with the file out of the system's cache. All variants must shade
/// all receivers equally to the last bit, and a lookup must return the page's bytes.
/// @param work    directory for the containers, which have no names there once they are open
/// @param report  called with all rows so far, whenever there are more
/// @throws std::system_error (ENOSPC) before a build when `work` has no room for it; DataError when
///         answers differ
[[nodiscard]] std::vector<CacheRow> measure_cache(
    const CacheBenchOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<CacheRow>&)>& report = {});

/// Makes the report "cache": the rows, and a chart of each panel.
[[nodiscard]] Report report_of(const std::vector<CacheRow>& rows, unsigned runs);

}  // namespace ptc::bench
