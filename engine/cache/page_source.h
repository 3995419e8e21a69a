// Reads stored pages from the file into memory, by one of four back ends behind one interface.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/io/file/file.h"
#include "engine/store/reader.h"

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

/// The sources of one thread for the files of a container: the scene's own file and those of its
/// parts. At most kOpen are open at a time, because pages that are needed together lie in few
/// parts.
class PageSources {
 public:
  static constexpr std::size_t kOpen = 4;

  /// Opens the source of the container's own file.
  /// @param container  must outlive this
  /// @param max_bytes  size of the largest range
  /// @throws std::system_error as make_page_source()
  PageSources(BackEnd back_end, const ContainerReader& container, std::size_t max_bytes);

  /// Returns the source of a file, as ContainerReader::PageRange::part counts them. It is valid
  /// until the next call.
  /// @throws std::system_error as make_page_source()
  [[nodiscard]] PageSource& of(std::uint32_t part);

  /// Returns the number of sources that may be open at once.
  [[nodiscard]] static std::size_t most(const ContainerReader& container) noexcept {
    return std::min(kOpen, 1 + container.parts().size());
  }

 private:
  struct Open {
    std::uint32_t part = 0;
    std::unique_ptr<PageSource> source;
  };
  BackEnd back_end_;
  const ContainerReader& container_;
  std::size_t max_bytes_;
  std::array<Open, kOpen> open_;
  std::size_t next_ = 0;  ///< the one that the next file replaces
};

/// Returns the memory that a source takes, bytes.
[[nodiscard]] std::uint64_t page_source_bytes(BackEnd back_end, std::size_t max_bytes) noexcept;

}  // namespace ptc
