// Direct transfers, with the page cache as the way out where a file system refuses them: some
// refuse when a file is opened, others at the first transfer.
#include "engine/sort/direct_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <system_error>

#include "engine/base/error.h"

namespace ptc {
namespace {

constexpr int kFlags = O_RDWR | O_DIRECT;
constexpr std::size_t kMaxBytes = std::size_t{8} << 20;  // of one system call

[[noreturn]] void fail(const char* call, const std::string& name) {
  throw std::system_error(errno, std::generic_category(), std::string(call) + " " + name);
}

}  // namespace

DirectFile::DirectFile(const std::filesystem::path& directory)
    : name_("temporary file in " + directory.string()),
      fd_(open_retrying(directory, kFlags | O_TMPFILE, 0600)) {
  if (fd_ < 0) buffered_.emplace(directory);  // without direct transfers; it reports other errors
}

DirectFile::DirectFile(const std::filesystem::path& file, Kept how) : name_(file.string()) {
  const int made = how == Kept::made ? O_CREAT | O_TRUNC : O_CREAT | O_EXCL;
  const int flags = kFlags | (how == Kept::found ? 0 : made);
  fd_ = open_retrying(file, flags, 0600);
  if (fd_ < 0 && errno == EINVAL) {
    // The file system has no direct transfers, but may have created the file
    fd_ = open_retrying(file, flags & ~(O_DIRECT | O_EXCL), 0600);
  }
  if (fd_ < 0) fail("open", name_);
}

DirectFile::~DirectFile() {
  if (fd_ >= 0) ::close(fd_);
}

bool DirectFile::give_up_direct(bool was_direct) const noexcept {
  if (errno != EINVAL || !was_direct) return false;
  const int flags = ::fcntl(fd_, F_GETFL);
  if (flags < 0 || ::fcntl(fd_, F_SETFL, flags & ~O_DIRECT) != 0) return false;
  direct_ = false;
  return true;
}

void DirectFile::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  if (buffered_) return buffered_->read_at(offset, bytes);
  while (!bytes.empty()) {
    const bool direct = direct_;
    const ssize_t n =
        ::pread(fd_, bytes.data(), std::min(bytes.size(), kMaxBytes), static_cast<off_t>(offset));
    if (n < 0 && errno != EINTR && !give_up_direct(direct)) fail("pread", name_);
    if (n == 0) throw DataError(name_ + ": the file is shorter than what was written to it");
    if (n < 0) continue;
    offset += static_cast<std::uint64_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
}

void DirectFile::write_at(std::uint64_t offset, std::span<const std::byte> bytes) {
  if (buffered_) return buffered_->write_at(offset, bytes);
  while (!bytes.empty()) {
    const bool direct = direct_;
    const ssize_t n =
        ::pwrite(fd_, bytes.data(), std::min(bytes.size(), kMaxBytes), static_cast<off_t>(offset));
    if (n == 0) errno = EIO;
    if (n == 0 || (n < 0 && errno != EINTR && !give_up_direct(direct)))
      fail_write(errno, name_, offset + bytes.size());
    if (n < 0) continue;
    offset += static_cast<std::uint64_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
}

void DirectFile::sync() {
  while (::fsync(fd_) != 0) {
    if (errno != EINTR) fail("fsync", name_);
  }
}

void DirectFile::discard(std::uint64_t offset, std::uint64_t bytes) const noexcept {
  if (buffered_) return buffered_->discard(offset, bytes);
  discard_blocks(fd_, offset, bytes);
}

}  // namespace ptc
