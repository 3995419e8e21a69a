// Buffering, lines and gunzip.
#include "engine/io/byte_stream.h"

#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "engine/base/error.h"

namespace ptc {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 18;
constexpr std::uint64_t kMostDeflateRatio = 1032;  // 258 bytes from 2 bits

}  // namespace

struct ByteStream::Gunzip {
  explicit Gunzip(const InputFile& input) {
    const int copy = ::dup(input.descriptor());
    if (copy >= 0) file = gzdopen(copy, "rb");
    if (file != nullptr) {
      gzbuffer(file, kBufferBytes);
      return;
    }
    const int error = copy < 0 ? errno : ENOMEM;
    if (copy >= 0) ::close(copy);
    throw std::system_error(error, std::generic_category(), "gzdopen " + input.path().string());
  }
  ~Gunzip() { gzclose_r(file); }
  Gunzip(const Gunzip&) = delete;
  Gunzip& operator=(const Gunzip&) = delete;

  gzFile file = nullptr;
};

ByteStream::ByteStream(const std::filesystem::path& path) : file_(path), buffer_(kBufferBytes) {
  if (path.extension() != ".gz") return;
  gunzip_ = std::make_unique<Gunzip>(file_);
  // zlib copies what is not packed; a name that says .gz must be.
  if (gzdirect(gunzip_->file) != 0) throw DataError(path.string() + ": not a gzip file");
}

ByteStream::~ByteStream() = default;

std::uint64_t ByteStream::most_left() const noexcept {
  if (gunzip_) {
    const std::uint64_t most = std::min(file_.size(), UINT64_MAX / kMostDeflateRatio);
    return most * kMostDeflateRatio;
  }
  return file_.size() > offset() ? file_.size() - offset() : 0;
}

std::size_t ByteStream::read_some(std::span<std::byte> out) {
  if (gunzip_) {
    const int count = gzread(gunzip_->file, out.data(), static_cast<unsigned>(out.size()));
    int error = Z_OK;
    const char* text = gzerror(gunzip_->file, &error);
    if (error == Z_ERRNO) {
      throw std::system_error(errno, std::generic_category(), "gzread " + path().string());
    }
    if (count < 0 || error != Z_OK)
      fail_at(base_ + end_, std::string("damaged gzip data: ") + text);
    return static_cast<std::size_t>(count);
  }
  const std::uint64_t at = base_ + end_;
  const std::uint64_t left = file_.size() > at ? file_.size() - at : 0;
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), left));
  file_.read_at(at, out.first(count));
  return count;
}

// More bytes behind the unread ones, which move to the front.
bool ByteStream::refill() {
  if (begin_ > 0) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    base_ += begin_;
    end_ -= begin_;
    begin_ = 0;
  }
  if (end_ == buffer_.size()) {
    if (end_ >= kMostBytesAtOnce) fail_at(base_, "a line or record of more than 64 MiB");
    buffer_.resize(2 * buffer_.size());
  }
  const std::size_t count = read_some(std::span(buffer_).subspan(end_));
  end_ += count;
  return count > 0;
}

bool ByteStream::next_line(std::string_view& line) {
  std::size_t seen = 0;
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
  if (count > kMostBytesAtOnce) fail_at(offset(), "a record of more than 64 MiB");
  while (end_ - begin_ < count) {
    const std::size_t missing = count - (end_ - begin_);
    if (!refill()) {
      fail_at(offset(),
              "the file ends too early, " + std::to_string(missing) + " bytes are missing");
    }
  }
  const std::span<const std::byte> bytes(buffer_.data() + begin_, count);
  begin_ += count;
  return bytes;
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
