// Pages past the page cache, those expected while others are decoded.
#pragma once

#include <array>

#include <liburing.h>

#include "engine/base/memory.h"
#include "engine/cache/direct_descriptor.h"
#include "engine/cache/page_source.h"

namespace ptc {

/// Direct transfers by io_uring into a ring of slots: what is expected stays in its slot, as it is
/// stored, until it is read or so many others were begun after it.
class UringSource : public PageSource {
 public:
  static constexpr std::size_t kSlots = 32;
  static constexpr std::uint64_t kRingBytes = 16384;  ///< both queues of kSlots, in whole pages

  UringSource(const InputFile& file, std::size_t max_bytes);
  ~UringSource() override;
  UringSource(const UringSource&) = delete;
  UringSource& operator=(const UringSource&) = delete;

  std::span<const std::byte> read(std::uint64_t offset, std::size_t bytes) override;
  void expect(std::uint64_t offset, std::size_t bytes) override;

 private:
  struct Slot {
    DirectRange range;
    std::int64_t got = 0;  ///< bytes of its blocks, or minus an error number
    bool wanted = false;   ///< holds a range that was not read yet
    bool flying = false;   ///< the system may write to it
  };

  [[nodiscard]] Slot* find(std::uint64_t offset) noexcept;
  Slot& begin(std::uint64_t offset, std::size_t bytes);
  void land(const Slot& slot);
  void submit();
  [[nodiscard]] std::byte* blocks_of(const Slot& slot) const noexcept {
    return blocks_.data() + static_cast<std::size_t>(&slot - slots_.data()) * slot_bytes_;
  }

  const InputFile& file_;
  DirectDescriptor direct_;
  std::size_t slot_bytes_;
  Arena blocks_;
  std::array<Slot, kSlots> slots_;
  std::size_t next_ = 0;  ///< slot of the next range
  struct io_uring ring_;
};

}  // namespace ptc
