// A temporary file past the page cache.
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

/// A file in a directory that vanishes when it is closed unless it has a name, read and written
/// without the page cache (O_DIRECT) where the file system can do so: what is spilled is read once,
/// long after, and the cache would cost a copy, a fresh page for every 4 KiB and the memory that
/// the cap is to save. Elsewhere it is a TempFile. Threads: read_at and write_at may be called
/// concurrently.
class DirectFile {
 public:
  /// @throws std::system_error naming the directory
  explicit DirectFile(const std::filesystem::path& directory);
  /// A file with a name, which stays: made anew, or the one that is there.
  enum class Kept { made, found };
  DirectFile(const std::filesystem::path& file, Kept how);
  ~DirectFile();
  DirectFile(const DirectFile&) = delete;
  DirectFile& operator=(const DirectFile&) = delete;

  /// Offset, address and size should be multiples of kDirectBytes: if they are not, or the file
  /// system does not like them, the file gives up direct transfers for good.
  /// @throws std::system_error naming the directory; DataError when the file ends before
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const;
  void write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Of a file with a name: what was written is on the disk when it returns.
  void sync();
  /// As TempFile::discard().
  void discard(std::uint64_t offset, std::uint64_t bytes) const noexcept;

 private:
  // True when a transfer that failed is worth another try, now through the page cache.
  bool give_up_direct(bool was_direct) const noexcept;

  std::string name_;  ///< for errors
  int fd_ = -1;       // -1: buffered_ instead
  mutable std::atomic<bool> direct_{true};
  std::optional<TempFile> buffered_;
};

}  // namespace ptc
