// What a page cache below the size of the scene costs, by back end, replacement, threads and page
// order.
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

/// hits: a lookup of a page that is there. back-end: shading under caps, pages read in each way.
/// threads: shading at CacheBenchOptions::middle_cap, by replacement. receivers: under caps, in the
/// order of the Z-curve and in none. pages: under caps, node pages filled in another order. sizes:
/// under caps, pages of other sizes.
inline constexpr std::array kCachePanels{"hits",      "back-end", "threads",
                                         "receivers", "pages",    "sizes"};

struct CacheBenchOptions {
  std::uint64_t points = 6'000'000;                      ///< of the city
  std::uint64_t receivers = 65'536;                      ///< blocks of neighbours spread over it
  std::vector<double> caps{1, 0.29, 0.09, 0.04, 0.023};  ///< frames over pages, descending
  double middle_cap = 0.09;
  std::vector<unsigned> threads{
      1, 2, 4, 8, 16, 32, 64};  ///< ascending; no more than there are blocks of receivers
  std::vector<std::string> panels{kCachePanels.begin(), kCachePanels.end()};
  unsigned repeats = 5;
};

/// One measurement. NaN: not measured.
struct CacheRow {
  std::string panel, method;
  unsigned threads = 0;
  double cap = 0;  ///< share of the pages that have a frame
  std::uint64_t frames = 0;
  std::uint64_t receivers = 0;  ///< of "hits", lookups
  Spread wall, cpu;             ///< seconds
  Spread wait;                  ///< for pages, all threads together, seconds
  double hit_rate = 0;          ///< of lookups
  double pages = 0, bytes = 0;  ///< missed, and of them stored, a receiver
  double disk_bytes = 0;        ///< that the disk gave, a receiver
};

/// Runs everything asked for in one process; within a panel's scene in turn, with neither cache nor
/// file in memory at first. All must shade all receivers alike, to the last bit; a lookup must
/// bring the page's bytes.
/// @param work  directory for the containers, without names there once they are open
/// @throws std::system_error (ENOSPC) before a build when `work` has no room for it; DataError when
/// answers differ
[[nodiscard]] std::vector<CacheRow> measure_cache(
    const CacheBenchOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<CacheRow>&)>& report = {});

/// Files "cache": the rows, and a chart of each panel.
[[nodiscard]] Report report_of(const std::vector<CacheRow>& rows, unsigned runs);

}  // namespace ptc::bench
