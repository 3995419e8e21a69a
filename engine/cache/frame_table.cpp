// The LRU list runs through the frames themselves: no operation allocates.
#include "engine/cache/frame_table.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace ptc {

FrameTable::FrameTable(std::uint32_t pages, std::uint32_t frames)
    : frame_of_(pages, kNoFrame), frames_(frames) {}

std::uint64_t FrameTable::bytes(std::uint64_t pages, std::uint64_t frames) noexcept {
  return pages * sizeof(std::uint32_t) + frames * sizeof(Frame);
}

void FrameTable::append_newest(std::uint32_t frame) noexcept {
  frames_[frame].older = newest_;
  frames_[frame].newer = kNoFrame;
  (newest_ == kNoFrame ? oldest_ : frames_[newest_].newer) = frame;
  newest_ = frame;
}

void FrameTable::unlink(std::uint32_t frame) noexcept {
  const Frame& f = frames_[frame];
  (f.older == kNoFrame ? oldest_ : frames_[f.older].newer) = f.newer;
  (f.newer == kNoFrame ? newest_ : frames_[f.newer].older) = f.older;
}

std::uint32_t FrameTable::claim(std::uint32_t page) noexcept {
  assert(frame_of_[page] == kNoFrame);
  std::uint32_t frame = kNoFrame;
  if (empty_ != kNoFrame) {
    frame = std::exchange(empty_, frames_[empty_].newer);
    ++used_;
  } else if (touched_ < frames_.size()) {
    frame = touched_++;
    ++used_;
  } else {
    frame = oldest_;
    assert(frame != kNoFrame && frames_[frame].pins == 0);
    unlink(frame);
    frame_of_[frames_[frame].page] = kNoFrame;
    ++evictions_;
  }
  peak_ = std::max(peak_, used_);
  Frame& f = frames_[frame];
  f.page = page;
  f.pins = 1;
  f.state = State::loading;
  frame_of_[page] = frame;
  return frame;
}

void FrameTable::pin(std::uint32_t frame) noexcept {
  Frame& f = frames_[frame];
  if (f.pins++ == 0) unlink(frame);
}

void FrameTable::unpin(std::uint32_t frame) noexcept {
  Frame& f = frames_[frame];
  assert(f.pins > 0);
  if (--f.pins > 0) return;
  if (f.state == State::ready) return append_newest(frame);
  assert(f.state == State::failed);
  f.error = nullptr;
  f.state = State::empty;
  f.newer = std::exchange(empty_, frame);
  --used_;
}

void FrameTable::ready(std::uint32_t frame, std::uint32_t bytes,
                       std::uint32_t record_count) noexcept {
  Frame& f = frames_[frame];
  assert(f.state == State::loading);
  f.bytes = bytes;
  f.record_count = record_count;
  f.state = State::ready;
}

void FrameTable::fail(std::uint32_t frame, std::exception_ptr error) noexcept {
  Frame& f = frames_[frame];
  assert(f.state == State::loading);
  f.error = std::move(error);
  f.state = State::failed;
  frame_of_[f.page] = kNoFrame;
}

}  // namespace ptc
