// A file on a server, read in ranges, of which each comes once.
//
//   server           | block | block | block | block | ...
//                            |<----- a request ----->|        what is missing, and some behind it
//   temporary file   | held  |                                each block comes once
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

namespace ptc {

/// A file on a server that is open for reading. Opening asks for its first block, which tells its
/// length.
///
/// What has come is kept in a file without a name, in spool_directory(), so that each block is
/// asked for once while any RemoteFile of its URL is open in the process. What has come of the URL
/// that was opened last is kept until another one is opened. Where that disk has less than 1 GiB
/// left, what is asked for is read from the server each time.
///
/// Requests that fail are sent again as WebServer says; then all further reads of the file fail at
/// once. Each answer must be of the file that was opened: its length and its ETag, or without one
/// its Last-Modified, are compared. Of a server that tells neither, each opening reads anew.
///
/// Threads: read_at() may be called concurrently; threads that need one block share its request.
/// Memory: kMemoryBytes for all files of the process together.
/// Disk: at most the length of the file.
class RemoteFile {
 public:
  static constexpr std::size_t kBlockBytes = std::size_t{1} << 20;
  static constexpr std::size_t kMostAhead = 8;  ///< blocks of one request, where reads follow on
  static constexpr std::uint64_t kMemoryBytes = std::uint64_t{16} << 20;  ///< mostly libcurl's
  static constexpr char kMemory[] = "what comes from servers";            ///< names it in messages

  /// Opens a URL (url.h).
  /// @throws as WebServer::get()
  explicit RemoteFile(const std::string& url);

  /// Returns the length of the file, bytes.
  [[nodiscard]] std::uint64_t size() const noexcept;
  /// Returns what the server tells files of one name apart by: the ETag, or without one
  /// Last-Modified, or nothing.
  [[nodiscard]] const std::string& version() const noexcept;
  /// Fills `out` with the bytes of the file from `offset` on.
  /// @throws DataError when the file ends before `out` is full, or is another one than was opened;
  ///         as WebServer::get()
  void read_at(std::uint64_t offset, std::span<std::byte> out) const;

  /// Returns the directory of what has come: TMPDIR, or without it /var/tmp, which is a disk where
  /// /tmp may be memory.
  [[nodiscard]] static std::filesystem::path spool_directory();

 private:
  class Copy;
  std::shared_ptr<Copy> copy_;
};

}  // namespace ptc
