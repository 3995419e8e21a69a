// The transitions of frames, and the one race between them: a reader holds a frame without the lock
// while another evicts it. Each side announces itself first and then looks for the other, so that
// at least one of them backs off (engine/cache/frame_table.h).
#include "engine/cache/frame_table.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace ptc {

FrameTable::FrameTable(const Layout& layout, Replacement replacement)
    : frame_of_(layout.pages),
      frames_(layout.frames),
      held_(layout.readers * row(layout.slots)),
      readers_(layout.readers),
      slots_(layout.slots),
      order_(make_replacement_order(replacement, layout.frames)) {
  for (auto& frame : frame_of_) frame.store(kNoFrame, std::memory_order_relaxed);
  for (Held& frame : held_) frame.store(kNoFrame, std::memory_order_relaxed);
}

std::uint64_t FrameTable::bytes(std::uint64_t pages, std::uint64_t frames, std::uint64_t readers,
                                std::uint64_t slots) noexcept {
  return pages * sizeof(std::uint32_t) + frames * (sizeof(Frame) + kReplacementBytes) +
         readers * row(slots) * sizeof(Held);
}

std::uint32_t FrameTable::hold(std::uint32_t reader, std::uint32_t page) noexcept {
  Held& slot = held(reader, page);
  const std::uint32_t frame = frame_of_[page].load(std::memory_order_relaxed);
  if ((frame & kLoading) == 0) {  // kNoFrame has that bit too
    // Announce the hold, then check that the frame was not evicted meanwhile.
    slot.store(frame, std::memory_order_seq_cst);
    if (frame_of_[page].load(std::memory_order_seq_cst) == frame) {
      order_->touch(frame);
      return frame;
    }
  }
  slot.store(kNoFrame, std::memory_order_release);
  return kNoFrame;
}

void FrameTable::release(std::uint32_t reader, std::uint32_t page) noexcept {
  held(reader, page).store(kNoFrame, std::memory_order_release);
}

std::uint32_t FrameTable::join(std::uint32_t reader, std::uint32_t page) noexcept {
  const std::uint32_t found = frame_of_[page].load(std::memory_order_relaxed);
  if (found == kNoFrame) return kNoFrame;
  const std::uint32_t frame = found & ~kLoading;
  held(reader, page).store(frame, std::memory_order_relaxed);
  if (frame == found) {
    order_->touch(frame);
  } else {
    ++frames_[frame].awaiting;
  }
  return frame;
}

bool FrameTable::is_held(std::uint32_t frame) noexcept {
  for (std::uint32_t reader = 0; reader < readers_; ++reader) {
    if (held(reader, frames_[frame].page).load(std::memory_order_seq_cst) == frame) return true;
  }
  return false;
}

bool FrameTable::evict(std::uint32_t frame) noexcept {
  // Announce the eviction, then check that no reader holds the frame.
  std::atomic<std::uint32_t>& frame_of_page = frame_of_[frames_[frame].page];
  frame_of_page.store(kNoFrame, std::memory_order_seq_cst);
  if (is_held(frame)) {
    frame_of_page.store(frame, std::memory_order_release);
    return false;
  }
  order_->erase(frame);
  ++evictions_;
  return true;
}

std::uint32_t FrameTable::free_frame() noexcept {
  // Prefer an empty frame: one that was used before, whose memory is resident, to a new one.
  if (empty_ != kNoFrame || touched_ < frames_.size()) {
    peak_ = std::max(peak_, ++used_);
    return empty_ != kNoFrame ? std::exchange(empty_, frames_[empty_].next_empty) : touched_++;
  }
  // Evict the first candidate that no reader holds. There is one, because readers hold fewer frames
  // than there are.
  std::uint32_t frame = order_->candidate();
  while (!evict(frame)) frame = order_->candidate();
  return frame;
}

std::uint32_t FrameTable::claim(std::uint32_t reader, std::uint32_t page) noexcept {
  assert(!present(page));
  const std::uint32_t frame = free_frame();
  frames_[frame].page = page;
  frames_[frame].awaiting = 1;
  frames_[frame].state = State::loading;
  held(reader, page).store(frame, std::memory_order_relaxed);
  frame_of_[page].store(frame | kLoading, std::memory_order_relaxed);
  return frame;
}

void FrameTable::ready(std::uint32_t frame, std::uint32_t bytes,
                       std::uint32_t record_count) noexcept {
  Frame& f = frames_[frame];
  assert(f.state == State::loading);
  f.bytes = bytes;
  f.record_count = record_count;
  f.state = State::ready;
  order_->insert(frame);
  frame_of_[f.page].store(frame, std::memory_order_release);
}

void FrameTable::fail(std::uint32_t frame, std::exception_ptr error) noexcept {
  Frame& f = frames_[frame];
  assert(f.state == State::loading);
  f.error = std::move(error);
  f.state = State::failed;
  frame_of_[f.page].store(kNoFrame, std::memory_order_relaxed);
}

void FrameTable::leave(std::uint32_t reader, std::uint32_t frame) noexcept {
  Frame& f = frames_[frame];
  assert(f.state == State::failed);
  release(reader, f.page);
  if (--f.awaiting > 0) return;
  f.error = nullptr;
  f.state = State::empty;
  f.next_empty = std::exchange(empty_, frame);
  --used_;
}

}  // namespace ptc
