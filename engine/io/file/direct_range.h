// Blocks of direct transfers (O_DIRECT).
#pragma once

#include <cstddef>
#include <cstdint>

namespace ptc {

/// Memory and offsets of direct transfers are multiples of this.
inline constexpr std::size_t kDirectBytes = 4096;

/// So many bytes up to whole blocks.
[[nodiscard]] constexpr std::size_t direct_blocks(std::size_t bytes) noexcept {
  return (bytes + kDirectBytes - 1) / kDirectBytes * kDirectBytes;
}

/// Room for the blocks of any range of so many bytes.
[[nodiscard]] constexpr std::size_t direct_room(std::size_t bytes) noexcept {
  return direct_blocks(bytes + kDirectBytes - 1);
}

/// The blocks that a range of a file lies in: direct transfers move whole ones.
struct DirectRange {
  DirectRange() = default;
  DirectRange(std::uint64_t from, std::size_t count) noexcept
      : offset(from),
        bytes(count),
        begin(from / kDirectBytes * kDirectBytes),
        lead(static_cast<std::size_t>(from - begin)),
        whole(direct_blocks(lead + count)) {}

  std::uint64_t offset = 0;
  std::size_t bytes = 0;
  std::uint64_t begin = 0;  ///< of the blocks
  std::size_t lead = 0;     ///< from there to `offset`
  std::size_t whole = 0;    ///< bytes of the blocks
};

}  // namespace ptc
