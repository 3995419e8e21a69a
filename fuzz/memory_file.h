// A file in memory that can be opened by name.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>

namespace ptc::fuzz {

/// Bytes under a name in a directory of this process, for as long as it lives.
class MemoryFile {
 public:
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

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Puts other bytes in their place; as many, while a reader has it open.
  void write(std::span<const std::byte> bytes) const {
    if (pwrite(fd_, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
      std::abort();
  }

  /// Removed when the process ends.
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
