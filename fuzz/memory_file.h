// A file in memory that can be opened by its name.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>

namespace ptc::fuzz {

/// A file in memory (memfd) with a name in a directory of this process. The name is removed when
/// this object is destroyed. If the system refuses a call, the process aborts.
class MemoryFile {
 public:
  /// Makes a file of these bytes. A file of the same name is replaced.
  MemoryFile(std::span<const std::byte> bytes, const std::string& name)
      : fd_(memfd_create("fuzz", 0)), path_(directory() / name) {
    if (fd_ < 0) std::abort();
    write(bytes);
    std::filesystem::remove(path_);
    std::filesystem::create_symlink(
        "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(fd_), path_);
  }
  ~MemoryFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
    close(fd_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  /// Returns the path under which the file can be opened.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Overwrites the file from its front. While a reader has the file open, the number of bytes must
  /// not change.
  void write(std::span<const std::byte> bytes) const {
    if (pwrite(fd_, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
      std::abort();
  }

  /// Returns the directory of this process, which is removed when the process ends.
  static const std::filesystem::path& directory() {
    static const struct Directory {
      std::filesystem::path path =
          std::filesystem::temp_directory_path() / ("ptc-fuzz-" + std::to_string(getpid()));
      Directory() { std::filesystem::create_directories(path); }
      ~Directory() {
        std::error_code ignored;
        std::filesystem::remove_all(path, ignored);
      }
    } it;
    return it.path;
  }

 private:
  int fd_;
  std::filesystem::path path_;
};

}  // namespace ptc::fuzz
