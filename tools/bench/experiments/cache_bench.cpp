// Two kinds of runs. A HitRun looks up pages that are in the cache, millions of times. Its four
// variants find a page at different levels:
//
//   pointers                 table of pointers -> page: no cache could be faster
//   first level              reader's own slots -> page
//   second level, clock/LRU  reader's own slots (miss) -> shared table -> page
//
// A ShadeRun shades receivers with a cache that has frames for a share of the pages, empty at
// first, and with the file out of the system's cache. All ShadeRuns of a panel take turns, and must
// agree to the last bit.
#include "tools/bench/experiments/cache_bench.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <system_error>
#include <thread>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/disk_space.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/run.h"
#include "engine/shade/shader.h"
#include "tools/bench/experiments/bench_run.h"
#include "tools/bench/experiments/disk_reads.h"
#include "tools/bench/experiments/growth.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {
namespace {

/// Whether two lists of shadings are equal bit by bit.
bool same(const std::vector<Shading>& a, const std::vector<Shading>& b) {
  static_assert(std::is_trivially_copyable_v<Shading>);
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(Shading)) == 0;
}

/// Shades the scene's points with a page cache of some frames. Both it and the system's cache are
/// empty of the file's pages when a run begins.
class ShadeRun {
 public:
  /// A variant of shading.
  struct Way {
    std::string name;  ///< CacheRow::method
    BackEnd back_end = BackEnd::pread;
    Replacement replacement = Replacement::clock;
    bool read_ahead = true;
    bool shuffled = false;  ///< each block has receivers from all over the scene
  };

  ShadeRun(const BenchScene& scene, const Way& way, double cap, unsigned threads)
      : scene_(scene),
        way_(way),
        cap_(cap),
        threads_(threads),
        receivers_(scene.sets().front().receivers),
        results_(receivers_.size()) {
    const auto wanted = static_cast<std::uint64_t>(std::ceil(cap * scene.container().page_count()));
    const std::uint64_t frames = std::max<std::uint64_t>(wanted, 2 * threads);
    cache_options_ = {
        .memory_bytes = PageCache::bytes_for(scene.container(), threads, frames, way.back_end),
        .threads = threads,
        .back_end = way.back_end,
        .replacement = way.replacement,
        .read_ahead = way.read_ahead};
    if (way.shuffled) std::ranges::shuffle(receivers_, std::mt19937_64(1));
  }

  void run() {
    forget(scene_.container().file());
    PageCache cache(scene_.container(), cache_options_);
    // An executor that lives during this run only: while several exist, the smallest one limits the
    // threads of all.
    const ThreadPool executor(threads_);
    const std::uint64_t before = disk_bytes();
    times_.run([&] {
      Shader shader(scene_.container(), {.cache = &cache}, executor);
      Progress silent;
      // A call shades its receivers in the order of the Z-curve. A shuffled set is therefore shaded
      // by one call for each block.
      const std::size_t step = way_.shuffled ? Shader::kBlock : receivers_.size();
      for (std::size_t at = 0; at < receivers_.size(); at += step) {
        const std::size_t count = std::min(step, receivers_.size() - at);
        shader.shade(std::span(receivers_).subspan(at, count),
                     std::span(results_).subspan(at, count), silent);
      }
      statistics_ = shader.cache_statistics();
    });
    disk_ = disk_bytes() - before;
    waits_.push_back(statistics_.wait_seconds);
  }

  [[nodiscard]] CacheRow row(const std::string& panel) const {
    const auto count = static_cast<double>(receivers_.size());
    return {.panel = panel,
            .method = way_.name,
            .threads = threads_,
            .cap = cap_,
            .frames = statistics_.frames,
            .receivers = receivers_.size(),
            .wall = spread_of(times_.wall),
            .cpu = spread_of(times_.cpu),
            .wait = spread_of(waits_),
            .hit_rate = statistics_.hit_rate(),
            .pages = static_cast<double>(statistics_.misses) / count,
            .bytes = static_cast<double>(statistics_.bytes_read) / count,
            .disk_bytes = static_cast<double>(disk_) / count};
  }
  [[nodiscard]] const Way& way() const noexcept { return way_; }
  [[nodiscard]] const std::vector<Shading>& results() const noexcept { return results_; }

 private:
  const BenchScene& scene_;
  Way way_;
  double cap_;
  unsigned threads_;
  CacheOptions cache_options_;
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
  TimedRuns times_;
  std::vector<double> waits_;
  CacheStatistics statistics_;
  std::uint64_t disk_ = 0;
};

/// Looks up pages that are in the cache, in random order, none twice in a row.
class HitRun {
 public:
  static constexpr std::uint32_t kPages = 256;
  static constexpr std::size_t kLookups = 4'000'000;

  /// @param slots  slots of a reader's own level: kPages, so that it finds every page there, or 1,
  ///               so that it finds none
  HitRun(const ContainerReader& container, const std::string& method, Replacement replacement,
         std::uint32_t slots, unsigned threads)
      : method_(method),
        threads_(threads),
        pages_(std::min(kPages, container.page_count())),
        cache_(container, {.memory_bytes = PageCache::bytes_for(
                               container, threads, std::max(pages_, 2 * slots * threads)),
                           .threads = threads,
                           .replacement = replacement,
                           .local_slots = slots}) {
    // Draw the sequence of pages
    std::mt19937 random(1);
    std::uint32_t last = 0;
    for (std::uint32_t& page : sequence_) {
      do page = static_cast<std::uint32_t>(random() % pages_);
      while (page == last && pages_ > 1);
      last = page;
    }
    // Load all pages, and add up what the lookups must find
    PageReader reader(cache_);
    for (std::uint32_t page = 0; page < pages_; ++page)
      payloads_.push_back(reader.pin(page).payload());
    for (const std::uint32_t page : sequence_) expected_ += static_cast<unsigned>(*payloads_[page]);
  }

  /// Looks up the sequence once in each thread.
  /// @param pointers  read through a table of pointers instead of the cache
  /// @throws DataError when a lookup returned other bytes than the page's
  void run(bool pointers) {
    std::vector<std::uint64_t> sums(threads_);
    times_.run([&] {
      std::vector<std::jthread> running;
      for (unsigned thread = 0; thread < threads_; ++thread) {
        running.emplace_back(
            [&, thread] { sums[thread] = pointers ? sum_by_pointers() : sum_by_reader(); });
      }
    });
    for (const std::uint64_t sum : sums) {
      if (sum != expected_)
        throw DataError(method_ + ": a lookup returned other bytes than the page's");
    }
  }

  [[nodiscard]] CacheRow row() const {
    const CacheStatistics statistics = cache_.statistics();
    return {.panel = "hits",
            .method = method_,
            .threads = threads_,
            .cap = 1,
            .frames = statistics.frames,
            .receivers = kLookups,
            .wall = spread_of(times_.wall),
            .cpu = spread_of(times_.cpu),
            .wait = kNoSpread,
            .hit_rate = statistics.hit_rate(),
            .pages = kNone,
            .bytes = kNone,
            .disk_bytes = kNone};
  }

 private:
  [[nodiscard]] std::uint64_t sum_by_pointers() const {
    std::uint64_t sum = 0;
    for (const std::uint32_t page : sequence_) sum += static_cast<unsigned>(*payloads_[page]);
    return sum;
  }
  [[nodiscard]] std::uint64_t sum_by_reader() {
    PageReader reader(cache_);
    std::uint64_t sum = 0;
    for (const std::uint32_t page : sequence_)
      sum += static_cast<unsigned>(*reader.pin(page).payload());
    return sum;
  }

  std::string method_;
  unsigned threads_;
  std::uint32_t pages_;
  PageCache cache_;
  std::vector<std::uint32_t> sequence_ = std::vector<std::uint32_t>(kLookups);
  std::vector<const std::byte*> payloads_;
  std::uint64_t expected_ = 0;
  TimedRuns times_;
};

/// Runs all panels that were asked for.
class CacheRun : BenchRun<CacheBenchOptions, CacheRow> {
 public:
  using BenchRun::BenchRun;

  std::vector<CacheRow> measure() {
    {
      const BenchScene scene = make_scene(1, 16);
      if (wants("hits")) measure_hits(scene.container());
      if (wants("back-end")) measure_back_ends(scene);
      if (wants("threads")) measure_threads(scene);
      if (wants("receivers")) {
        shade_under_caps("receivers", scene,
                         {{.name = "Z-curve"}, {.name = "no order", .shuffled = true}}, {threads_});
      }
    }
    if (wants("pages")) {
      for (const auto& [name, levels] :
           {std::pair("a stream a level", 1), {"subtrees", 3}, {"depth-first", kLatticeBits}}) {
        shade_under_caps("pages", make_scene(levels, 16), {{.name = name}}, {1});
      }
    }
    if (wants("sizes")) {
      for (const auto& [name, shift] :
           {std::pair("16 KiB", 14), {"64 KiB", 16}, {"256 KiB", 18}, {"1 MiB", 20}}) {
        shade_under_caps("sizes", make_scene(1, static_cast<std::uint8_t>(shift)), {{.name = name}},
                         {1});
      }
    }
    return std::move(rows_);
  }

 private:
  [[nodiscard]] BenchScene make_scene(int levels_per_stream, std::uint8_t page_shift) {
    require_room({&work_, 1}, build_disk_bytes(options_.points),
                 fmt::format("{} surfels", options_.points));
    const SceneOptions scene{.points = options_.points,
                             .shaded_width = 0,
                             .own_points = options_.receivers,
                             .rays = false,
                             .levels_per_stream = levels_per_stream,
                             .page_shift = page_shift};
    return {{.name = "city"}, scene, work_, run_, progress_};
  }

  void add(CacheRow row) {
    rows_.push_back(std::move(row));
    report();
  }

  void measure_hits(const ContainerReader& container) {
    progress_.begin("hits", 4 * options_.repeats * thread_counts(threads_).size(), "runs");
    for (const unsigned threads : thread_counts(threads_)) {
      HitRun pointers(container, "pointers", Replacement::clock, HitRun::kPages, threads);
      HitRun first(container, "first level", Replacement::clock, HitRun::kPages, threads);
      HitRun clock(container, "second level, clock", Replacement::clock, 1, threads);
      HitRun lru(container, "second level, LRU", Replacement::lru, 1, threads);
      for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
        for (HitRun* const run : {&pointers, &first, &clock, &lru}) {
          run->run(run == &pointers);
          progress_.advance(1);
        }
      }
      for (const HitRun* const run : {&pointers, &first, &clock, &lru}) add(run->row());
    }
    progress_.end();
  }

  /// Measures the back ends that the system has, io_uring also without read-ahead.
  void measure_back_ends(const BenchScene& scene) {
    std::vector<ShadeRun::Way> ways{{.name = "pread"}, {.name = "mmap", .back_end = BackEnd::mmap}};
    try {
      static_cast<void>(make_page_source(BackEnd::direct, scene.container().file(), 4096));
      ways.push_back({.name = "direct", .back_end = BackEnd::direct});
      static_cast<void>(make_page_source(BackEnd::io_uring, scene.container().file(), 4096));
      ways.push_back({.name = "io_uring", .back_end = BackEnd::io_uring});
      ways.push_back(
          {.name = "io_uring, no read-ahead", .back_end = BackEnd::io_uring, .read_ahead = false});
    } catch (const std::system_error&) {  // a back end that the system lacks has no row
    }
    shade_under_caps("back-end", scene, ways, thread_counts(threads_));
  }

  /// Measures growing numbers of threads by replacement, at the middle cap.
  void measure_threads(const BenchScene& scene) {
    std::vector<std::unique_ptr<ShadeRun>> runs;
    for (const unsigned threads : options_.threads) {
      if (threads > 1 && threads * Shader::kBlock > options_.receivers)
        break;  // a block is shaded by one thread, so further threads would be idle
      for (const auto& way :
           {ShadeRun::Way{.name = "clock"}, {.name = "LRU", .replacement = Replacement::lru}}) {
        runs.push_back(std::make_unique<ShadeRun>(scene, way, options_.middle_cap, threads));
      }
    }
    shade("threads", runs);
  }

  /// Measures all ways under all caps with each number of threads.
  void shade_under_caps(const std::string& panel, const BenchScene& scene,
                        const std::vector<ShadeRun::Way>& ways,
                        const std::vector<unsigned>& threads) {
    std::vector<std::unique_ptr<ShadeRun>> runs;
    for (const unsigned count : threads) {
      for (const double cap : options_.caps) {
        for (const ShadeRun::Way& way : ways)
          runs.push_back(std::make_unique<ShadeRun>(scene, way, cap, count));
      }
    }
    shade(panel, runs);
  }

  /// Runs everything in turn, compares the results and adds the rows.
  void shade(const std::string& panel, const std::vector<std::unique_ptr<ShadeRun>>& runs) {
    progress_.begin("shade, " + panel, options_.repeats * runs.size(), "runs");
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      for (const auto& run : runs) {
        run->run();
        progress_.advance(1);
      }
    }
    progress_.end();
    // Compare with the first run over the same order of receivers
    for (const auto& run : runs) {
      const auto& first = *std::ranges::find_if(
          runs, [&](const auto& r) { return r->way().shuffled == run->way().shuffled; });
      if (!same(first->results(), run->results())) {
        throw DataError(panel + ", " + run->way().name +
                        ": shaded values differ from those under another cap");
      }
      add(run->row(panel));
    }
  }

  unsigned threads_ = ThreadPool(run_.threads).threads();
};

}  // namespace

std::vector<CacheRow> measure_cache(
    const CacheBenchOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<CacheRow>&)>& report) {
  return CacheRun(options, work, run, progress, report).measure();
}

}  // namespace ptc::bench
