// The memory and CPU time that this process uses, and large blocks of memory whose resident size
// follows their use.
#pragma once

#include <cstddef>
#include <cstdint>

namespace ptc {

/// Returns the peak resident set of this process so far, bytes (VmHWM).
/// @throws std::system_error when the system does not report it
[[nodiscard]] std::uint64_t peak_resident_bytes();
/// Returns the current resident set of this process, bytes (VmRSS).
/// @throws std::system_error when the system does not report it
[[nodiscard]] std::uint64_t resident_bytes();
/// Returns freed memory from the allocator to the system, because it would otherwise still count as
/// resident. It is called after a stage that needed much memory for a while.
void return_freed_memory() noexcept;
/// Returns the CPU time of this process so far, user and system time of all threads, seconds.
/// @throws std::system_error when the clock cannot be read
[[nodiscard]] double cpu_seconds();

/// A large block of memory straight from the system: zero-filled, page-aligned, and returned to the
/// system when the Arena is destroyed, so that resident memory follows what is in use. A page
/// counts as resident from its first touch. An Arena is movable but not copyable, and empty once
/// moved from.
class Arena {
 public:
  Arena() = default;
  /// Maps a block. No memory is reserved for it, so that a block larger than the machine's memory
  /// is no error as long as it is not used. @throws std::bad_alloc when the system refuses
  explicit Arena(std::size_t bytes);
  ~Arena();
  Arena(Arena&& other) noexcept;
  Arena& operator=(Arena&& other) noexcept;

  /// Returns the whole pages of [offset, offset + bytes) to the system. They are zero when they are
  /// touched again.
  void discard(std::size_t offset, std::size_t bytes) noexcept;

  /// Returns the first byte, or null when the block is empty.
  [[nodiscard]] std::byte* data() const noexcept { return data_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace ptc
