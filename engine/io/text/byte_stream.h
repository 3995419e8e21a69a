// A file that is read once from front to back, as lines or as records of bytes.
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

/// Reads a file sequentially through a buffer. A gzip file, as its first bytes tell, is
/// decompressed on the way, and all offsets count decompressed bytes.
///
/// Every read throws DataError when compressed data are damaged or decompress to more than 64 MiB
/// plus 256 times their size, and std::system_error when the system refuses to read.
///
/// Memory: a buffer of 256 KiB, which grows up to kMaxBytesAtOnce for longer lines and records;
/// compressed files take another 256 KiB.
class ByteStream {
 public:
  /// The greatest length of a line or record, bytes.
  static constexpr std::size_t kMaxBytesAtOnce = std::size_t{1} << 26;

  /// Opens a file. @throws std::system_error; DataError when a name ends in .gz and the
  /// file is no gzip file
  explicit ByteStream(const std::filesystem::path& path);
  ~ByteStream();
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  /// Returns the path of the file.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return file_.path(); }
  /// Says whether the file is decompressed on the way.
  [[nodiscard]] bool compressed() const noexcept { return gunzip_ != nullptr; }
  /// Returns the offset of the next byte.
  [[nodiscard]] std::uint64_t offset() const noexcept { return base_ + begin_; }
  /// Returns the number of the line that next_line() read last, counted from 1.
  [[nodiscard]] std::uint64_t line() const noexcept { return line_; }
  /// Returns an upper bound on the bytes that are left; it is exact for uncompressed files.
  [[nodiscard]] std::uint64_t max_left() const noexcept;

  /// Sets `line` to the next line without its end ("\n" or "\r\n"). The view is valid until the
  /// next call. @return false at the end of the file
  /// @throws DataError when the line has more than kMaxBytesAtOnce bytes
  [[nodiscard]] bool next_line(std::string_view& line);
  /// Returns the next `count` bytes, a view that is valid until the next call.
  /// @throws DataError when fewer are left or `count` is above kMaxBytesAtOnce
  [[nodiscard]] std::span<const std::byte> take(std::size_t count);
  /// Returns up to `count` of the next bytes without going on: fewer only where the file ends. The
  /// view is valid until the next call. `count` is at most 256 KiB.
  [[nodiscard]] std::string_view peek(std::size_t count);
  /// Skips `count` bytes. @throws DataError when fewer are left
  void skip(std::uint64_t count);
  /// Says whether no byte is left; it may have to read to find out.
  [[nodiscard]] bool at_end();

  /// Refuses the file because of the bytes at an offset. @throws DataError "PATH: offset N: RULE"
  [[noreturn]] void fail_at(std::uint64_t offset, const std::string& rule) const;
  /// Refuses the file because of the line read last. @throws DataError "PATH: line N: RULE"
  [[noreturn]] void fail_at_line(const std::string& rule) const;

 private:
  struct Gunzip;

  /// Reads more bytes behind the unread ones. @return false at the end of the file
  bool refill();
  /// Reads up to out.size() bytes. @return their number; 0 at the end of the file
  std::size_t read_some(std::span<std::byte> out);

  InputFile file_;
  std::unique_ptr<Gunzip> gunzip_;  // null when the file is not compressed
  std::vector<std::byte> buffer_;
  std::uint64_t base_ = 0;  // offset of buffer_[0] in the stream
  std::size_t begin_ = 0;   // unread bytes are [begin_, end_)
  std::size_t end_ = 0;
  std::uint64_t line_ = 0;
};

}  // namespace ptc
