// Which page each frame holds, who uses it, and in which order unused pages leave.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <vector>

namespace ptc {

inline constexpr std::uint32_t kNoFrame = 0xffffffff;

/// The bookkeeping of a cache without its bytes, threads or I/O.
///
///              claim              ready           last unpin
///   (empty) ----------> loading ----------> ready -----------> ready, in the LRU list
///      ^                   | fail             ^    pin (find)       |
///      |   last unpin      v                  +---------------------+  claim takes the oldest:
///      +--------------- failed                                         evicted, loading again
///
/// A page is in the table while it is loading or ready. Threads: the caller holds a lock.
class FrameTable {
 public:
  enum class State : std::uint8_t { empty, loading, ready, failed };

  FrameTable(std::uint32_t pages, std::uint32_t frames);

  /// Bytes that the tables take for so many pages and frames.
  [[nodiscard]] static std::uint64_t bytes(std::uint64_t pages, std::uint64_t frames) noexcept;

  /// Frame of a page that is loading or ready, else kNoFrame.
  [[nodiscard]] std::uint32_t find(std::uint32_t page) const noexcept { return frame_of_[page]; }
  /// A frame for a page that is in none: an empty one, or that of the page unpinned longest ago.
  /// It is loading and pinned once. @pre a frame is empty or unpinned
  std::uint32_t claim(std::uint32_t page) noexcept;
  void pin(std::uint32_t frame) noexcept;
  void unpin(std::uint32_t frame) noexcept;
  /// The page has arrived. @pre loading
  void ready(std::uint32_t frame, std::uint32_t bytes, std::uint32_t record_count) noexcept;
  /// The page did not arrive: it leaves the table at once, the frame becomes empty with its last
  /// pin, so that all who waited for it can read the error. @pre loading
  void fail(std::uint32_t frame, std::exception_ptr error) noexcept;

  [[nodiscard]] State state(std::uint32_t frame) const noexcept { return frames_[frame].state; }
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
  struct Frame {
    std::exception_ptr error;
    std::uint32_t page = 0;
    std::uint32_t pins = 0;
    std::uint32_t older =
        kNoFrame;  ///< neighbours in the LRU list; `newer` also links empty frames
    std::uint32_t newer = kNoFrame;
    std::uint32_t bytes = 0;
    std::uint32_t record_count = 0;
    State state = State::empty;
  };

  void append_newest(std::uint32_t frame) noexcept;
  void unlink(std::uint32_t frame) noexcept;

  std::vector<std::uint32_t> frame_of_;  ///< by page
  std::vector<Frame> frames_;
  std::uint32_t oldest_ = kNoFrame;  ///< of the ready frames without pins
  std::uint32_t newest_ = kNoFrame;
  std::uint32_t empty_ = kNoFrame;  ///< empty frames that were used before
  std::uint32_t touched_ = 0;       ///< frames from here on were never used
  std::uint32_t used_ = 0;          ///< frames not empty
  std::uint32_t peak_ = 0;
  std::uint64_t evictions_ = 0;
};

}  // namespace ptc
