// Reading a file past the system's page cache.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/io/file/direct_range.h"
#include "engine/io/file/file.h"

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

/// A range, when so many bytes of its blocks have been read. What a transfer left out, as at the
/// end of the file or after an error, is read through the page cache, which tells what is wrong, if
/// anything is.
/// @param blocks  where they were read to
[[nodiscard]] inline std::span<const std::byte> complete(const DirectRange& range,
                                                         std::byte* blocks, std::int64_t got,
                                                         const InputFile& file) {
  const std::span<std::byte> bytes(blocks + range.lead, range.bytes);
  if (got < static_cast<std::int64_t>(range.lead + range.bytes)) file.read_at(range.offset, bytes);
  return bytes;
}

}  // namespace ptc
