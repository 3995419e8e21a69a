// How stored pages come from the file into memory: four back ends behind one interface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/io/file/file.h"

namespace ptc {

/// pread: through the system's page cache. mmap: decoded where the system has mapped the file; a
/// file that shrinks, or a disk that fails, raises SIGBUS instead of an exception: for local files
/// that nobody changes. direct: past the page cache (O_DIRECT), which neither keeps nor copies what
/// is read once. io_uring: past it too, with what is expected on its way while other pages are
/// decoded.
enum class BackEnd { pread, mmap, direct, io_uring };

/// One thread's way to ranges of a file.
class PageSource {
 public:
  virtual ~PageSource() = default;
  /// @return  the bytes, valid until the next call of this source
  /// @throws DataError when the file ends before, std::system_error when it cannot be read
  [[nodiscard]] virtual std::span<const std::byte> read(std::uint64_t offset,
                                                        std::size_t bytes) = 0;
  /// This range will be read soon, it seems. Nothing goes wrong when it is not. Only io_uring makes
  /// use of it: the system reads ahead for pread and mmap by itself, as well as when it is told,
  /// and a direct read lasts until its bytes are there.
  virtual void expect(std::uint64_t /*offset*/, std::size_t /*bytes*/) {}
};

/// @param file        outlives the source
/// @param max_bytes  of a range
/// @throws std::system_error when the system or the file system does not have the back end
[[nodiscard]] std::unique_ptr<PageSource> make_page_source(BackEnd back_end, const InputFile& file,
                                                           std::size_t max_bytes);

/// Memory that a source takes.
[[nodiscard]] std::uint64_t page_source_bytes(BackEnd back_end, std::size_t max_bytes) noexcept;

}  // namespace ptc
