// Which page each frame holds, and which readers hold it.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <vector>

#include "engine/cache/replacement.h"

namespace ptc {

inline constexpr std::uint32_t kNoFrame = 0xffffffff;

/// The bookkeeping of a cache without its bytes, locks or I/O.
///
///              claim              ready              claim takes what
///   (empty) ----------> loading ----------> ready    nobody holds: evicted, loading again
///      ^                   | fail
///      |   last leave      v
///      +--------------- failed
///
/// A reader has as many slots as its own level; what it holds of page p is told in slot p mod
/// slots, so a frame's holders are found by one look at each reader. hold() finds a page that is
/// ready without a lock and without a write that other readers share:
///
///   hold()                          claim(), of a page in frame f
///   held = f                        frame of the page = none
///   is it still the page's frame?   does anyone hold f?
///
/// Both store first and look then, in one order for all threads (seq_cst): one of the two sees the
/// other.
///
/// Threads: hold() and release() by each reader for itself, at any time; all else by who has the
/// caller's lock.
class FrameTable {
 public:
  enum class State : std::uint8_t { empty, loading, ready, failed };
  struct Layout {
    std::uint32_t pages = 0;
    std::uint32_t frames = 0;
    std::uint32_t readers = 0;
    std::uint32_t slots = 0;  ///< of a reader, a power of two
  };

  FrameTable(const Layout& layout, Replacement replacement);

  /// Bytes that the tables take.
  [[nodiscard]] static std::uint64_t bytes(std::uint64_t pages, std::uint64_t frames,
                                           std::uint64_t readers, std::uint64_t slots) noexcept;

  /// Holds the frame of a page that is ready, in place of what the reader held in that slot.
  /// @return the frame, or kNoFrame: the page is not ready, and the slot holds nothing
  [[nodiscard]] std::uint32_t hold(std::uint32_t reader, std::uint32_t page) noexcept;
  /// Lets go of what is held in the page's slot. @pre it is no frame that failed
  void release(std::uint32_t reader, std::uint32_t page) noexcept;
  /// Whether a page is ready or on its way, as far as can be told without the lock.
  [[nodiscard]] bool present(std::uint32_t page) const noexcept {
    return frame_of_[page].load(std::memory_order_relaxed) != kNoFrame;
  }

  /// Frame of a page that is loading or ready, which the reader holds from now on; else kNoFrame.
  [[nodiscard]] std::uint32_t join(std::uint32_t reader, std::uint32_t page) noexcept;
  /// A frame for a page that is in none: an empty one, or one that nobody holds. It is loading, and
  /// the reader holds it. @pre readers hold fewer frames than there are
  [[nodiscard]] std::uint32_t claim(std::uint32_t reader, std::uint32_t page) noexcept;
  /// The page has arrived. @pre loading
  void ready(std::uint32_t frame, std::uint32_t bytes, std::uint32_t record_count) noexcept;
  /// The page did not arrive: it can be claimed anew at once; the frame becomes empty when all who
  /// claimed or joined it have left, so that they can read the error. @pre loading
  void fail(std::uint32_t frame, std::exception_ptr error) noexcept;
  /// Lets go of a frame that failed. Each who claimed or joined it does so once.
  void leave(std::uint32_t reader, std::uint32_t frame) noexcept;

  [[nodiscard]] State state(std::uint32_t frame) const noexcept { return frames_[frame].state; }
  /// Of a frame that the caller holds and that is ready, also without the lock.
  [[nodiscard]] std::uint32_t page_bytes(std::uint32_t frame) const noexcept {
    return frames_[frame].bytes;
  }
  [[nodiscard]] std::uint32_t record_count(std::uint32_t frame) const noexcept {
    return frames_[frame].record_count;
  }
  [[nodiscard]] const std::exception_ptr& error(std::uint32_t frame) const noexcept {
    return frames_[frame].error;
  }
  [[nodiscard]] std::uint32_t size() const noexcept {
    return static_cast<std::uint32_t>(frames_.size());
  }
  [[nodiscard]] std::uint64_t evictions() const noexcept { return evictions_; }
  /// Most frames that were not empty at once.
  [[nodiscard]] std::uint32_t peak() const noexcept { return peak_; }

 private:
  /// On frame_of_: the page is on its way into the frame.
  static constexpr std::uint32_t kLoading = 0x80000000;

  struct Frame {
    std::exception_ptr error;
    std::uint32_t page = 0;
    std::uint32_t next_empty = kNoFrame;
    std::uint32_t awaiting = 0;  ///< readers that claimed it or joined while it was loading
    std::uint32_t bytes = 0;
    std::uint32_t record_count = 0;
    State state = State::empty;
  };
  using Held = std::atomic<std::uint32_t>;
  static constexpr std::size_t kApart =
      128 / sizeof(Held);  ///< two readers' slots: cache lines come in pairs

  [[nodiscard]] static std::size_t row(std::size_t slots) noexcept { return slots + kApart; }
  [[nodiscard]] Held& held(std::uint32_t reader, std::uint32_t page) noexcept {
    return held_[reader * row(slots_) + (page & (slots_ - 1))];
  }
  [[nodiscard]] bool is_held(std::uint32_t frame) noexcept;
  [[nodiscard]] bool evict(std::uint32_t frame) noexcept;
  [[nodiscard]] std::uint32_t free_frame() noexcept;

  std::vector<std::atomic<std::uint32_t>> frame_of_;  ///< by page
  std::vector<Frame> frames_;
  std::vector<Held> held_;  ///< a row for each reader
  std::uint32_t readers_;
  std::uint32_t slots_;
  std::unique_ptr<ReplacementOrder> order_;
  std::uint32_t empty_ = kNoFrame;  ///< empty frames that were used before
  std::uint32_t touched_ = 0;       ///< frames from here on were never used
  std::uint32_t used_ = 0;          ///< frames not empty
  std::uint32_t peak_ = 0;
  std::uint64_t evictions_ = 0;
};

}  // namespace ptc
