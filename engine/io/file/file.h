// Files: positioned reads and writes that are whole or throw, and publication by rename.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

namespace ptc {

/// A file open for reading. Threads: read_at may be called concurrently.
class InputFile {
 public:
  /// @throws std::system_error with call and path; a directory is refused (EISDIR), and so is all
  ///         else that is no regular file (ESPIPE)
  explicit InputFile(const std::filesystem::path& path);
  ~InputFile();
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Bytes when the file was opened.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// Fills `out` from `offset` on; EINTR and short reads are retried.
  /// @throws DataError when the file ends before, std::system_error otherwise
  void read_at(std::uint64_t offset, std::span<std::byte> out) const;
  /// Tells the system to begin reading these bytes, which will be asked for soon.
  void read_ahead(std::uint64_t offset, std::uint64_t bytes) const noexcept;

 private:
  std::filesystem::path path_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
};

/// A file being written under a temporary name (".NAME.tmp-PID-N" beside the target) that takes the
/// target's place whole, or is removed: the old file stays until publish() has succeeded.
///
/// A target that is a link to a file stays a link: the file it leads to is replaced. The new file
/// gets the permissions of the old one.
class OutputFile {
 public:
  /// @throws std::system_error; a directory (EISDIR) or device (EINVAL) as target is refused
  explicit OutputFile(const std::filesystem::path& target);
  /// The same under a given name instead of a temporary one: a file of that name is gone on with,
  /// and stays unless it is published. @param partial  in the directory of the target
  OutputFile(const std::filesystem::path& target, const std::filesystem::path& partial);
  /// Removes the temporary file unless it was published.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  [[nodiscard]] const std::filesystem::path& target() const noexcept { return target_; }
  [[nodiscard]] const std::filesystem::path& temporary() const noexcept { return temporary_; }
  /// Threads: may be called concurrently for disjoint ranges.
  void write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Writes at size(). Threads: not while another thread writes.
  void append(std::span<const std::byte> bytes);
  /// End of the farthest write so far.
  [[nodiscard]] std::uint64_t size() const noexcept {
    return size_.load(std::memory_order_relaxed);
  }
  /// Cuts what lies behind.
  void truncate(std::uint64_t bytes);
  /// fdatasync: what was written so far is on the disk when it returns. Threads: while others
  /// write, too.
  void sync();
  /// fsync, rename over the target, fsync of the directory. The file is closed afterwards.
  void publish();

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
  int fd_ = -1;
  std::atomic<std::uint64_t> size_ = 0;
  bool stays_ = false;  ///< under the temporary name
  bool published_ = false;
};

/// A name of a file that goes when this ends, or when what ends the process removes temporaries.
class TemporaryName {
 public:
  explicit TemporaryName(const std::filesystem::path& path);
  ~TemporaryName();
  TemporaryName(const TemporaryName&) = delete;
  TemporaryName& operator=(const TemporaryName&) = delete;
  /// Lets the file stay.
  void release() noexcept;

 private:
  std::filesystem::path path_;
};

/// The directory that a file is in.
[[nodiscard]] std::filesystem::path directory_of(const std::filesystem::path& file);

/// fsync of the directory that a file is in: its name is on the disk.
void sync_directory(const std::filesystem::path& file);

/// Says that a write failed. Where a limit on the size of files (RLIMIT_FSIZE) is the reason, the
/// text names what the file needs and the limit.
///
/// A program under such a limit must ignore SIGXFSZ, which else ends it before a write can fail.
/// @param error  errno   @param end  bytes that the file would have
/// @throws std::system_error
[[noreturn]] void fail_write(int error, const std::filesystem::path& path, std::uint64_t end);

/// open() of a descriptor that programs begun from this one do not get, EINTR retried. @return -1
/// and errno as open()
[[nodiscard]] int open_retrying(const std::filesystem::path& path, int flags,
                                mode_t mode = 0) noexcept;

/// Gives back the disk's blocks under these bytes of an open file, where the file system can.
void discard_blocks(int fd, std::uint64_t offset, std::uint64_t bytes) noexcept;

/// Removes all TemporaryNames and temporary names of OutputFiles, for a process that ends at once:
/// who makes or drops one from now on waits for ever. Allocates nothing.
void remove_temporaries() noexcept;

/// From now on SIGINT, SIGTERM and SIGHUP call remove_temporaries() before they end the process as
/// they would have; a signal that was ignored stays ignored. For programs, once.
void remove_temporaries_on_signal();

/// A nameless file in `directory` that vanishes when it is closed (O_TMPFILE, or unlinked at once).
/// Threads: read_at and write_at may be called concurrently.
class TempFile {
 public:
  /// @throws std::system_error
  explicit TempFile(const std::filesystem::path& directory);
  ~TempFile();
  TempFile(TempFile&& other) noexcept;
  TempFile& operator=(TempFile&&) = delete;

  /// @throws DataError when the file ends before, std::system_error otherwise
  void read_at(std::uint64_t offset, std::span<std::byte> out) const;
  void write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Tells the system that the page cache need not keep what was written or read.
  void drop_cache() const noexcept;
  /// Gives back the disk's blocks under these bytes, where the file system can; they read as zero
  /// then.
  void discard(std::uint64_t offset, std::uint64_t bytes) const noexcept;

 private:
  std::filesystem::path directory_;
  int fd_ = -1;
};

}  // namespace ptc
