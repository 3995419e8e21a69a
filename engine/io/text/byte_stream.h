// A file read once from front to back, as lines or as records of bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/file/file.h"

namespace ptc {

/// Buffered sequential reading; a name that ends in ".gz" is unpacked on the way. Offsets count
/// unpacked bytes.
/// Memory: a buffer of 256 KiB, up to kMaxBytesAtOnce while a line or record is longer.
class ByteStream {
 public:
  /// The longest line and the largest record.
  static constexpr std::size_t kMaxBytesAtOnce = std::size_t{1} << 26;

  /// @throws std::system_error, DataError when a .gz is no gzip file
  explicit ByteStream(const std::filesystem::path& path);
  ~ByteStream();
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return file_.path(); }
  /// Offset of the next byte.
  [[nodiscard]] std::uint64_t offset() const noexcept { return base_ + begin_; }
  /// Number of the line that next_line() gave last, from 1 on.
  [[nodiscard]] std::uint64_t line() const noexcept { return line_; }
  /// No more bytes than this are to come; exact where the file is not packed.
  [[nodiscard]] std::uint64_t max_left() const noexcept;

  /// Sets `line` to the next line without its end ("\n" or "\r\n"), valid until the next call.
  /// @return false at the end of the file
  [[nodiscard]] bool next_line(std::string_view& line);
  /// The next `count` bytes, valid until the next call. @throws DataError when the file ends before
  [[nodiscard]] std::span<const std::byte> take(std::size_t count);
  /// Passes over `count` bytes. @throws DataError when the file ends before
  void skip(std::uint64_t count);
  [[nodiscard]] bool at_end();

  /// @throws DataError "PATH: offset N: RULE"
  [[noreturn]] void fail_at(std::uint64_t offset, const std::string& rule) const;
  /// @throws DataError "PATH: line N: RULE" of the last line
  [[noreturn]] void fail_at_line(const std::string& rule) const;

 private:
  struct Gunzip;

  bool refill();
  std::size_t read_some(std::span<std::byte> out);

  InputFile file_;
  std::unique_ptr<Gunzip> gunzip_;
  std::vector<std::byte> buffer_;
  std::uint64_t base_ = 0;  // offset of buffer_[0]
  std::size_t begin_ = 0;   // unread bytes are [begin_, end_)
  std::size_t end_ = 0;
  std::uint64_t line_ = 0;
};

}  // namespace ptc
