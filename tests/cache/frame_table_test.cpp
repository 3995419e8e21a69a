// The bookkeeping of the cache against a textbook LRU.
#include "engine/cache/frame_table.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <deque>
#include <map>
#include <random>
#include <stdexcept>
#include <vector>

#include "tests/cache/pages.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Pages in the order in which they were last unpinned, and how often each is pinned.
class TextbookLru {
 public:
  explicit TextbookLru(std::size_t frames) : frames_(frames) {}

  [[nodiscard]] bool holds(std::uint32_t page) const {
    return pins_.contains(page) || std::ranges::count(unpinned_, page) > 0;
  }
  [[nodiscard]] bool can_claim() const {
    return !unpinned_.empty() || pins_.size() + unpinned_.size() < frames_;
  }
  /// Pins a page. @return the page that left for it, or kNoFrame
  std::uint32_t pin(std::uint32_t page) {
    std::uint32_t left = kNoFrame;
    if (!holds(page) && pins_.size() + unpinned_.size() == frames_) {
      left = unpinned_.front();
      unpinned_.pop_front();
    }
    std::erase(unpinned_, page);
    ++pins_[page];
    return left;
  }
  void unpin(std::uint32_t page) {
    if (--pins_[page] > 0) return;
    pins_.erase(page);
    unpinned_.push_back(page);
  }
  /// The last pin of a page that did not arrive.
  void drop(std::uint32_t page) { pins_.erase(page); }
  [[nodiscard]] const std::map<std::uint32_t, int>& pinned() const { return pins_; }

 private:
  std::size_t frames_;
  std::deque<std::uint32_t> unpinned_;  // oldest first
  std::map<std::uint32_t, int> pins_;
};

}  // namespace

TEST_CASE("frame table: pages leave in the order of a textbook LRU", "[cache][frames]") {
  constexpr std::uint32_t kPages = 40;
  std::mt19937 random(1);
  for (const std::uint32_t frames : {1u, 2u, 3u, 7u, 20u, 39u, 40u, 60u}) {
    FrameTable table(kPages, frames);
    TextbookLru oracle(frames);
    std::uint64_t evictions = 0;
    for (int step = 0; step < 20000; ++step) {
      const std::uint32_t page = below(kPages, random);
      const std::uint32_t frame = table.find(page);
      REQUIRE((frame != kNoFrame) == oracle.holds(page));
      const bool pinned = oracle.pinned().contains(page);
      if (pinned && below(2, random) == 0) {
        table.unpin(frame);
        oracle.unpin(page);
      } else if (frame != kNoFrame) {
        table.pin(frame);
        oracle.pin(page);
      } else if (oracle.can_claim()) {
        const std::uint32_t claimed = table.claim(page);
        if (below(8, random) == 0) {
          if (oracle.pin(page) != kNoFrame) ++evictions;
          table.fail(claimed, std::make_exception_ptr(std::runtime_error("gone")));
          table.unpin(claimed);
          oracle.drop(page);
          REQUIRE(table.find(page) == kNoFrame);
          continue;
        }
        table.ready(claimed, page * 10, page + 1);
        const std::uint32_t left = oracle.pin(page);
        if (left != kNoFrame) {
          ++evictions;
          REQUIRE(table.find(left) == kNoFrame);
        }
      }
      if (const std::uint32_t now = table.find(page); now != kNoFrame) {
        REQUIRE(table.page_bytes(now) == page * 10);
        REQUIRE(table.record_count(now) == page + 1);
      }
    }
    CHECK(table.evictions() == evictions);
    CHECK(table.peak() <= frames);
    if (frames < kPages / 2) CHECK(table.peak() == frames);
  }
}

TEST_CASE("frame table: a failed page keeps its error until the last pin", "[cache][frames]") {
  FrameTable table(4, 2);
  const std::uint32_t frame = table.claim(3);
  table.pin(frame);  // someone waits
  table.fail(frame, std::make_exception_ptr(std::runtime_error("gone")));
  CHECK(table.find(3) == kNoFrame);
  table.unpin(frame);
  CHECK(table.state(frame) == FrameTable::State::failed);
  CHECK_THROWS_AS(std::rethrow_exception(table.error(frame)), std::runtime_error);
  const std::uint32_t again = table.claim(3);  // a new try does not disturb who still waits
  CHECK(again != frame);
  table.unpin(frame);
  CHECK(table.state(frame) == FrameTable::State::empty);
  CHECK(table.error(frame) == nullptr);
  CHECK(table.claim(0) == frame);
  CHECK(table.evictions() == 0);
  CHECK(table.peak() == 2);
}
