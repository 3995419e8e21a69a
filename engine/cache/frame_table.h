// Records which page each frame of a cache holds, and which readers hold that frame.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <vector>

#include "engine/cache/replacement.h"

namespace ptc {

/// The frame of a page that is in no frame.
inline constexpr std::uint32_t kNoFrame = 0xffffffff;

/// The bookkeeping of a cache without its bytes, locks or I/O.
///
///              claim              ready              claim takes what
///   (empty) ----------> loading ----------> ready    nobody holds: evicted, loading again
///      ^                   | fail
///      |   last leave      v
///      +--------------- failed
///
/// Each reader has a power of two of slots. A page p that it holds is recorded in slot p mod slots,
/// so one look at each reader finds all holders of a frame. hold() finds a page that is ready
/// without a lock and without a write to memory that readers share:
///
///   hold()                          claim(), of a page in frame f
///   held = f                        frame of the page = none
///   is it still the page's frame?   does anyone hold f?
///
/// Each of them stores first and looks then, in one order for all threads (seq_cst), so at least
/// one of the two sees the other.
///
/// Threads: each reader may call hold() and release() for itself at any time; all other functions
/// need the caller's lock.
class FrameTable {
 public:
  /// What a frame is doing; see the picture above.
  enum class State : std::uint8_t { empty, loading, ready, failed };
  /// The sizes of a table.
  struct Layout {
    std::uint32_t pages = 0;    ///< pages of the container
    std::uint32_t frames = 0;   ///< frames of the cache
    std::uint32_t readers = 0;  ///< readers that may exist at the same time
    std::uint32_t slots = 0;    ///< slots of each reader, a power of two
  };

  FrameTable(const Layout& layout, Replacement replacement);

  /// Returns the memory that a table of these sizes takes, bytes.
  [[nodiscard]] static std::uint64_t bytes(std::uint64_t pages, std::uint64_t frames,
                                           std::uint64_t readers, std::uint64_t slots) noexcept;

  /// Holds the frame of a page that is ready, in place of the frame that the page's slot held.
  /// @return  the frame; kNoFrame when the page is not ready, and the slot then holds nothing
  [[nodiscard]] std::uint32_t hold(std::uint32_t reader, std::uint32_t page) noexcept;
  /// Releases the frame that the page's slot holds. @pre the frame has not failed
  void release(std::uint32_t reader, std::uint32_t page) noexcept;
  /// Returns whether a page is loading or ready. Without the lock the answer is only a hint.
  [[nodiscard]] bool present(std::uint32_t page) const noexcept {
    return frame_of_[page].load(std::memory_order_relaxed) != kNoFrame;
  }

  /// Holds the frame of a page that is loading or ready, for the reader.
  /// @return  the frame; kNoFrame when the page is in no frame
  [[nodiscard]] std::uint32_t join(std::uint32_t reader, std::uint32_t page) noexcept;
  /// Takes a frame for a page that is in none: an empty frame, or one whose page nobody holds,
  /// which is evicted. The frame is then loading, and the reader holds it.
  /// @pre readers hold fewer frames than there are
  [[nodiscard]] std::uint32_t claim(std::uint32_t reader, std::uint32_t page) noexcept;
  /// Marks a frame as ready, after its page was read. @pre the frame is loading
  /// @param bytes  size of the decoded payload
  void ready(std::uint32_t frame, std::uint32_t bytes, std::uint32_t record_count) noexcept;
  /// Marks a frame as failed, after its page could not be read. The page can be claimed again at
  /// once. The frame keeps the error, and becomes empty when every reader that claimed or joined it
  /// has left. @pre the frame is loading
  void fail(std::uint32_t frame, std::exception_ptr error) noexcept;
  /// Releases a frame that failed. Each reader that claimed or joined it must call this once.
  void leave(std::uint32_t reader, std::uint32_t frame) noexcept;

  [[nodiscard]] State state(std::uint32_t frame) const noexcept { return frames_[frame].state; }
  /// Returns the payload size of a ready frame that the caller holds; needs no lock.
  [[nodiscard]] std::uint32_t page_bytes(std::uint32_t frame) const noexcept {
    return frames_[frame].bytes;
  }
  /// Returns the number of records of a ready frame that the caller holds; needs no lock.
  [[nodiscard]] std::uint32_t record_count(std::uint32_t frame) const noexcept {
    return frames_[frame].record_count;
  }
  /// Returns the error of a frame that failed.
  [[nodiscard]] const std::exception_ptr& error(std::uint32_t frame) const noexcept {
    return frames_[frame].error;
  }
  /// Returns the number of frames.
  [[nodiscard]] std::uint32_t size() const noexcept {
    return static_cast<std::uint32_t>(frames_.size());
  }
  /// Returns the number of pages evicted so far.
  [[nodiscard]] std::uint64_t evictions() const noexcept { return evictions_; }
  /// Returns the greatest number of frames that were in use at the same time.
  [[nodiscard]] std::uint32_t peak() const noexcept { return peak_; }

 private:
  /// Flag on an entry of frame_of_: the page is loading into that frame.
  static constexpr std::uint32_t kLoading = 0x80000000;

  struct Frame {
    std::exception_ptr error;
    std::uint32_t page = 0;
    std::uint32_t next_empty = kNoFrame;  ///< link of the list that empty_ begins
    std::uint32_t awaiting = 0;  ///< readers that claimed the frame or joined while it was loading
    std::uint32_t bytes = 0;
    std::uint32_t record_count = 0;
    State state = State::empty;
  };
  using Held = std::atomic<std::uint32_t>;
  /// Gap between the slots of two readers, in slots: processors fetch cache lines in pairs.
  static constexpr std::size_t kApart = 128 / sizeof(Held);

  [[nodiscard]] static std::size_t row(std::size_t slots) noexcept { return slots + kApart; }
  [[nodiscard]] Held& held(std::uint32_t reader, std::uint32_t page) noexcept {
    return held_[reader * row(slots_) + (page & (slots_ - 1))];
  }
  [[nodiscard]] bool is_held(std::uint32_t frame) noexcept;
  [[nodiscard]] bool evict(std::uint32_t frame) noexcept;
  [[nodiscard]] std::uint32_t free_frame() noexcept;

  std::vector<std::atomic<std::uint32_t>> frame_of_;  ///< by page: its frame, or kNoFrame
  std::vector<Frame> frames_;
  std::vector<Held> held_;  ///< a row of slots for each reader, which hold frame numbers
  std::uint32_t readers_;
  std::uint32_t slots_;
  std::unique_ptr<ReplacementOrder> order_;
  std::uint32_t empty_ = kNoFrame;  ///< first of the empty frames that were used before
  std::uint32_t touched_ = 0;       ///< frames from this one on were never used
  std::uint32_t used_ = 0;          ///< frames that are not empty
  std::uint32_t peak_ = 0;
  std::uint64_t evictions_ = 0;
};

}  // namespace ptc
