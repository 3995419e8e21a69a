// Reads pages past the page cache, expected ones in the background while others are decoded.
#pragma once

#include <array>

#include <liburing.h>

#include "engine/base/memory.h"
#include "engine/cache/direct_descriptor.h"
#include "engine/cache/page_source.h"

namespace ptc {

/// Direct transfers by io_uring into a ring of slots. An expected range stays in its slot, as it is
/// stored, until it is read or until kSlots transfers were begun after it.
class UringSource : public PageSource {
 public:
  static constexpr std::size_t kSlots = 32;           ///< transfers that may be under way at once
  static constexpr std::uint64_t kRingBytes = 16384;  ///< memory of both queues of kSlots entries

  /// @param file       must outlive the source
  /// @param max_bytes  size of the largest range
  /// @throws std::system_error when the system or the file system does not support the back end
  UringSource(const InputFile& file, std::size_t max_bytes);
  /// Waits for all transfers.
  ~UringSource() override;
  UringSource(const UringSource&) = delete;
  UringSource& operator=(const UringSource&) = delete;

  std::span<const std::byte> read(std::uint64_t offset, std::size_t bytes) override;
  void expect(std::uint64_t offset, std::size_t bytes) override;

 private:
  struct Slot {
    DirectRange range;
    std::int64_t got = 0;  ///< bytes that the transfer delivered, or a negative error number
    bool wanted = false;   ///< holds a range that was not read yet
    bool flying = false;   ///< the transfer is under way: the system may write to the slot
  };

  /// Returns the slot of an expected range; null when there is none.
  [[nodiscard]] Slot* find(std::uint64_t offset) noexcept;
  /// Begins a transfer in the next slot, once the transfer there has ended. submit() hands it to
  /// the system.
  Slot& begin(std::uint64_t offset, std::size_t bytes);
  /// Waits for the transfer of a slot.
  void land(const Slot& slot);
  /// Hands all transfers that were begun to the system.
  void submit();
  [[nodiscard]] std::byte* blocks_of(const Slot& slot) const noexcept {
    return blocks_.data() + static_cast<std::size_t>(&slot - slots_.data()) * slot_bytes_;
  }

  const InputFile& file_;
  DirectDescriptor direct_;
  std::size_t slot_bytes_;
  Arena blocks_;
  std::array<Slot, kSlots> slots_;
  std::size_t next_ = 0;  ///< slot that the next transfer takes
  struct io_uring ring_;
};

}  // namespace ptc
