// Direct reads of a file, which bypass the system's page cache.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/io/file/direct_range.h"
#include "engine/io/file/file.h"

namespace ptc {

/// A second descriptor of an open file, for direct transfers (O_DIRECT). Closed with this object.
class DirectDescriptor {
 public:
  /// @throws std::system_error when the file system does not support direct transfers
  explicit DirectDescriptor(const InputFile& file);
  ~DirectDescriptor();
  DirectDescriptor(const DirectDescriptor&) = delete;
  DirectDescriptor& operator=(const DirectDescriptor&) = delete;

  [[nodiscard]] int get() const noexcept { return fd_; }

 private:
  int fd_;
};

/// Returns the bytes of a range after a direct transfer of its blocks. If the transfer fell short,
/// at the end of the file or by an error, the range is read again through the page cache, which
/// reports what is wrong if anything is.
/// @param blocks  memory that the blocks were read into; the result points into it
/// @param got     bytes that the transfer delivered; negative after an error
/// @throws DataError when the file ends within the range, std::system_error
[[nodiscard]] inline std::span<const std::byte> complete(const DirectRange& range,
                                                         std::byte* blocks, std::int64_t got,
                                                         const InputFile& file) {
  const std::span<std::byte> bytes(blocks + range.lead, range.bytes);
  if (got < static_cast<std::int64_t>(range.lead + range.bytes)) file.read_at(range.offset, bytes);
  return bytes;
}

}  // namespace ptc
