// The bookkeeping of the cache, compared with textbook replacement.
#include "engine/cache/frame_table.h"

#include <algorithm>
#include <array>
#include <deque>
#include <optional>
#include <random>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/cache/pages.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::uint32_t kReaders = 3;
constexpr std::uint32_t kSlots = 2;
constexpr std::uint32_t kPages = 40;

/// The textbook LRU: frames in the order in which their pages were last requested.
class TextbookLru {
 public:
  explicit TextbookLru(std::uint32_t /*frames*/) {}
  void insert(std::uint32_t frame) { order_.push_back(frame); }
  void touch(std::uint32_t frame) {
    std::erase(order_, frame);
    order_.push_back(frame);
  }
  /// Returns the frame to evict. Pinned frames on the way to it count as requested.
  template <class Held>
  std::uint32_t evict(const Held& held) {
    while (held(order_.front())) touch(order_.front());
    const std::uint32_t frame = order_.front();
    order_.pop_front();
    return frame;
  }

 private:
  std::deque<std::uint32_t> order_;
};

/// The textbook clock: frames around a hand that gives requested ones a second chance.
class TextbookClock {
 public:
  explicit TextbookClock(std::uint32_t frames) : asked_for_(frames) {}
  void insert(std::uint32_t frame) { asked_for_[frame] = false; }
  void touch(std::uint32_t frame) { asked_for_[frame] = true; }
  template <class Held>
  std::uint32_t evict(const Held& held) {
    for (;; hand_ = (hand_ + 1) % asked_for_.size()) {
      std::optional<bool>& asked_for = asked_for_[hand_];
      if (!asked_for) continue;
      const bool again = *asked_for;
      asked_for = false;
      if (again || held(static_cast<std::uint32_t>(hand_))) continue;
      asked_for.reset();
      const auto frame = static_cast<std::uint32_t>(hand_);
      hand_ = (hand_ + 1) % asked_for_.size();
      return frame;
    }
  }

 private:
  std::vector<std::optional<bool>> asked_for_;  // empty: the frame takes no part
  std::size_t hand_ = 0;
};

/// A session of readers that request pages, with the outcome that each request must have.
template <class Order>
class Session {
 public:
  Session(std::uint32_t frames, Replacement replacement)
      : table_({kPages, frames, kReaders, kSlots}, replacement),
        page_in_(frames, kPages),
        order_(frames) {}

  void step(std::mt19937& random) {
    const std::uint32_t reader = below(kReaders, random);
    if (waits_[reader]) return arrive(*waits_[reader], below(8, random) == 0);
    const std::uint32_t page = below(kPages, random);
    const std::optional<std::uint32_t> expected = frame_with(page);
    const std::uint32_t held = table_.hold(reader, page);
    holds_[reader][page % kSlots].reset();
    if (expected && !loading(*expected)) {
      REQUIRE(held == *expected);
      REQUIRE(table_.page_bytes(held) == page * 10);
      REQUIRE(table_.record_count(held) == page + 1);
      order_.touch(held);
      holds_[reader][page % kSlots] = held;
      return;
    }
    REQUIRE(held == kNoFrame);
    REQUIRE(table_.present(page) == expected.has_value());
    std::uint32_t frame = table_.join(reader, page);
    REQUIRE(frame == expected.value_or(kNoFrame));
    if (frame == kNoFrame) frame = claim(reader, page);
    waits_[reader] = frame;
    holds_[reader][page % kSlots] = frame;
  }

  void check() const {
    CHECK(table_.evictions() == evictions_);
    CHECK(table_.evictions() > 100);
    CHECK(table_.peak() == table_.size());
  }

 private:
  [[nodiscard]] std::optional<std::uint32_t> frame_with(std::uint32_t page) const {
    const auto found = std::ranges::find(page_in_, page);
    if (found == page_in_.end()) return {};
    return static_cast<std::uint32_t>(found - page_in_.begin());
  }
  [[nodiscard]] bool loading(std::uint32_t frame) const {
    return std::ranges::count(waits_, frame) > 0;
  }
  [[nodiscard]] bool is_held(std::uint32_t frame) const {
    return std::ranges::any_of(
        holds_, [&](const auto& slots) { return std::ranges::count(slots, frame) > 0; });
  }

  std::uint32_t claim(std::uint32_t reader, std::uint32_t page) {
    const bool room = std::ranges::count(page_in_, kPages) > 0;
    const std::uint32_t frame = table_.claim(reader, page);
    if (!room) {
      const std::uint32_t left = order_.evict([&](std::uint32_t f) { return is_held(f); });
      REQUIRE(frame == left);
      REQUIRE(!table_.present(page_in_[left]));
      ++evictions_;
    }
    page_in_[frame] = page;
    return frame;
  }

  void arrive(std::uint32_t frame, bool fails) {
    const std::uint32_t page = page_in_[frame];
    REQUIRE(table_.state(frame) == FrameTable::State::loading);
    if (!fails) {
      table_.ready(frame, page * 10, page + 1);
      order_.insert(frame);
    } else {
      table_.fail(frame, std::make_exception_ptr(std::runtime_error("gone")));
      page_in_[frame] = kPages;
      REQUIRE(!table_.present(page));
    }
    for (std::uint32_t reader = 0; reader < kReaders; ++reader) {
      if (waits_[reader] != frame) continue;
      waits_[reader].reset();
      if (!fails) continue;
      REQUIRE(table_.state(frame) == FrameTable::State::failed);
      REQUIRE(table_.error(frame) != nullptr);
      table_.leave(reader, frame);
      holds_[reader][page % kSlots].reset();
    }
    REQUIRE(table_.state(frame) == (fails ? FrameTable::State::empty : FrameTable::State::ready));
  }

  FrameTable table_;
  std::vector<std::uint32_t> page_in_;  // by frame; kPages: no page
  Order order_;
  std::array<std::array<std::optional<std::uint32_t>, kSlots>, kReaders> holds_;
  std::array<std::optional<std::uint32_t>, kReaders> waits_;
  std::uint64_t evictions_ = 0;
};

template <class Order>
void check_order(Replacement replacement) {
  for (const std::uint32_t frames : {kReaders * kSlots, kReaders * kSlots + 1, 20U, kPages - 1}) {
    std::mt19937 random(frames);
    Session<Order> session(frames, replacement);
    for (int i = 0; i < 20'000; ++i) session.step(random);
    session.check();
  }
}

}  // namespace

TEST_CASE("frame table: pages leave in the order of a textbook LRU", "[cache][frames]") {
  check_order<TextbookLru>(Replacement::lru);
}

TEST_CASE("frame table: pages leave in the order of a textbook clock", "[cache][frames]") {
  check_order<TextbookClock>(Replacement::clock);
}

TEST_CASE("frame table: a released page can be evicted, a pinned one stays", "[cache][frames]") {
  FrameTable table({.pages = 8, .frames = 2, .readers = 1, .slots = 2}, Replacement::clock);
  for (const std::uint32_t page : {0U, 1U}) table.ready(table.claim(0, page), 1, 1);
  CHECK(table.hold(0, 2) == kNoFrame);  // lets go of page 0, whose slot it has
  table.ready(table.claim(0, 2), 1, 1);
  CHECK_FALSE(table.present(0));
  CHECK(table.present(1));
  table.release(0, 1);
  CHECK(table.hold(0, 4) == kNoFrame);  // and of page 2
  table.ready(table.claim(0, 4), 1, 1);
  CHECK(table.present(1) != table.present(2));
  CHECK(table.evictions() == 2);
}

TEST_CASE("frame table: a failed page keeps its error until the last waiting reader has read it",
          "[cache][frames]") {
  FrameTable table({.pages = 4, .frames = 2, .readers = 2, .slots = 1}, Replacement::clock);
  const std::uint32_t frame = table.claim(0, 3);
  CHECK(table.join(1, 3) == frame);
  table.fail(frame, std::make_exception_ptr(std::runtime_error("gone")));
  CHECK_FALSE(table.present(3));
  table.leave(0, frame);
  CHECK(table.state(frame) == FrameTable::State::failed);
  CHECK_THROWS_AS(std::rethrow_exception(table.error(frame)), std::runtime_error);
  const std::uint32_t again = table.claim(0, 3);  // a new attempt does not disturb waiting readers
  CHECK(again != frame);
  table.leave(1, frame);
  CHECK(table.state(frame) == FrameTable::State::empty);
  CHECK(table.error(frame) == nullptr);
  CHECK(table.claim(1, 0) == frame);
  CHECK(table.evictions() == 0);
  CHECK(table.peak() == 2);
}
