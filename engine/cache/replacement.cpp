// Second chance over an array of flags, and least recently used over a list.
#include "engine/cache/replacement.h"

#include <atomic>
#include <cassert>
#include <mutex>
#include <vector>

namespace ptc {
namespace {

/// The clock: a hand goes round the frames, clears the flag of those used since it last passed, and
/// stops at the first whose flag is clear.
///
///   frame   0   1   2   3   4   5
///   used    .   x   x   .   .   x
///               ^ hand -----> candidate is 3; the flags of 1 and 2 are cleared
class ClockOrder : public ReplacementOrder {
 public:
  explicit ClockOrder(std::uint32_t frames) : marks_(frames) {}

  void insert(std::uint32_t frame) noexcept override { marks_[frame].takes_part = true; }
  void touch(std::uint32_t frame) noexcept override {
    std::atomic<bool>& asked_for = marks_[frame].asked_for;
    if (!asked_for.load(std::memory_order_relaxed))
      asked_for.store(true, std::memory_order_relaxed);
  }
  std::uint32_t candidate() noexcept override {
    for (;;) {
      const std::uint32_t frame = hand_;
      hand_ = hand_ + 1 == marks_.size() ? 0 : hand_ + 1;
      Mark& mark = marks_[frame];
      if (!mark.takes_part) continue;
      if (!mark.asked_for.load(std::memory_order_relaxed)) return frame;
      mark.asked_for.store(false, std::memory_order_relaxed);
    }
  }
  void erase(std::uint32_t frame) noexcept override {
    marks_[frame].takes_part = false;
    marks_[frame].asked_for.store(false, std::memory_order_relaxed);
  }

 private:
  struct Mark {
    std::atomic<bool> asked_for = false;
    bool takes_part = false;
  };
  std::vector<Mark> marks_;
  std::uint32_t hand_ = 0;
};

/// The frames as a doubly linked list from oldest to newest use. The links lie in an array by
/// frame, so that nothing allocates.
class LruOrder : public ReplacementOrder {
 public:
  explicit LruOrder(std::uint32_t frames) : links_(frames) {}

  void insert(std::uint32_t frame) noexcept override {
    const std::lock_guard lock(mutex_);
    append_newest(frame);
  }
  void touch(std::uint32_t frame) noexcept override {
    const std::lock_guard lock(mutex_);
    renew(frame);
  }
  std::uint32_t candidate() noexcept override {
    const std::lock_guard lock(mutex_);
    assert(oldest_ != kNone);
    const std::uint32_t frame = oldest_;
    renew(frame);
    return frame;
  }
  void erase(std::uint32_t frame) noexcept override {
    const std::lock_guard lock(mutex_);
    unlink(frame);
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffff;
  struct Link {
    std::uint32_t older = kNone;
    std::uint32_t newer = kNone;
  };
  static_assert(sizeof(Link) == kReplacementBytes);

  /// Moves a frame to the newest end.
  void renew(std::uint32_t frame) noexcept {
    unlink(frame);
    append_newest(frame);
  }
  void append_newest(std::uint32_t frame) noexcept {
    links_[frame] = {newest_, kNone};
    (newest_ == kNone ? oldest_ : links_[newest_].newer) = frame;
    newest_ = frame;
  }
  void unlink(std::uint32_t frame) noexcept {
    const Link& link = links_[frame];
    (link.older == kNone ? oldest_ : links_[link.older].newer) = link.newer;
    (link.newer == kNone ? newest_ : links_[link.newer].older) = link.older;
  }

  std::mutex mutex_;
  std::vector<Link> links_;
  std::uint32_t oldest_ = kNone;
  std::uint32_t newest_ = kNone;
};

}  // namespace

std::unique_ptr<ReplacementOrder> make_replacement_order(Replacement replacement,
                                                         std::uint32_t frames) {
  if (replacement == Replacement::lru) return std::make_unique<LruOrder>(frames);
  return std::make_unique<ClockOrder>(frames);
}

}  // namespace ptc
