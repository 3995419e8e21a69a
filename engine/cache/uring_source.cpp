// Slots are used in turn, and each transfer carries the address of its slot, so that completions
// may arrive in any order:
//
//   slots    | read | wanted, landed | wanted, flying | flying | ... |
//              ^ next_: the next transfer waits for the one that flies here, if any
#include "engine/cache/uring_source.h"

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <string>
#include <system_error>

namespace ptc {
namespace {

void check(int result, const char* call, const InputFile& file) {
  if (result < 0)
    throw std::system_error(-result, std::generic_category(),
                            call + (" for " + file.path().string()));
}

}  // namespace

UringSource::UringSource(const InputFile& file, std::size_t max_bytes)
    : file_(file),
      direct_(file),
      slot_bytes_(direct_room(max_bytes)),
      blocks_(kSlots * slot_bytes_) {
  check(io_uring_queue_init(kSlots, &ring_, 0), "io_uring_setup", file);
}

// The system may write to the slots until their transfers have ended.
UringSource::~UringSource() {
  try {
    for (const Slot& slot : slots_) land(slot);
  } catch (const std::system_error&) {  // the wait failed, and a destructor cannot report it
  }
  io_uring_queue_exit(&ring_);
}

std::span<const std::byte> UringSource::read(std::uint64_t offset, std::size_t bytes) {
  // Take the slot in which the range is expected, or begin its transfer now. Hand over all
  // transfers that were begun, in one system call.
  Slot* const expected = find(offset);
  Slot& slot = expected ? *expected : begin(offset, bytes);
  submit();
  land(slot);
  slot.wanted = false;
  return complete(slot.range, blocks_of(slot), slot.got, file_);
}

void UringSource::expect(std::uint64_t offset, std::size_t bytes) {
  if (find(offset) == nullptr) begin(offset, bytes);
}

UringSource::Slot* UringSource::find(std::uint64_t offset) noexcept {
  const auto found = std::ranges::find_if(
      slots_, [&](const Slot& slot) { return slot.wanted && slot.range.offset == offset; });
  return found == slots_.end() ? nullptr : &*found;
}

UringSource::Slot& UringSource::begin(std::uint64_t offset, std::size_t bytes) {
  Slot& slot = slots_[next_];
  next_ = (next_ + 1) % kSlots;
  land(slot);
  io_uring_sqe* const entry = io_uring_get_sqe(&ring_);
  assert(entry != nullptr);  // the queue has an entry for each slot
  slot = {.range = {offset, bytes}, .wanted = true, .flying = true};
  io_uring_prep_read(entry, direct_.get(), blocks_of(slot), static_cast<unsigned>(slot.range.whole),
                     slot.range.begin);
  io_uring_sqe_set_data(entry, &slot);
  return slot;
}

void UringSource::submit() {
  if (io_uring_sq_ready(&ring_) == 0) return;
  int result = io_uring_submit(&ring_);
  while (result == -EINTR) result = io_uring_submit(&ring_);
  check(result, "io_uring_enter", file_);
}

void UringSource::land(const Slot& slot) {
  while (slot.flying) {
    submit();
    // Wait for any transfer, which may be that of another slot, and note how it ended.
    io_uring_cqe* done = nullptr;
    const int result = io_uring_wait_cqe(&ring_, &done);
    if (result == -EINTR) continue;
    check(result, "io_uring_enter", file_);
    auto* const landed = static_cast<Slot*>(io_uring_cqe_get_data(done));
    landed->got = done->res;
    landed->flying = false;
    io_uring_cqe_seen(&ring_, done);
  }
}

}  // namespace ptc
