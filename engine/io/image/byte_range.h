// Internal to the image readers: the bytes of a picture, in memory or in a file.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/file/file.h"

namespace ptc {

/// The bytes of a picture: a view of memory, or a range of an open file.
class ByteRange {
 public:
  /// @param bytes  must outlive this
  explicit ByteRange(std::span<const std::byte> bytes) : held_(bytes), size_(bytes.size()) {}
  /// @param file  must outlive this
  /// @pre   offset + size <= file.size()
  ByteRange(const InputFile& file, std::uint64_t offset, std::uint64_t size)
      : file_(&file), offset_(offset), size_(size) {}

  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  /// Returns the file whose bytes these are, all of them; null for bytes in memory or in a part of
  /// a file.
  [[nodiscard]] const InputFile* whole_file() const noexcept {
    return file_ != nullptr && offset_ == 0 && size_ == file_->size() ? file_ : nullptr;
  }
  /// Fills `out` with the bytes from `at` on. @pre at + out.size() <= size()
  /// @throws DataError when the file has become shorter; std::system_error
  void read(std::uint64_t at, std::span<std::byte> out) const {
    if (file_ != nullptr) {
      file_->read_at(offset_ + at, out);
    } else {
      std::ranges::copy(held_.subspan(at, out.size()), out.begin());
    }
  }

 private:
  const InputFile* file_ = nullptr;  ///< null: `held_`
  std::span<const std::byte> held_;
  std::uint64_t offset_ = 0;  ///< in the file
  std::uint64_t size_;
};

/// Reads the bytes of a picture from front to back, through a buffer of 64 KiB.
class ByteCursor {
 public:
  /// @param name  name of the picture for errors
  ByteCursor(const ByteRange& bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  /// Returns the offset of the next byte.
  [[nodiscard]] std::uint64_t offset() const noexcept { return next_ - left_.size(); }
  /// Returns some of the bytes that come next, at least one, and goes on behind them. The view is
  /// valid until the next call.
  /// @throws DataError when no byte is left; as ByteRange::read()
  std::span<const std::byte> some() {
    if (left_.empty()) fill();
    const std::span<const std::byte> result = left_;
    left_ = {};
    return result;
  }
  /// Returns the next byte. @throws as some()
  unsigned u8() {
    if (left_.empty()) fill();
    const auto value = std::to_integer<unsigned>(left_.front());
    left_ = left_.subspan(1);
    return value;
  }
  /// Fills `out` with the next bytes. @throws as some()
  void take(std::span<std::byte> out) {
    while (!out.empty()) {
      if (left_.empty()) fill();
      const std::size_t count = std::min(out.size(), left_.size());
      std::ranges::copy(left_.first(count), out.begin());
      left_ = left_.subspan(count);
      out = out.subspan(count);
    }
  }
  /// Refuses the picture. @throws DataError that names the offset of the next byte, or of one
  /// before
  /// @param unread  bytes by which that lies before the next byte
  [[noreturn]] void fail(const std::string& rule, std::uint64_t unread = 0) const {
    throw DataError(name_ + ": offset " + std::to_string(offset() - unread) + ": " + rule);
  }

 private:
  void fill() {
    if (next_ == bytes_.size()) fail("the picture ends too early");
    buffer_.resize(std::min<std::uint64_t>(kBufferBytes, bytes_.size() - next_));
    bytes_.read(next_, buffer_);
    next_ += buffer_.size();
    left_ = buffer_;
  }

  static constexpr std::uint64_t kBufferBytes = 1 << 16;
  ByteRange bytes_;
  std::string name_;
  std::vector<std::byte> buffer_;
  std::span<const std::byte> left_;  ///< of the buffer
  std::uint64_t next_ = 0;           ///< offset behind the buffer
};

}  // namespace ptc
