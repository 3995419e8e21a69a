// Memory of this process: what it uses, and large blocks that follow what is in use.
#pragma once

#include <cstddef>
#include <cstdint>

namespace ptc {

/// Peak resident set of this process so far, bytes (VmHWM).
/// @throws std::system_error when the system does not say
[[nodiscard]] std::uint64_t peak_resident_bytes();
/// Resident set now, bytes (VmRSS).
/// @throws std::system_error when the system does not say
[[nodiscard]] std::uint64_t resident_bytes();
/// Gives memory that was freed back to the system, which would else count as resident: after a
/// stage that took much for a while.
void return_freed_memory() noexcept;
/// CPU time of this process so far, all threads, user and system, seconds.
[[nodiscard]] double cpu_seconds();

/// A large block straight from the system: zero-filled, page-aligned, given back at once when it
/// ends, so that resident memory follows what is in use. Pages count as resident from the first
/// touch on. Movable, not copyable; empty when moved from.
class Arena {
 public:
  Arena() = default;
  /// @throws std::bad_alloc
  explicit Arena(std::size_t bytes);
  ~Arena();
  Arena(Arena&& other) noexcept;
  Arena& operator=(Arena&& other) noexcept;

  /// Gives back the whole pages of [offset, offset + bytes); they are zero when touched again.
  void discard(std::size_t offset, std::size_t bytes) noexcept;

  [[nodiscard]] std::byte* data() const noexcept { return data_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace ptc
