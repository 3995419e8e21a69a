// Reading past the system's page cache.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/memory.h"
#include "engine/io/file.h"

namespace ptc {

/// A descriptor of an open file for direct transfers (O_DIRECT).
class DirectDescriptor {
 public:
  /// @throws std::system_error when the file system has no direct transfers
  explicit DirectDescriptor(const InputFile& file);
  ~DirectDescriptor();
  DirectDescriptor(const DirectDescriptor&) = delete;
  DirectDescriptor& operator=(const DirectDescriptor&) = delete;

  [[nodiscard]] int get() const noexcept { return fd_; }

 private:
  int fd_;
};

/// The blocks that a range of a file lies in: direct transfers move whole ones.
struct DirectRange {
  static constexpr std::size_t kBlock = 4096;
  /// Room for the blocks of any range of so many bytes.
  static constexpr std::size_t room(std::size_t bytes) noexcept { return (bytes + 2 * kBlock - 1) / kBlock * kBlock; }

  DirectRange() = default;
  DirectRange(std::uint64_t from, std::size_t count) noexcept
      : offset(from),
        bytes(count),
        begin(from / kBlock * kBlock),
        lead(static_cast<std::size_t>(from - begin)),
        whole((lead + count + kBlock - 1) / kBlock * kBlock) {}

  std::uint64_t offset = 0;
  std::size_t bytes = 0;
  std::uint64_t begin = 0;  ///< of the blocks
  std::size_t lead = 0;     ///< from there to `offset`
  std::size_t whole = 0;    ///< bytes of the blocks

  /// The range, when so many bytes of its blocks have been read. What a transfer left out, as at the end of the
  /// file or after an error, is read through the page cache, which tells what is wrong, if anything is.
  /// @param blocks  where they were read to
  [[nodiscard]] std::span<const std::byte> complete(std::byte* blocks, std::int64_t got, const InputFile& file) const {
    const std::span<std::byte> range(blocks + lead, bytes);
    if (got < static_cast<std::int64_t>(lead + bytes)) file.read_at(offset, range);
    return range;
  }
};

}  // namespace ptc
