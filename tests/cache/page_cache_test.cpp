// The cache on one thread: what it returns, counts, evicts and allocates.
#include "engine/cache/page_cache.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <functional>
#include <list>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>

#include <catch2/catch.hpp>

#include "engine/base/memory.h"
#include "format/error.h"
#include "tests/cache/pages.h"
#include "tests/support/sanitizers.h"

using namespace ptc;
using namespace ptc::test;

namespace {

using Trace = std::vector<std::uint32_t>;

/// Returns the number of misses of a textbook LRU with this many frames.
std::uint64_t lru_misses(const Trace& trace, std::size_t frames) {
  std::list<std::uint32_t> recent;
  std::uint64_t misses = 0;
  for (const std::uint32_t page : trace) {
    const auto found = std::ranges::find(recent, page);
    if (found != recent.end()) {
      recent.erase(found);
    } else {
      ++misses;
      if (recent.size() == frames) recent.pop_back();
    }
    recent.push_front(page);
  }
  return misses;
}

Trace random_trace(std::uint32_t pages, std::size_t length) {
  std::mt19937 random(pages);
  Trace trace(length);
  // Square the number, so that some pages are requested much more often than others.
  for (std::uint32_t& page : trace) {
    const double u = static_cast<double>(random()) / 4294967296.0;
    page = static_cast<std::uint32_t>(u * u * pages);
  }
  return trace;
}

Trace looping_trace(std::uint32_t pages, std::size_t length) {
  Trace trace(length);
  for (std::size_t i = 0; i < length; ++i) trace[i] = static_cast<std::uint32_t>(i % pages);
  return trace;
}

Trace walking_trace(std::uint32_t pages, std::size_t length) {
  std::mt19937 random(pages);
  Trace trace(length);
  std::uint32_t at = 0;
  for (std::uint32_t& page : trace) page = at = (at + pages + below(7, random) - 3) % pages;
  return trace;
}

CacheStatistics run(PageCache& cache, const Pages& pages, const Trace& trace) {
  std::size_t wrong = 0;
  {
    PageReader reader(cache);
    for (const std::uint32_t page : trace) {
      if (!pages.same(page, reader.pin(page))) ++wrong;
    }
  }
  CHECK(wrong == 0);
  return cache.statistics();
}

void check_sums(const CacheStatistics& s, std::uint64_t lookups) {
  CHECK(s.lookups == lookups);
  CHECK(s.local_hits + s.shared_hits + s.misses == lookups);
  CHECK(s.peak_frames <= s.frames);
  CHECK(s.evictions == s.misses - std::min(s.misses, s.frames));
}

/// Flips a bit of the file on construction and flips it back on destruction.
class Flip {
 public:
  Flip(const std::filesystem::path& path, std::uint64_t at) : path_(path), at_(at) { flip(); }
  ~Flip() { flip(); }
  Flip(const Flip&) = delete;
  Flip& operator=(const Flip&) = delete;

 private:
  void flip() const {
    const int fd = ::open(path_.c_str(), O_RDWR);
    unsigned char byte = 0;
    if (::pread(fd, &byte, 1, static_cast<off_t>(at_)) != 1) FAIL_CHECK("pread");
    byte ^= 1;
    if (::pwrite(fd, &byte, 1, static_cast<off_t>(at_)) != 1) FAIL_CHECK("pwrite");
    ::close(fd);
  }
  std::filesystem::path path_;
  std::uint64_t at_;
};

}  // namespace

TEST_CASE("cache: the shared level misses as often as a textbook LRU", "[cache][lru]") {
  const Pages pages;
  const std::uint32_t n = pages.count();
  REQUIRE(n > 90);
  for (const auto& trace : {random_trace(n, 4000), looping_trace(n, 4 * n), looping_trace(20, 400),
                            walking_trace(n, 4000)}) {
    for (const std::uint64_t frames : {2u, 3u, 5u, 10u, 19u, 20u, 21u, 50u, n - 1, n}) {
      CacheOptions options = pages.options(1, frames, 1);
      options.replacement = Replacement::lru;
      PageCache cache(pages.container, options);
      const CacheStatistics s = run(cache, pages, trace);
      INFO(frames << " frames");
      REQUIRE(s.frames == frames);
      CHECK(s.misses == lru_misses(trace, frames));
      check_sums(s, trace.size());
    }
  }
}

TEST_CASE("cache: the reader's own level changes which level answers, not the answer",
          "[cache][local]") {
  const Pages pages;
  const Trace trace = random_trace(pages.count(), 5000);
  std::uint64_t local_hits = 0;
  for (std::uint32_t slots = 1; slots <= 32; slots *= 2) {
    PageCache cache(pages.container, pages.options(1, 64, slots));
    CHECK(cache.local_slots() == slots);
    const CacheStatistics s = run(cache, pages, trace);
    check_sums(s, trace.size());
    CHECK(s.local_hits > local_hits);
    local_hits = s.local_hits;
  }
}

TEST_CASE("cache: with a frame for every page, each page is read once", "[cache]") {
  const Pages pages;
  for (const BackEnd back_end : available_back_ends(pages.container.file())) {
    const CacheOptions options = pages.options(1, pages.count(), 0, back_end);
    PageCache cache(pages.container, options);
    const CacheStatistics s = run(cache, pages, looping_trace(pages.count(), 3 * pages.count()));
    CHECK(s.misses == pages.count());
    CHECK(s.evictions == 0);
    CHECK(s.peak_frames == pages.count());
    std::uint64_t bytes = 0;
    for (std::uint32_t page = 0; page < pages.count(); ++page) {
      bytes += kPageHeaderBytes + pages.container.entry(page).stored_bytes;
    }
    CHECK(s.bytes_read == bytes);
    CHECK(s.hit_rate() == Approx(2.0 / 3));
  }
}

TEST_CASE("cache: a payload starts on a cache line, and 64 bytes past its end can be read",
          "[cache]") {
  const Pages pages;
  PageCache cache(pages.container, pages.options(1, 2));
  PageReader reader(cache);
  unsigned sum = 0;
  for (std::uint32_t page = 0; page < pages.count(); ++page) {
    const PageGuard found = reader.pin(page);
    CHECK(std::bit_cast<std::uintptr_t>(found.payload()) % 64 == 0);
    for (std::size_t i = 0; i < 64; ++i)
      sum += static_cast<unsigned>(found.payload()[found.bytes() + i]);
  }
  CHECK(sum < 64 * 256 * pages.count());
}

TEST_CASE("cache: local slots are a power of two that leaves frames to share", "[cache][local]") {
  SampleOptions large = many_pages();
  large.points = 40000;
  const Pages pages(large);
  REQUIRE(pages.count() > 1200);
  for (const unsigned threads : {1u, 2u, 3u, 8u}) {
    for (std::uint64_t frames = 2 * threads; frames <= pages.count(); frames = frames * 5 / 3 + 1) {
      PageCache cache(pages.container, pages.options(threads, frames));
      const std::uint32_t slots = cache.local_slots();
      CHECK(std::has_single_bit(slots));
      CHECK(slots <= 256);
      CHECK((slots == 1 || slots * 2 * threads <= frames));
      CHECK((slots == 256 || slots * 4 * threads > frames));
    }
  }
}

TEST_CASE("cache: the minimum cap works, and one byte less is refused with that minimum",
          "[cache][cap]") {
  const Pages pages;
  for (const unsigned threads : {1u, 2u, 5u, 64u}) {
    CacheOptions options;
    options.threads = threads;
    options.memory_bytes = PageCache::min_bytes(pages.container, threads);
    const PageCache cache(pages.container, options);
    CHECK(cache.statistics().frames == 2 * threads);
    CHECK(cache.local_slots() == 1);
    const std::string least = std::to_string(options.memory_bytes);
    --options.memory_bytes;
    CHECK_THROWS_AS(PageCache(pages.container, options), std::invalid_argument);
    CHECK_THROWS_WITH(PageCache(pages.container, options), Catch::Contains(least));
  }
}

TEST_CASE("cache: there are no more frames than the file can use", "[cache][cap]") {
  const Pages pages;
  CacheOptions options;
  options.memory_bytes = std::uint64_t{1} << 40;
  const PageCache cache(pages.container, options);
  CHECK(cache.statistics().frames == pages.count());
}

TEST_CASE("cache: options that cannot work are refused", "[cache]") {
  const Pages pages;
  const auto refused = [&](const CacheOptions& options) {
    CHECK_THROWS_AS(PageCache(pages.container, options), std::invalid_argument);
  };
  refused(pages.options(0, 10));
  refused(pages.options(1, 10, 3));
  refused(pages.options(1, 10, 16));
  refused(pages.options(1, 1000, 512));
  refused(pages.options(2, 10, 8));
  refused(pages.options(2, 10, 1u << 31));
  CHECK_NOTHROW(PageCache(pages.container, pages.options(2, 16, 8)));
}

TEST_CASE("cache: more readers than threads are refused, and a destroyed one makes room",
          "[cache]") {
  const Pages pages;
  PageCache cache(pages.container, pages.options(2, 8));
  PageReader first(cache);
  {
    PageReader second(cache);
    CHECK_THROWS_AS(PageReader(cache), std::invalid_argument);
  }
  CHECK_NOTHROW(PageReader(cache));
}

TEST_CASE("cache: a destroyed reader unpins its pages", "[cache]") {
  const Pages pages;
  PageCache cache(pages.container, pages.options(1, 16, 16));
  for (int round = 0; round < 5; ++round) {
    PageReader reader(cache);
    for (std::uint32_t page = 0; page < pages.count(); ++page) {
      REQUIRE(pages.same(page, reader.pin(page)));
    }
  }
  CHECK(cache.statistics().lookups == std::uint64_t{5} * pages.count());
}

TEST_CASE("cache: a reader gives up no page that is pinned, whatever the others evict",
          "[cache][guard]") {
  const Pages pages;
  PageCache cache(pages.container, pages.options(2, 4, 1));
  PageReader reader(cache), other(cache);
  {
    PageGuard pinned = reader.pin(0);
    CHECK_THROWS_AS(reader.pin(1), std::logic_error);
    for (std::uint32_t page = 1; page < pages.count(); ++page) {
      CHECK(pages.same(page, other.pin(page)));
    }
    CHECK(pages.same(0, pinned));
    const PageGuard moved = std::move(pinned);
    CHECK_THROWS_AS(reader.pin(1), std::logic_error);
    CHECK(pages.same(0, moved));
  }
  CHECK(pages.same(1, reader.pin(1)));
  CHECK(cache.statistics().evictions > 0);
}

TEST_CASE("cache: a nonexistent page is refused and not counted", "[cache]") {
  const Pages pages;
  PageCache cache(pages.container, pages.options(1, 4));
  {
    PageReader reader(cache);
    CHECK_THROWS_AS(reader.pin(kNoPage), std::invalid_argument);  // no slot holds a page yet
    CHECK(pages.same(0, reader.pin(0)));
    CHECK_THROWS_AS(reader.pin(pages.count()), std::invalid_argument);
    CHECK(pages.same(0, reader.pin(0)));
  }
  CHECK(cache.statistics().lookups == 2);
  CHECK(cache.statistics().hit_rate() == Approx(0.5));
}

TEST_CASE("cache: a damaged page is an error each time, and readable once it is mended",
          "[cache][failure]") {
  const Pages pages;
  for (const std::uint32_t slots : {1u, 2u}) {
    PageCache cache(pages.container, pages.options(1, 4, slots));
    {
      PageReader reader(cache);
      CHECK(pages.same(2, reader.pin(2)));
      {
        const Flip damage(pages.file.path(), pages.container.entry(0).offset + 70);
        for (int i = 0; i < 20; ++i) CHECK_THROWS_AS(reader.pin(0), FormatError);
        CHECK(pages.same(1, reader.pin(1)));
        CHECK_THROWS_WITH(reader.pin(0), Catch::StartsWith(pages.file.path().string()));
      }
      CHECK(pages.same(0, reader.pin(0)));
      for (std::uint32_t page = 0; page < pages.count(); ++page) {
        CHECK(pages.same(page, reader.pin(page)));
      }
    }
    const CacheStatistics s = cache.statistics();
    CHECK(s.lookups == 24 + pages.count());
    CHECK(s.local_hits + s.shared_hits + s.misses == s.lookups);
    CHECK(s.peak_frames == 4);
  }
}

TEST_CASE("cache: statistics lack a living reader's hits until the reader reports them",
          "[cache]") {
  const Pages pages;
  PageCache cache(pages.container, pages.options(1, 8));
  CHECK(cache.statistics().hit_rate() == 1);
  PageReader reader(cache);
  static_cast<void>(reader.pin(0));
  static_cast<void>(reader.pin(0));
  static_cast<void>(reader.pin(0));
  CHECK(cache.statistics().lookups == 1);
  static_cast<void>(reader.pin(1));
  CHECK(cache.statistics().lookups == 4);
  CHECK(cache.statistics().local_hits == 2);
}

TEST_CASE("cache: resident memory stays within the cap", "[cache][cap]") {
  if (kSanitized) {
    WARN("not measured: a sanitizer's own memory would be counted");
    return;
  }
  SampleOptions options;
  options.writer = {16, Codec::raw, 1, {}};
  options.points = 400000;
  options.leaf_points = 64;
  options.attribute_groups = 0;
  const SceneFile file(options);
  const ContainerReader container(file.path());
  constexpr std::uint64_t kCap = std::uint64_t{4} << 20;
  constexpr std::uint64_t kNoise = std::uint64_t{256} << 10;  // memory that the test itself takes
  REQUIRE(std::filesystem::file_size(file.path()) > 3 * kCap);
  for (const BackEnd back_end : available_back_ends(container.file())) {
    const std::uint64_t before = resident_bytes();
    std::uint64_t most = 0;
    PageCache cache(container, {.memory_bytes = kCap, .back_end = back_end});
    PageReader reader(cache);
    for (std::uint32_t round = 0; round < 2; ++round) {
      for (std::uint32_t page = 0; page < container.page_count(); ++page) {
        static_cast<void>(reader.pin(page));
        most = std::max(most, resident_bytes());
      }
    }
    CHECK(most - before <= kCap + kNoise);
    CHECK(most - before >= kCap / 2);
  }
}
