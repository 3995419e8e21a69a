// Reads stored pages from the file into memory, by one of four back ends behind one interface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/io/file/file.h"

namespace ptc {

/// How a file is read.
enum class BackEnd {
  pread,  ///< through the system's page cache
  mmap,   ///< decoded in place from a mapping of the file. A file that shrinks or a disk that fails
          ///< raises SIGBUS instead of an exception: only for local files that nobody changes
  direct,   ///< past the page cache (O_DIRECT), which then neither keeps nor copies what is read
            ///< once
  io_uring  ///< past the page cache, with reads of expected ranges under way while others are
            ///< decoded
};

/// Reads ranges of a file for one thread.
class PageSource {
 public:
  virtual ~PageSource() = default;
  /// Reads a range of the file.
  /// @param bytes  size of the range, at most the `max_bytes` of make_page_source()
  /// @return  the bytes of the range, valid until the next call on this source
  /// @throws DataError when the file ends within the range; std::system_error when it cannot be
  ///         read
  [[nodiscard]] virtual std::span<const std::byte> read(std::uint64_t offset,
                                                        std::size_t bytes) = 0;
  /// Announces that a range will probably be read soon; it need not be. Only io_uring makes use of
  /// it: for pread and mmap the system reads ahead just as well unasked, and a direct read cannot
  /// run in the background.
  virtual void expect(std::uint64_t /*offset*/, std::size_t /*bytes*/) {}
};

/// Returns a source of the given back end.
/// @param file       must outlive the source
/// @param max_bytes  size of the largest range
/// @throws std::system_error when the system or the file system does not support the back end
[[nodiscard]] std::unique_ptr<PageSource> make_page_source(BackEnd back_end, const InputFile& file,
                                                           std::size_t max_bytes);

/// Returns the memory that a source takes, bytes.
[[nodiscard]] std::uint64_t page_source_bytes(BackEnd back_end, std::size_t max_bytes) noexcept;

}  // namespace ptc
