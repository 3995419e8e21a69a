// Internal to the writers of foreign formats: gathers many small pieces into large writes.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "engine/io/file/file.h"

namespace ptc {

static_assert(std::endian::native == std::endian::little,
              "values are stored as they lie in memory");

/// An OutputFile that is written from front to back through a buffer. Every call throws
/// std::system_error when the system refuses to write.
///
/// Memory: 1 MiB, or the longest piece if that is longer.
class BufferedOutput {
 public:
  /// Begins a file that will replace `target`.
  explicit BufferedOutput(const std::filesystem::path& target) : file_(target) {
    buffer_.reserve(kBytes);
  }

  /// Returns the path of the file that will be replaced, behind symbolic links.
  [[nodiscard]] const std::filesystem::path& target() const noexcept { return file_.target(); }
  /// Appends bytes as they lie in memory.
  void put(const void* data, std::size_t bytes) {
    if (buffer_.size() + bytes > kBytes) flush();
    const auto* from = static_cast<const std::byte*>(data);
    buffer_.insert(buffer_.end(), from, from + bytes);
  }
  /// Writes bytes in the place of others that were appended before.
  void put_at(std::uint64_t offset, const void* data, std::size_t bytes) {
    flush();
    file_.write_at(offset, {static_cast<const std::byte*>(data), bytes});
  }
  /// Writes what is left in the buffer and puts the file in the place of the target.
  void publish() {
    flush();
    file_.publish();
  }

 private:
  static constexpr std::size_t kBytes = std::size_t{1} << 20;  ///< size of the buffer

  void flush() {
    file_.append(buffer_);
    buffer_.clear();
  }

  OutputFile file_;
  std::vector<std::byte> buffer_;
};

}  // namespace ptc
