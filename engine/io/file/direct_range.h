// The blocks of direct transfers (O_DIRECT), which move only whole blocks.
//
//   file    |        |        |        |        |      blocks of 4096 bytes
//                         [offset, + bytes)            the range that is wanted
//                    |<--- whole --->|                 begin to begin + whole is transferred
//                    |lead|
#pragma once

#include <cstddef>
#include <cstdint>

namespace ptc {

/// The size of a block, to which the memory, offsets and lengths of direct transfers are aligned.
inline constexpr std::size_t kDirectBytes = 4096;

/// Rounds a number of bytes up to whole blocks.
[[nodiscard]] constexpr std::size_t direct_blocks(std::size_t bytes) noexcept {
  return (bytes + kDirectBytes - 1) / kDirectBytes * kDirectBytes;
}

/// Returns the bytes that the blocks of any range of `bytes` bytes take at most, wherever the range
/// begins.
[[nodiscard]] constexpr std::size_t direct_room(std::size_t bytes) noexcept {
  return direct_blocks(bytes + kDirectBytes - 1);
}

/// A range of a file and the blocks in which it lies.
struct DirectRange {
  DirectRange() = default;
  /// Finds the blocks of `count` bytes that start at `from`.
  DirectRange(std::uint64_t from, std::size_t count) noexcept
      : offset(from),
        bytes(count),
        begin(from / kDirectBytes * kDirectBytes),
        lead(static_cast<std::size_t>(from - begin)),
        whole(direct_blocks(lead + count)) {}

  std::uint64_t offset = 0;  ///< first byte of the range in the file
  std::size_t bytes = 0;     ///< length of the range
  std::uint64_t begin = 0;   ///< first byte of the blocks in the file
  std::size_t lead = 0;      ///< bytes from `begin` to `offset`
  std::size_t whole = 0;     ///< length of the blocks
};

}  // namespace ptc
