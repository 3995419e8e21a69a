// Files of a program's own state.
//
//   | magic u64 | version u64 | length u64 | XXH3-64 of the state u64 | state, length bytes |
#include "engine/io/file/state_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMagic = 0x4554'4154'5358'5450;  // "PTXSTATE"
constexpr std::uint64_t kVersion = 7;  // of the file; also the seed of its checksum
constexpr std::size_t kHeadBytes = kStateOffset;
constexpr int kLockTries = 10;
constexpr std::chrono::milliseconds kLockWait(30);

std::array<std::byte, kHeadBytes> head_of(std::span<const std::byte> state) {
  std::array<std::byte, kHeadBytes> head{};
  store(head.data(), 0, kMagic);
  store(head.data(), 8, kVersion);
  store(head.data(), 16, std::uint64_t{state.size()});
  store(head.data(), 24, xxh3_64(state, kVersion));
  return head;
}

void write(OutputFile& file, std::span<const std::byte> state) {
  file.append(head_of(state));
  file.append(state);
  file.publish();
}

}  // namespace

void StateWriter::put_bytes(std::span<const std::byte> bytes) {
  put(std::uint64_t{bytes.size()});
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

void StateReader::fail(const std::string& text) const {
  const std::string at = begins_ ? "offset " + std::to_string(*begins_ + last_) + ": " : "";
  throw DataError(name_ + ": " + at + text);
}

std::span<const std::byte> StateReader::take(std::uint64_t count) {
  last_ = all_ - bytes_.size();
  if (count > bytes_.size()) fail("the state ends too early");
  const std::span<const std::byte> taken = bytes_.first(static_cast<std::size_t>(count));
  bytes_ = bytes_.subspan(taken.size());
  return taken;
}

std::uint64_t StateReader::get_count(std::uint64_t most) {
  const auto count = get<std::uint64_t>();
  if (count > most) fail("a number of the state is out of range");
  return count;
}

std::span<const std::byte> StateReader::get_bytes() {
  return take(get<std::uint64_t>());
}

std::string StateReader::get_text() {
  const std::span<const std::byte> bytes = get_bytes();
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void StateReader::end() const {
  if (!bytes_.empty()) fail("the state has more bytes than it should");
}

std::filesystem::path state_temporary(const std::filesystem::path& path) {
  return path.string() + ".new";
}

void write_state(const std::filesystem::path& path, std::span<const std::byte> state) {
  OutputFile file(path, state_temporary(path));
  file.truncate(0);
  write(file, state);
}

void write_shared_state(const std::filesystem::path& path, std::span<const std::byte> state) {
  OutputFile file(path);
  write(file, state);
}

std::vector<std::byte> read_state(const std::filesystem::path& path) {
  const InputFile file(path);
  const auto require = [&](bool holds, const char* text) {
    if (!holds) throw DataError(path.string() + ": " + text);
  };
  std::array<std::byte, kHeadBytes> head{};
  require(file.size() >= head.size(), "the state is truncated");
  file.read_at(0, head);
  require(load<std::uint64_t>(head.data(), 0) == kMagic, "the file is not the state of a build");
  require(load<std::uint64_t>(head.data(), 8) == kVersion,
          "the state was written by another version of this program");
  require(load<std::uint64_t>(head.data(), 16) == file.size() - head.size(),
          "the state is truncated");
  std::vector<std::byte> state(static_cast<std::size_t>(file.size() - head.size()));
  file.read_at(head.size(), state);
  require(load<std::uint64_t>(head.data(), 24) == xxh3_64(state, kVersion),
          "the state's checksum is wrong");
  return state;
}

FileLock::FileLock(const std::filesystem::path& path) {
  const auto fail = [&](const char* call) {
    const int error = errno;
    if (fd_ >= 0) ::close(fd_);
    const char* const held = error == EWOULDBLOCK ? ": another program is using it" : "";
    throw std::system_error(error, std::generic_category(), call + (" " + path.string()) + held);
  };
  while (true) {
    fd_ = open_retrying(path, O_RDWR | O_CREAT, 0666);
    if (fd_ < 0) fail("open");
    // A program that was killed may hold its lock for a moment longer, until the system has freed
    // it.
    for (int tries = 0; ::flock(fd_, LOCK_EX | LOCK_NB) != 0;) {
      if (errno == EINTR) continue;
      if (errno != EWOULDBLOCK || ++tries > kLockTries) fail("flock");
      std::this_thread::sleep_for(kLockWait);
    }
    struct stat held {
    }, named{};
    if (::fstat(fd_, &held) != 0) fail("fstat");
    // Try again if the process that held the lock before has renamed or removed the file.
    if (::stat(path.c_str(), &named) == 0 && held.st_dev == named.st_dev &&
        held.st_ino == named.st_ino)
      return;
    ::close(fd_);
  }
}

FileLock::~FileLock() {
  ::close(fd_);
}

}  // namespace ptc
