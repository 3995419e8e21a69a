// Buffered reading of lines and records, and the decompression of gzip files.
//
//   buffer_    | consumed | unread | free |          refill() moves the unread bytes to the front,
//              0        begin_   end_               doubles a full buffer, and reads behind them
//
// A view that next_line() or take() has returned is valid until the next call, which may refill.
#include "engine/io/text/byte_stream.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <new>

#include <zlib.h>

#include "engine/base/error.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 18;
// The greatest accepted ratio of decompressed to compressed bytes. Deflate makes up to 1032 bytes
// of one when a file is nothing but repetition: 600 KB of gzip took minutes to read and gave
// gigabytes of vertices. Meshes and clouds shrink to a twentieth at best.
constexpr std::uint64_t kMaxUnpackRatio = 256;
constexpr std::uint64_t kFreeUnpackedBytes = std::uint64_t{1} << 26;

std::uint64_t max_unpacked(std::uint64_t packed) {
  return kFreeUnpackedBytes + kMaxUnpackRatio * std::min(packed, UINT64_MAX / 512);
}

}  // namespace

// Decompresses a gzip file. Compressed bytes come through InputFile, because zlib must not read the
// file itself.
struct ByteStream::Gunzip {
  explicit Gunzip(const InputFile& from) : file(from), input(kBufferBytes) {
    constexpr int kGzipOnly = 15 + 16;
    if (inflateInit2(&stream, kGzipOnly) != Z_OK) throw std::bad_alloc();
  }
  ~Gunzip() { inflateEnd(&stream); }
  Gunzip(const Gunzip&) = delete;
  Gunzip& operator=(const Gunzip&) = delete;

  // Reads more compressed bytes. Returns false at the end of the file.
  bool refill() {
    const auto count =
        static_cast<std::size_t>(std::min<std::uint64_t>(input.size(), file.size() - at));
    file.read_at(at, std::span(input).first(count));
    at += count;
    stream.next_in = reinterpret_cast<Bytef*>(input.data());
    stream.avail_in = static_cast<uInt>(count);
    return count > 0;
  }

  // Says whether the position is behind a member. What follows is another member or padding, of
  // which RFC 1952 says nothing and which is ignored.
  [[nodiscard]] bool between() const { return members > 0 && stream.total_in <= 2; }

  // Decompresses into `out`. Returns the number of bytes, which is below out.size() only at the
  // end of the file, or a negative error of zlib.
  int read(std::span<std::byte> out) {
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    while (stream.avail_out > 0) {
      if (stream.avail_in == 0 && !refill()) {
        if (!between()) return Z_BUF_ERROR;
        break;
      }
      const int result = inflate(&stream, Z_NO_FLUSH);
      if (result == Z_STREAM_END) {
        ++members;
        inflateReset(&stream);
      } else if (result == Z_DATA_ERROR && between()) {
        stream.avail_in = 0;
        at = file.size();
      } else if (result != Z_OK) {
        return result;
      }
    }
    return static_cast<int>(out.size() - stream.avail_out);
  }

  const InputFile& file;
  std::vector<std::byte> input;
  std::uint64_t at = 0;  // offset of the next compressed byte to read
  z_stream stream{};
  std::uint64_t members = 0;  // members that were decompressed completely
};

ByteStream::ByteStream(const std::filesystem::path& path) : file_(path), buffer_(kBufferBytes) {
  constexpr std::array kMagic = {std::byte{0x1f}, std::byte{0x8b}, std::byte{8}};  // deflate
  std::array<std::byte, 3> begin{};
  if (file_.size() >= begin.size()) file_.read_at(0, begin);
  if (begin != kMagic) {
    if (lower_extension(path) == ".gz")
      throw DataError(path.string() + ": the file is not a gzip file");
    return;
  }
  gunzip_ = std::make_unique<Gunzip>(file_);
}

ByteStream::~ByteStream() = default;

std::uint64_t ByteStream::max_left() const noexcept {
  if (gunzip_) {
    const std::uint64_t most = max_unpacked(file_.size());
    return most > offset() ? most - offset() : 0;
  }
  return file_.size() > offset() ? file_.size() - offset() : 0;
}

std::size_t ByteStream::read_some(std::span<std::byte> out) {
  if (gunzip_) {
    const int count = gunzip_->read(out);
    if (count == Z_MEM_ERROR) throw std::bad_alloc();
    if (count < 0) {
      const char* const text = gunzip_->stream.msg;
      fail_at(base_ + end_,
              std::string("damaged gzip data: ") + (count == Z_BUF_ERROR ? "it ends too early"
                                                    : text               ? text
                                                                         : zError(count)));
    }
    const std::uint64_t unpacked = base_ + end_ + static_cast<std::uint64_t>(count);
    if (unpacked > max_unpacked(file_.size())) {
      fail_at(base_ + end_, "the gzip data unpack to more than 256 times their size");
    }
    return static_cast<std::size_t>(count);
  }
  const std::uint64_t at = base_ + end_;
  const std::uint64_t left = file_.size() > at ? file_.size() - at : 0;
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), left));
  file_.read_at(at, out.first(count));
  return count;
}

// Moves the unread bytes to the front of the buffer and reads more behind them.
bool ByteStream::refill() {
  if (begin_ > 0) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    base_ += begin_;
    end_ -= begin_;
    begin_ = 0;
  }
  if (end_ == buffer_.size()) {
    if (end_ >= kMaxBytesAtOnce) fail_at(base_, "a line or record has more than 64 MiB");
    buffer_.resize(2 * buffer_.size());
  }
  const std::size_t count = read_some(std::span(buffer_).subspan(end_));
  end_ += count;
  return count > 0;
}

bool ByteStream::next_line(std::string_view& line) {
  std::size_t seen = 0;  // unread bytes that hold no line end
  for (;;) {
    const std::byte* const from = buffer_.data() + begin_;
    const std::size_t count = end_ - begin_;
    const void* const found = count > seen ? std::memchr(from + seen, '\n', count - seen) : nullptr;
    if (found == nullptr) {
      seen = count;
      if (refill()) continue;
      if (count == 0) return false;
    }
    const std::byte* const text = buffer_.data() + begin_;
    const std::size_t length =
        found == nullptr ? count
                         : static_cast<std::size_t>(static_cast<const std::byte*>(found) - text);
    line = {reinterpret_cast<const char*>(text), length};
    if (line.ends_with('\r')) line.remove_suffix(1);
    begin_ += found == nullptr ? length : length + 1;
    ++line_;
    return true;
  }
}

std::span<const std::byte> ByteStream::take(std::size_t count) {
  if (count > kMaxBytesAtOnce) fail_at(offset(), "a record has more than 64 MiB");
  while (end_ - begin_ < count) {
    const std::size_t missing = count - (end_ - begin_);
    if (!refill()) {
      fail_at(offset(),
              "the file ends too early: " + std::to_string(missing) + " bytes are missing");
    }
  }
  const std::span<const std::byte> bytes(buffer_.data() + begin_, count);
  begin_ += count;
  return bytes;
}

std::string_view ByteStream::peek(std::size_t count) {
  while (end_ - begin_ < count && refill()) {
  }
  return {reinterpret_cast<const char*>(buffer_.data() + begin_), std::min(count, end_ - begin_)};
}

void ByteStream::skip(std::uint64_t count) {
  while (count > 0) {
    const std::uint64_t step = std::min<std::uint64_t>(count, kBufferBytes);
    static_cast<void>(take(static_cast<std::size_t>(step)));
    count -= step;
  }
}

bool ByteStream::at_end() {
  return begin_ == end_ && !refill();
}

void ByteStream::fail_at(std::uint64_t offset, const std::string& rule) const {
  throw DataError(path().string() + ": offset " + std::to_string(offset) + ": " + rule);
}

void ByteStream::fail_at_line(const std::string& rule) const {
  throw DataError(path().string() + ": line " + std::to_string(line_) + ": " + rule);
}

}  // namespace ptc
