// Many threads on one cache: contents, single flight, failure, and no deadlock at the minimum cap.
#include <algorithm>
#include <array>
#include <atomic>
#include <barrier>
#include <exception>
#include <fstream>
#include <functional>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/cache/frame_table.h"
#include "engine/cache/page_cache.h"
#include "format/error.h"
#include "tests/cache/pages.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Calls body(thread) on this many threads at once.
void on_threads(unsigned threads, const std::function<void(unsigned)>& body) {
  std::barrier start(static_cast<std::ptrdiff_t>(threads));
  std::vector<std::jthread> running;
  for (unsigned thread = 0; thread < threads; ++thread) {
    running.emplace_back([&, thread] {
      start.arrive_and_wait();
      body(thread);
    });
  }
}

/// A few pages of 1 MiB, whose reads last long enough for threads to meet in them.
SampleOptions slow_pages() {
  SampleOptions options;
  options.writer.page_shift = 20;
  options.points = 60000;
  options.leaf_points = 64;
  options.attribute_groups = 0;
  return options;
}

/// Changes one byte of a page's payload in the file.
void damage(const Pages& pages, std::uint32_t page) {
  const std::uint64_t at = pages.container.entry(page).offset + kPageHeaderBytes + 6;
  std::fstream file(pages.file.path(), std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(static_cast<std::streamoff>(at));
  const int byte = file.get();
  file.seekp(static_cast<std::streamoff>(at));
  file.put(static_cast<char>(byte ^ 1));
}

void check_sums(const CacheStatistics& s, std::uint64_t lookups) {
  CHECK(s.lookups == lookups);
  CHECK(s.local_hits + s.shared_hits + s.misses == lookups);
  CHECK(s.evictions <= s.misses);
  CHECK(s.peak_frames <= s.frames);
}

}  // namespace

TEST_CASE("frame table: a pinned frame keeps its page while other readers claim frames",
          "[cache][frames][threads]") {
  constexpr std::uint32_t kReaders = 4, kPages = 6;
  for (const Replacement replacement : {Replacement::clock, Replacement::lru}) {
    FrameTable table({.pages = kPages, .frames = kReaders, .readers = kReaders, .slots = 1},
                     replacement);
    std::array<std::atomic<std::uint32_t>, kReaders> page_in{};
    std::mutex mutex;
    std::atomic<std::size_t> wrong = 0;
    on_threads(kReaders, [&](unsigned reader) {
      std::mt19937 random(reader);
      for (int i = 0; i < 300'000; ++i) {
        const std::uint32_t page = below(kPages, random);
        std::uint32_t frame = table.hold(reader, page);
        if (frame == kNoFrame) {
          const std::lock_guard lock(mutex);
          frame = table.join(reader, page);
          if (frame == kNoFrame) {
            frame = table.claim(reader, page);
            page_in[frame] = page;
            table.ready(frame, 1, 1);
          }
        }
        for (int look = 0; look < 4; ++look) {
          if (page_in[frame] != page) ++wrong;
        }
      }
    });
    CHECK(wrong == 0);
    CHECK(table.evictions() > 1000);
  }
}

TEST_CASE("cache: threads that compete for frames get the right pages", "[cache][threads]") {
  const Pages pages;
  constexpr std::uint64_t kGets = 3000;
  for (const unsigned threads : {2u, 4u, 8u}) {
    for (const std::uint64_t frames : {2 * threads, 5 * threads, pages.count()}) {
      for (const BackEnd back_end : available_back_ends(pages.container.file())) {
        CacheOptions options = pages.options(threads, frames, 0, back_end);
        options.replacement = frames % 2 == 0 ? Replacement::clock : Replacement::lru;
        PageCache cache(pages.container, options);
        std::atomic<std::size_t> wrong = 0;
        on_threads(threads, [&](unsigned thread) {
          PageReader reader(cache);
          std::mt19937 random(thread);
          for (std::uint64_t i = 0; i < kGets; ++i) {
            // Half of the requests go to a few pages that all threads want.
            const std::uint32_t page = below(i % 2 == 0 ? 8 : pages.count(), random);
            if (!pages.same(page, reader.pin(page))) ++wrong;
          }
        });
        CHECK(wrong == 0);
        check_sums(cache.statistics(), threads * kGets);
      }
    }
  }
}

TEST_CASE("cache: a page that all threads request at once is read once", "[cache][threads]") {
  const Pages pages(slow_pages());
  constexpr unsigned kThreads = 8;
  for (int round = 0; round < 20; ++round) {
    PageCache cache(pages.container, pages.options(kThreads, 2 * kThreads));
    std::barrier together(kThreads);
    on_threads(kThreads, [&](unsigned) {
      PageReader reader(cache);
      for (std::uint32_t page = 0; page < pages.count(); ++page) {
        together.arrive_and_wait();
        static_cast<void>(reader.pin(page));
      }
    });
    const CacheStatistics s = cache.statistics();
    check_sums(s, std::uint64_t{kThreads} * pages.count());
    REQUIRE(s.misses == pages.count());
    REQUIRE(s.evictions == 0);
  }
}

TEST_CASE("cache: a thread that waits for a failing read gets its error",
          "[cache][threads][failure]") {
  const Pages pages(slow_pages());
  damage(pages, 0);
  constexpr unsigned kThreads = 4;
  PageCache cache(pages.container, pages.options(kThreads, 2 * kThreads));
  std::atomic<std::uint64_t> errors = 0;
  std::uint64_t asked = 0;
  // Whether two threads meet in one read is up to the system: try until they do.
  while (asked < 4000 && cache.statistics().shared_hits == 0) {
    asked += kThreads;
    on_threads(kThreads, [&](unsigned) {
      PageReader reader(cache);
      try {
        static_cast<void>(reader.pin(0));
      } catch (const FormatError&) {
        ++errors;
      }
    });
  }
  CHECK(cache.statistics().shared_hits > 0);
  CHECK(errors == asked);
  PageReader reader(cache);
  CHECK(pages.same(1, reader.pin(1)));
}

TEST_CASE("cache: readers that pin as much as allowed do not block each other",
          "[cache][threads]") {
  const Pages pages;
  constexpr unsigned kThreads = 4;
  constexpr std::uint32_t kSlots = 4;
  // Every frame can be pinned: there are threads * slots of them.
  PageCache cache(pages.container, pages.options(kThreads, kThreads * kSlots, kSlots));
  REQUIRE(cache.statistics().frames == kThreads * kSlots);
  std::atomic<std::size_t> wrong = 0;
  on_threads(kThreads, [&](unsigned thread) {
    PageReader reader(cache);
    for (std::uint32_t i = 0; i < 5000; ++i) {
      const std::uint32_t page = (i + 25 * thread) % pages.count();
      if (!pages.same(page, reader.pin(page))) ++wrong;
    }
  });
  CHECK(wrong == 0);
}

TEST_CASE("cache: threads that request a damaged page get its error, the others their pages",
          "[cache][threads][failure]") {
  const Pages pages;
  damage(pages, 0);
  const std::uint64_t payload_at = pages.container.entry(0).offset + kPageHeaderBytes;
  constexpr unsigned kThreads = 8;
  constexpr std::uint64_t kGets = 2000;
  for (const std::uint64_t frames : {std::uint64_t{2 * kThreads}, std::uint64_t{pages.count()}}) {
    PageCache cache(pages.container, pages.options(kThreads, frames));
    std::atomic<std::size_t> wrong = 0;
    std::atomic<std::size_t> errors = 0;
    std::atomic<std::size_t> asked = 0;
    std::mutex reading;
    on_threads(kThreads, [&](unsigned thread) {
      PageReader reader(cache);
      std::mt19937 random(thread);
      for (std::uint64_t i = 0; i < kGets; ++i) {
        const std::uint32_t page = i % 3 == 0 ? 0 : 1 + below(pages.count() - 1, random);
        if (page == 0) ++asked;
        std::exception_ptr caught;
        try {
          if (!pages.same(page, reader.pin(page))) ++wrong;
        } catch (...) {
          caught = std::current_exception();
        }
        if (!caught) continue;
        // Threads share the error. Its references are counted in a library that the thread
        // sanitizer does not see: the lock shows it that the error is freed after everyone has read
        // it.
        const std::lock_guard lock(reading);
        try {
          std::rethrow_exception(std::exchange(caught, nullptr));
        } catch (const FormatError& error) {
          const bool right = page == 0 && error.offset() == payload_at;
          ++(right ? errors : wrong);
        }
      }
    });
    CHECK(wrong == 0);
    CHECK(errors == asked);
    check_sums(cache.statistics(), kThreads * kGets);
  }
}
