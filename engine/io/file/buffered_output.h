// Inside the writers: many small pieces gathered into large writes.
#pragma once

#include <bit>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "engine/io/file/file.h"

namespace ptc {

static_assert(std::endian::native == std::endian::little,
              "values are stored as they lie in memory");

/// An OutputFile written front to back. @throws std::system_error
class BufferedOutput {
 public:
  explicit BufferedOutput(const std::filesystem::path& target) : file_(target) {
    buffer_.reserve(kBytes);
  }

  void put(const void* data, std::size_t bytes) {
    if (buffer_.size() + bytes > kBytes) flush();
    const auto* from = static_cast<const std::byte*>(data);
    buffer_.insert(buffer_.end(), from, from + bytes);
  }
  void publish() {
    flush();
    file_.publish();
  }

 private:
  static constexpr std::size_t kBytes = std::size_t{1} << 20;

  void flush() {
    file_.append(buffer_);
    buffer_.clear();
  }

  OutputFile file_;
  std::vector<std::byte> buffer_;
};

}  // namespace ptc
