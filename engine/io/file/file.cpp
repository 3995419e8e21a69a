// Positioned file access over POSIX calls.
#include "engine/io/file/file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <limits>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/file/remote_file.h"
#include "engine/io/file/temporary_name.h"
#include "engine/io/file/temporary_registry.h"
#include "engine/io/file/url.h"

namespace ptc {
namespace {

constexpr std::uint64_t kWriteBackBytes = std::uint64_t{8} << 20;  // told to the disk at once
constexpr auto kOffsetLimit = static_cast<std::uint64_t>(std::numeric_limits<off_t>::max());

[[noreturn]] void fail(int error, const char* call, const std::filesystem::path& path) {
  throw std::system_error(error, std::generic_category(), std::string(call) + " " + path.string());
}

// Repeats a call until a signal does not interrupt it.
template <class Call>
int retrying(Call&& call) {
  int result = -1;
  do {
    result = call();
  } while (result < 0 && errno == EINTR);
  return result;
}

void read_whole(int fd, const std::filesystem::path& path, std::uint64_t offset,
                std::span<std::byte> out) {
  std::size_t done = 0;
  while (done < out.size()) {
    const std::uint64_t at = offset + done;
    if (at < offset || at > kOffsetLimit) fail(EOVERFLOW, "pread", path);
    const ssize_t count = ::pread(fd, out.data() + done, out.size() - done, static_cast<off_t>(at));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(errno, "pread", path);
    if (count == 0) {
      throw DataError(path.string() + ": offset " + std::to_string(at) +
                      ": the file ends here and " + std::to_string(out.size() - done) +
                      " bytes are missing");
    }
    done += static_cast<std::size_t>(count);
  }
}

void write_whole(int fd, const std::filesystem::path& path, std::uint64_t offset,
                 std::span<const std::byte> bytes) {
  if (offset > kOffsetLimit || bytes.size() > kOffsetLimit - offset) fail(EFBIG, "pwrite", path);
  const std::uint64_t end = offset + bytes.size();
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count =
        ::pwrite(fd, bytes.data() + done, bytes.size() - done, static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_write(errno, path, end);
    if (count == 0) fail(EIO, "pwrite", path);
    done += static_cast<std::size_t>(count);
  }
}

// Returns the permissions of the file that will be replaced, or nothing when there is none. It
// throws std::system_error when the target is not a regular file or cannot be one.
std::optional<mode_t> mode_of(const std::filesystem::path& target) {
  if (is_url(target)) fail(EROFS, "open", target);
  struct stat old {};
  const bool exists = ::stat(target.c_str(), &old) == 0;
  if (!exists && errno != ENOENT) fail(errno, "stat", target);
  if ((exists && S_ISDIR(old.st_mode)) || target.filename().empty()) fail(EISDIR, "open", target);
  if (exists && !S_ISREG(old.st_mode)) fail(EINVAL, "open", target);
  return exists ? std::optional(old.st_mode & 0777) : std::nullopt;
}

}  // namespace

void fail_write(int error, const std::filesystem::path& path, std::uint64_t end) {
  rlimit limit{};
  const bool limited = error == EFBIG && ::getrlimit(RLIMIT_FSIZE, &limit) == 0 &&
                       limit.rlim_cur != RLIM_INFINITY && limit.rlim_cur < end;
  if (!limited) fail(error, "pwrite", path);
  throw std::system_error(error, std::generic_category(),
                          "pwrite " + path.string() + ": it needs " + std::to_string(end) +
                              " bytes or more, but a file of this process may have only " +
                              std::to_string(limit.rlim_cur) + " (ulimit -f)");
}

int open_retrying(const std::filesystem::path& path, int flags, mode_t mode) noexcept {
  return retrying([&] { return ::open(path.c_str(), flags | O_CLOEXEC, mode); });
}

std::filesystem::path directory_of(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
}

void sync_directory(const std::filesystem::path& file) {
  const std::filesystem::path directory = directory_of(file);
  const int fd = open_retrying(directory, O_RDONLY | O_DIRECTORY);
  if (fd < 0) fail(errno, "open", directory);
  const int error = retrying([&] { return ::fsync(fd); }) == 0 ? 0 : errno;
  ::close(fd);
  // Ignore EINVAL, which file systems return that cannot sync a directory.
  if (error != 0 && error != EINVAL) fail(error, "fsync", directory);
}

void discard_blocks(int fd, std::uint64_t offset, std::uint64_t bytes) noexcept {
  if (bytes == 0) return;
  // If the file system cannot do this, the blocks stay until the file is removed.
  static_cast<void>(::fallocate(fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE,
                                static_cast<off_t>(offset), static_cast<off_t>(bytes)));
}

InputFile::InputFile(const std::filesystem::path& path) : path_(path) {
  if (is_url(path)) {
    remote_ = std::make_unique<RemoteFile>(path.string());
    size_ = remote_->size();
    return;
  }
  // Open without blocking, because opening a pipe would wait for its writer.
  fd_ = open_retrying(path, O_RDONLY | O_NONBLOCK);
  if (fd_ < 0) fail(errno, "open", path);
  struct stat status {};
  int error = ::fstat(fd_, &status) == 0 ? 0 : errno;
  if (error == 0 && S_ISDIR(status.st_mode)) error = EISDIR;
  if (error == 0 && !S_ISREG(status.st_mode)) error = ESPIPE;
  if (error != 0) {
    ::close(fd_);
    fail(error, "open", path);
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

InputFile::~InputFile() {
  if (fd_ >= 0) ::close(fd_);
}

InputFile::InputFile(InputFile&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      size_(std::exchange(other.size_, 0)),
      remote_(std::move(other.remote_)) {}

bool InputFile::is_named(const std::filesystem::path& path) const {
  if (is_remote()) return false;
  struct stat own {
  }, named{};
  if (::fstat(fd_, &own) != 0) fail(errno, "fstat", path_);
  return ::stat(path.c_str(), &named) == 0 && own.st_dev == named.st_dev &&
         own.st_ino == named.st_ino;
}

void InputFile::read_at(std::uint64_t offset, std::span<std::byte> out) const {
  if (is_remote()) {
    remote_->read_at(offset, out);
  } else {
    read_whole(fd_, path_, offset, out);
  }
}

void InputFile::read_ahead(std::uint64_t offset, std::uint64_t bytes) const noexcept {
  if (is_remote()) return;
  ::posix_fadvise(fd_, static_cast<off_t>(offset), static_cast<off_t>(bytes), POSIX_FADV_WILLNEED);
}

std::filesystem::path behind_links(const std::filesystem::path& path) {
  constexpr int kMaxLinks = 40;  // as many as the system follows
  std::filesystem::path end = path;
  for (int links = 0; links <= kMaxLinks; ++links) {
    struct stat status {};
    const bool exists = ::lstat(end.c_str(), &status) == 0;
    if (!exists && errno != ENOENT && errno != ENOTDIR) fail(errno, "lstat", end);
    if (!exists || !S_ISLNK(status.st_mode)) return end;
    end = end.parent_path() / std::filesystem::read_symlink(end);
  }
  fail(ELOOP, "readlink", path);
}

bool is_file(const std::filesystem::path& path) {
  std::error_code unknown;
  if (!is_url(path)) return std::filesystem::is_regular_file(path, unknown);
  try {
    static_cast<void>(RemoteFile(path.string()));
    return true;
  } catch (const std::system_error& error) {
    if (error.code() == std::errc::no_such_file_or_directory) return false;
    throw;
  }
}

bool is_net_failure(const std::filesystem::path& path, const std::exception& error) {
  const auto* const failure = dynamic_cast<const std::system_error*>(&error);
  return is_url(path) && failure != nullptr &&
         failure->code() != std::errc::no_such_file_or_directory &&
         failure->code() != std::errc::permission_denied;
}

bool same_name(const std::filesystem::path& a, const std::filesystem::path& b) {
  return std::filesystem::weakly_canonical(behind_links(a)) ==
         std::filesystem::weakly_canonical(behind_links(b));
}

OutputFile::OutputFile(const std::filesystem::path& target) : target_(behind_links(target)) {
  const std::optional<mode_t> old = mode_of(target);
  do {
    temporary_ = temporary_name(target_);
    fd_ = create_temporary(this, temporary_);
  } while (fd_ < 0 && errno == EEXIST);
  if (fd_ < 0) fail(errno, "open", temporary_);
  if (old) static_cast<void>(::fchmod(fd_, *old));
}

OutputFile::OutputFile(const std::filesystem::path& target, const std::filesystem::path& partial)
    : target_(behind_links(target)), temporary_(partial), stays_(true) {
  const std::optional<mode_t> old = mode_of(target);
  fd_ = open_retrying(partial, O_RDWR | O_CREAT, 0666);
  if (fd_ < 0) fail(errno, "open", partial);
  if (old) static_cast<void>(::fchmod(fd_, *old));
}

OutputFile::~OutputFile() {
  if (fd_ >= 0) ::close(fd_);
  if (published_ || stays_) return;
  ::unlink(temporary_.c_str());
  forget_temporary(this);
}

void OutputFile::write_at(std::uint64_t offset, std::span<const std::byte> bytes) {
  write_whole(fd_, temporary_, offset, bytes);
  const std::uint64_t end = offset + bytes.size();
  std::uint64_t seen = size_.load(std::memory_order_relaxed);
  while (seen < end && !size_.compare_exchange_weak(seen, end, std::memory_order_relaxed)) {
  }
  // Let the disk begin now, so that publish() has less to wait for. This is only advice: what goes
  // wrong is reported by fsync().
  const std::uint64_t from = seen / kWriteBackBytes * kWriteBackBytes;
  const std::uint64_t to = end / kWriteBackBytes * kWriteBackBytes;
  if (from < to) {
    ::sync_file_range(fd_, static_cast<off_t>(from), static_cast<off_t>(to - from),
                      SYNC_FILE_RANGE_WRITE);
  }
}

void OutputFile::append(std::span<const std::byte> bytes) {
  write_at(size(), bytes);
}

void OutputFile::truncate(std::uint64_t bytes) {
  if (retrying([&] { return ::ftruncate(fd_, static_cast<off_t>(bytes)); }) != 0)
    fail(errno, "ftruncate", temporary_);
  size_ = bytes;
}

void OutputFile::sync() {
  if (retrying([&] { return ::fdatasync(fd_); }) != 0) fail(errno, "fdatasync", temporary_);
}

void OutputFile::publish(const InputFile* source) {
  if (retrying([&] { return ::fsync(fd_); }) != 0) fail(errno, "fsync", temporary_);
  // Ignore EINTR: the file is closed all the same, and its content is on stable storage.
  if (::close(std::exchange(fd_, -1)) != 0 && errno != EINTR) fail(errno, "close", temporary_);
  // Hold a lock on the file that is replaced, so that of two programs only one can pass the check.
  const bool replaces = source != nullptr && same_name(source->path(), target_);
  const int held = replaces ? source->descriptor() : -1;
  if (held >= 0 && retrying([&] { return ::flock(held, LOCK_EX); }) != 0)
    fail(errno, "flock", target_);
  if (held >= 0 && !source->is_named(target_)) {
    throw DataError(target_.string() +
                    ": another program replaced this file in the meantime; run this again");
  }
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail(errno, "rename", target_);
  if (held >= 0) ::flock(held, LOCK_UN);
  published_ = true;
  forget_temporary(this);
  sync_directory(target_);
}

TemporaryName::TemporaryName(const std::filesystem::path& path) : path_(path) {
  add_temporary(this, path);
}

TemporaryName::~TemporaryName() {
  if (path_.empty()) return;
  ::unlink(path_.c_str());
  forget_temporary(this);
}

void TemporaryName::release() noexcept {
  path_.clear();
  forget_temporary(this);
}

TempFile::TempFile(const std::filesystem::path& directory) : directory_(directory) {
  fd_ = open_retrying(directory, O_TMPFILE | O_RDWR, 0600);
  if (fd_ >= 0) return;
  if (errno != EOPNOTSUPP && errno != EISDIR) fail(errno, "open", directory);
  // Without O_TMPFILE, create a file and unlink it immediately.
  do {
    const std::filesystem::path name = temporary_name(directory / "spill");
    fd_ = open_retrying(name, O_RDWR | O_CREAT | O_EXCL, 0600);
    if (fd_ >= 0) ::unlink(name.c_str());
  } while (fd_ < 0 && errno == EEXIST);
  if (fd_ < 0) fail(errno, "open", directory);
}

TempFile::~TempFile() {
  if (fd_ >= 0) ::close(fd_);
}

TempFile::TempFile(TempFile&& other) noexcept
    : directory_(std::move(other.directory_)), fd_(std::exchange(other.fd_, -1)) {}

void TempFile::read_at(std::uint64_t offset, std::span<std::byte> out) const {
  read_whole(fd_, directory_, offset, out);
}

void TempFile::write_at(std::uint64_t offset, std::span<const std::byte> bytes) {
  write_whole(fd_, directory_, offset, bytes);
}

void TempFile::discard(std::uint64_t offset, std::uint64_t bytes) const noexcept {
  discard_blocks(fd_, offset, bytes);
}

}  // namespace ptc
