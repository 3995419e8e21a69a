// Page compression with zstd and LZ4, one frame or block for each page (spec/container.md#codecs).
//
//   zstd:  one frame, a single segment with its content size and without a dictionary
//   LZ4:   | decoded bytes u32 | one block |
//
// Frame and block say how many bytes they decode to. The decoder compares that number with the page
// before it decodes, so a payload can never write past its room or need memory beyond a page.
#include "format/codec.h"

#include <algorithm>
#include <cstdint>
#include <new>
#include <stdexcept>
#include <string>

#include <lz4.h>
#include <zstd.h>
#include <zstd_errors.h>

#include "format/bytes.h"
#include "format/error.h"

namespace ptc {
namespace {

constexpr char kFrameClause[] = "spec/container.md#codec-frame";
constexpr char kBlockClause[] = "spec/container.md#codec-block";
constexpr int kWindowLog = 20;           // log2 of the greatest page: every frame is one segment
constexpr std::size_t kLengthBytes = 4;  // in front of an LZ4 block

// Returns the number of bytes that a frame declares to decode to. It checks that the payload is
// exactly one frame that needs neither a dictionary nor a window beyond these bytes. A frame begins
// with magic, descriptor (bits 7-6 width of the content size, 5 single segment, 1-0 dictionary) and
// content size.
unsigned long long check_frame(std::span<const std::byte> stored) {
  if (stored.size() < 5 || load<std::uint32_t>(stored.data(), 0) != ZSTD_MAGICNUMBER) {
    throw FormatError(0, kFrameClause, "payload is not a zstd frame");
  }
  const auto descriptor = static_cast<unsigned>(stored[4]);
  if ((descriptor & 0x20) == 0) {
    throw FormatError(4, kFrameClause, "zstd frame is not a single segment");
  }
  if ((descriptor & 0x03) != 0) throw FormatError(4, kFrameClause, "zstd frame has a dictionary");
  const std::size_t frame = ZSTD_findFrameCompressedSize(stored.data(), stored.size());
  if (ZSTD_isError(frame) || frame != stored.size()) {
    throw FormatError(0, kFrameClause, "payload is not exactly one zstd frame");
  }
  return ZSTD_getFrameContentSize(stored.data(), stored.size());
}

// Turns an error of zstd into an exception.
void check(std::size_t result) {
  if (ZSTD_getErrorCode(result) == ZSTD_error_memory_allocation) throw std::bad_alloc();
  if (ZSTD_isError(result)) throw std::invalid_argument(ZSTD_getErrorName(result));
}

}  // namespace

PageEncoder::PageEncoder(Codec codec, int level) : codec_(codec) {
  if (codec_ != Codec::zstd) return;
  ZSTD_CCtx* const context = ZSTD_createCCtx();
  if (context == nullptr) throw std::bad_alloc();
  context_ = context;
  try {
    check(ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, level));
    check(ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, kWindowLog));
  } catch (...) {
    ZSTD_freeCCtx(context);
    throw;
  }
}

PageEncoder::~PageEncoder() {
  ZSTD_freeCCtx(static_cast<ZSTD_CCtx*>(context_));
}

// Compresses into at most `limit` bytes of `out`. Returns false when they do not suffice.
bool PageEncoder::compress(std::span<const std::byte> from, std::size_t limit,
                           std::vector<std::byte>& out) {
  out.resize(limit);
  if (codec_ == Codec::zstd) {
    const std::size_t size = ZSTD_compress2(static_cast<ZSTD_CCtx*>(context_), out.data(),
                                            out.size(), from.data(), from.size());
    if (ZSTD_getErrorCode(size) == ZSTD_error_dstSize_tooSmall) return false;
    check(size);
    out.resize(size);
    return true;
  }
  if (limit <= kLengthBytes) return false;
  store(out.data(), 0, static_cast<std::uint32_t>(from.size()));
  const int size =
      LZ4_compress_default(reinterpret_cast<const char*>(from.data()),
                           reinterpret_cast<char*>(out.data() + kLengthBytes),
                           static_cast<int>(from.size()), static_cast<int>(limit - kLengthBytes));
  out.resize(kLengthBytes + static_cast<std::size_t>(std::max(size, 0)));
  return size > 0;
}

Coding PageEncoder::encode(std::span<const std::byte> raw, std::vector<std::byte>& out,
                           const PayloadColumns& columns) {
  if (codec_ != Codec::raw) {
    // Pack the columns, unless that lengthens them.
    Coding coding{.codec = codec_};
    std::span<const std::byte> from = raw;
    if (!columns.columns.empty()) {
      pack_columns(raw, columns.count, columns.columns, packed_);
      if (packed_.size() <= raw.size()) {
        from = packed_;
        coding.filter = Filter::columns;
      }
    }
    // Compress, unless that saves less than a sixteenth.
    if (compress(from, raw.size() * 15 / 16, out)) return coding;
  }
  out.assign(raw.begin(), raw.end());
  return {};
}

PageDecoder::PageDecoder() : context_(ZSTD_createDCtx()) {
  if (context_ == nullptr) throw std::bad_alloc();
}

PageDecoder::~PageDecoder() {
  ZSTD_freeDCtx(static_cast<ZSTD_DCtx*>(context_));
}

std::span<const std::byte> PageDecoder::expand(Codec codec, std::span<const std::byte> stored,
                                               std::size_t least, std::size_t limit,
                                               std::span<std::byte> room) {
  if (codec == Codec::zstd) {
    const unsigned long long bytes = check_frame(stored);
    if (bytes < least || bytes > limit) {
      throw FormatError(5, kFrameClause, "zstd frame declares a size other than the page's");
    }
    const std::size_t size = ZSTD_decompressDCtx(static_cast<ZSTD_DCtx*>(context_), room.data(),
                                                 bytes, stored.data(), stored.size());
    if (ZSTD_isError(size) || size != bytes)
      throw FormatError(0, kFrameClause, "zstd frame does not decode");
    return room.first(size);
  }
  if (stored.size() <= kLengthBytes)
    throw FormatError(0, kBlockClause, "payload is too short for an LZ4 block");
  const auto bytes = load<std::uint32_t>(stored.data(), 0);
  if (bytes < least || bytes > limit) {
    throw FormatError(0, kBlockClause, "LZ4 block declares a size other than the page's");
  }
  const int size =
      LZ4_decompress_safe(reinterpret_cast<const char*>(stored.data() + kLengthBytes),
                          reinterpret_cast<char*>(room.data()),
                          static_cast<int>(stored.size() - kLengthBytes), static_cast<int>(bytes));
  if (size < 0 || static_cast<std::uint32_t>(size) != bytes) {
    throw FormatError(kLengthBytes, kBlockClause,
                      "LZ4 block does not decode to the size it declares");
  }
  return room.first(bytes);
}

void PageDecoder::decode(Coding coding, std::span<const std::byte> stored, std::span<std::byte> out,
                         const PayloadColumns& columns) {
  if (coding.codec == Codec::raw) {
    if (stored.size() != out.size()) {
      throw FormatError(0, "spec/container.md#page-length",
                        "raw payload has a size other than the page's");
    }
    std::ranges::copy(stored, out.begin());
    return;
  }
  if (coding.filter == Filter::none) {
    static_cast<void>(expand(coding.codec, stored, out.size(), out.size(), out));
    return;
  }
  packed_.resize(out.size());  // packed columns are never longer than the payload
  const std::span<const std::byte> packed = expand(coding.codec, stored, 1, out.size(), packed_);
  try {
    unpack_columns(packed, columns.count, columns.columns, out);
  } catch (const FormatError& error) {
    throw FormatError(0, error.clause(),
                      "packed byte " + std::to_string(error.offset()) + ": " + error.text());
  }
}

}  // namespace ptc
