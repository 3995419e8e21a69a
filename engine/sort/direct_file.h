// A temporary file that is read and written past the page cache.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "engine/io/file/direct_range.h"
#include "engine/io/file/file.h"

namespace ptc {

/// A file for spilled data. A file without a name vanishes when it is closed; a named one stays.
///
/// It bypasses the page cache (O_DIRECT) where the file system supports that: spilled data is read
/// once, long after it was written, and caching it would cost a copy, a fresh page for every 4 KiB,
/// and the memory that the cap is meant to save. Elsewhere it uses the page cache.
/// Threads: read_at() and write_at() may be called concurrently.
class DirectFile {
 public:
  /// Creates a file without a name in a directory.
  /// @throws std::system_error naming the directory
  explicit DirectFile(const std::filesystem::path& directory);
  /// Whether a named file is created (an existing one is truncated), created and must not exist, or
  /// must exist.
  enum class Kept { made, fresh, found };
  /// Opens a named file, which stays when it is closed.
  /// @throws std::system_error naming the file
  DirectFile(const std::filesystem::path& file, Kept how);
  ~DirectFile();
  DirectFile(const DirectFile&) = delete;
  DirectFile& operator=(const DirectFile&) = delete;

  /// Reads all of `bytes` from an offset. Offset, address and size should be multiples of
  /// kDirectBytes; if they are not, or if the file system refuses them, the file uses the page
  /// cache from then on.
  /// @throws std::system_error naming the directory or the file; DataError when the file ends
  ///         within the range
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// Writes all of `bytes` at an offset. Alignment matters as for read_at().
  /// @throws std::system_error naming the directory or the file
  void write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Flushes everything written so far to stable storage. @pre the file has a name
  void sync();
  /// Gives the disk blocks of a range back, as TempFile::discard() does. Their bytes are lost.
  void discard(std::uint64_t offset, std::uint64_t bytes) const noexcept;

 private:
  /// Turns direct transfers off after one failed. Returns whether the transfer should be tried
  /// again through the page cache.
  bool give_up_direct(bool was_direct) const noexcept;

  std::string name_;  ///< names the file in errors
  int fd_ = -1;       ///< -1: buffered_ is used instead
  mutable std::atomic<bool> direct_{true};
  std::optional<TempFile> buffered_;
};

}  // namespace ptc
