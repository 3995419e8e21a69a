// Files with positioned reads and writes that transfer everything or throw, and publication by
// rename.
//
//   InputFile       an existing file, read only
//   OutputFile      a new file that replaces its target whole, or leaves the target as it was:
//
//                   .NAME.tmp-HOST-PID-RANDOM-N  --write, ...-->  --fsync-->  --rename-->  NAME
//                                   an exception or a fatal signal removes the temporary file
//
//   TempFile        a file without a name, gone as soon as it is closed
//   TemporaryName   removes a file that another owner wrote
//
// No call returns early because of a signal: EINTR and short transfers are retried everywhere.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <memory>
#include <span>

namespace ptc {

class RemoteFile;

/// A file that is open for reading.   Threads: read_at() may be called concurrently.
class InputFile {
 public:
  /// Opens a regular file, or a file on a server by its URL (remote_file.h).
  /// @throws std::system_error that names the call and the path; a directory is refused with
  ///         EISDIR, and anything else that is not a regular file with ESPIPE; RemoteFile's errors
  explicit InputFile(const std::filesystem::path& path);
  ~InputFile();
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;

  /// Returns the path under which the file was opened.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Returns the length of the file in bytes, as it was when the file was opened.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  /// Says whether the file is read from a server.
  [[nodiscard]] bool is_remote() const noexcept { return remote_ != nullptr; }
  /// Returns the descriptor, which this object owns and closes; -1 for a remote file.
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// Says whether a path names this file, and not one that has replaced it. No path names a remote
  /// file.
  /// @throws std::system_error
  [[nodiscard]] bool is_named(const std::filesystem::path& path) const;
  /// Fills `out` with the bytes of the file from `offset` on.
  /// @throws DataError when the file ends before `out` is full; std::system_error when a read
  ///         fails; RemoteFile's errors
  void read_at(std::uint64_t offset, std::span<std::byte> out) const;
  /// Asks the system to begin reading these bytes into its page cache, because they will be read
  /// soon. It does nothing for a remote file.
  void read_ahead(std::uint64_t offset, std::uint64_t bytes) const noexcept;

 private:
  std::filesystem::path path_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
  std::unique_ptr<const RemoteFile> remote_;
};

/// A file that is written under a temporary name (temporary_name()) and either replaces the target
/// as a whole or is removed. The old file stays until publish() has succeeded.
///
/// A target that is a symbolic link stays a link; the file to which it leads is replaced. The new
/// file gets the permissions of the old one.
class OutputFile {
 public:
  /// Creates the temporary file. A symbolic link is followed, also to a file that does not exist.
  /// @throws std::system_error; a target that is a directory is refused with EISDIR, a URL with
  ///         EROFS, any other target that is not a regular file with EINVAL
  explicit OutputFile(const std::filesystem::path& target);
  /// Opens or creates the file `partial` in place of a temporary one. What it already holds is
  /// kept, and the file stays when this object is destroyed without publish().
  /// @param partial  a path in the directory of the target
  /// @throws std::system_error as the other constructor does
  OutputFile(const std::filesystem::path& target, const std::filesystem::path& partial);
  /// Closes the file. Removes it when it has a temporary name and was not published.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Returns the path of the file that will be replaced, behind symbolic links.
  [[nodiscard]] const std::filesystem::path& target() const noexcept { return target_; }
  /// Returns the path under which the file is written.
  [[nodiscard]] const std::filesystem::path& temporary() const noexcept { return temporary_; }
  /// Writes all bytes from `offset` on. @throws std::system_error, see fail_write()
  /// Threads: may be called concurrently for disjoint ranges.
  void write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Writes all bytes from size() on. @throws std::system_error, see fail_write()
  /// Threads: no other thread may write at the same time.
  void append(std::span<const std::byte> bytes);
  /// Returns the end of the farthest write so far, bytes; what a partial file held before does not
  /// count.
  [[nodiscard]] std::uint64_t size() const noexcept {
    return size_.load(std::memory_order_relaxed);
  }
  /// Sets the length of the file and size() to `bytes`. @throws std::system_error
  void truncate(std::uint64_t bytes);
  /// Flushes everything written so far to stable storage (fdatasync). @throws std::system_error
  /// Threads: other threads may write at the same time.
  void sync();
  /// Flushes the file to stable storage, renames it over the target and flushes the directory. The
  /// file is closed afterwards.
  /// @param source  the file that the new one was made from, or null; when it was opened under the
  ///                name of the target, the target must still be this file
  /// @throws std::system_error, and DataError when another file has taken the place of `source`;
  ///         the target is unchanged unless only the last step failed
  void publish(const InputFile* source = nullptr);

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
  int fd_ = -1;
  std::atomic<std::uint64_t> size_ = 0;
  bool stays_ = false;  ///< the file is not removed when it is not published
  bool published_ = false;
};

/// Removes the file of a given name on destruction, or in remove_temporaries().
class TemporaryName {
 public:
  /// Registers the path. The file need not exist.
  explicit TemporaryName(const std::filesystem::path& path);
  ~TemporaryName();
  TemporaryName(const TemporaryName&) = delete;
  TemporaryName& operator=(const TemporaryName&) = delete;
  /// Gives up the removal: the file stays.
  void release() noexcept;

 private:
  std::filesystem::path path_;
};

/// Returns the path at the end of a chain of symbolic links, where a file need not exist.
/// @throws std::system_error (ELOOP) for links that lead in a circle
[[nodiscard]] std::filesystem::path behind_links(const std::filesystem::path& path);

/// Says whether a path leads to a regular file that can be looked at, or a URL to a file on a
/// server.
/// @throws the errors of RemoteFile, but for a file that is not there (ENOENT)
[[nodiscard]] bool is_file(const std::filesystem::path& path);

/// Says whether an error is that of a server or of the net, and not that the file of a URL is not
/// there or not to be read.
[[nodiscard]] bool is_net_failure(const std::filesystem::path& path, const std::exception& error);

/// Says whether two paths lead to one name of a file, which need not exist. What the name stands
/// for does not count, so the answer stays the same while other programs replace the file.
/// @throws std::system_error
[[nodiscard]] bool same_name(const std::filesystem::path& a, const std::filesystem::path& b);

/// Returns the directory of a file: its parent path, or "." when the path has none.
[[nodiscard]] std::filesystem::path directory_of(const std::filesystem::path& file);

/// Flushes the directory of a file to stable storage (fsync), so that a new name survives a power
/// loss. @throws std::system_error
void sync_directory(const std::filesystem::path& file);

/// Throws the error of a write that failed. When the limit on the size of files (RLIMIT_FSIZE) is
/// the reason, the message names the limit and the bytes that the file needs.
///
/// A program under such a limit must ignore SIGXFSZ, which would otherwise end it before a write
/// can fail.
/// @param error  errno of the write
/// @param end    bytes that the file would have after the write
/// @throws std::system_error always
[[noreturn]] void fail_write(int error, const std::filesystem::path& path, std::uint64_t end);

/// Opens a file with O_CLOEXEC, so that programs started from this one do not inherit the
/// descriptor. @return the descriptor, or -1 and errno as open() sets it
[[nodiscard]] int open_retrying(const std::filesystem::path& path, int flags,
                                mode_t mode = 0) noexcept;

/// Frees the disk blocks under these bytes of an open file, if the file system can; the bytes read
/// as zero then.
void discard_blocks(int fd, std::uint64_t offset, std::uint64_t bytes) noexcept;

/// Removes the files of all TemporaryNames and all unpublished OutputFiles with temporary names. It
/// is for a process that ends immediately: any thread that later creates or destroys one of these
/// waits forever. It allocates nothing and may be called in a signal handler.
void remove_temporaries() noexcept;

/// Installs a handler for SIGINT, SIGTERM and SIGHUP that calls remove_temporaries() and then ends
/// the process as the signal would have. A signal that is ignored stays ignored. A program calls it
/// once, at its start.
void remove_temporaries_on_signal();

/// A file without a name in `directory`, which vanishes when it is closed (O_TMPFILE, or unlinked
/// immediately where the file system lacks that).
///
/// Threads: read_at() and write_at() may be called concurrently.
class TempFile {
 public:
  /// Creates the file. @throws std::system_error that names the directory
  explicit TempFile(const std::filesystem::path& directory);
  ~TempFile();
  TempFile(TempFile&& other) noexcept;
  TempFile& operator=(TempFile&&) = delete;

  /// Fills `out` with the bytes of the file from `offset` on.
  /// @throws DataError when the file ends before `out` is full; std::system_error when a read fails
  void read_at(std::uint64_t offset, std::span<std::byte> out) const;
  /// Writes all bytes from `offset` on. @throws std::system_error, see fail_write()
  void write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Frees the disk blocks under these bytes, if the file system can; the bytes read as zero then.
  void discard(std::uint64_t offset, std::uint64_t bytes) const noexcept;

 private:
  std::filesystem::path directory_;  ///< stands for the file in messages
  int fd_ = -1;
};

}  // namespace ptc
