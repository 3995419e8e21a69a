// Page compression with zstd, one frame a page (spec/container.md#codecs).
#include "format/codec.h"

#include <zstd.h>

#include <algorithm>
#include <cstdint>
#include <new>
#include <stdexcept>

#include "format/bytes.h"
#include "format/error.h"

namespace ptc {
namespace {

constexpr char kFrameClause[] = "spec/container.md#codec-frame";
constexpr int kWindowLog = 20;  // the greatest page: every frame is a single segment

// A frame that decodes to exactly `raw_bytes` without a dictionary or a window beyond them:
// magic, descriptor (bits 7-6 width of the content size, 5 single segment, 1-0 dictionary), size.
void check_frame(std::span<const std::byte> stored, std::size_t raw_bytes) {
  if (stored.size() < 5 || load<std::uint32_t>(stored.data(), 0) != ZSTD_MAGICNUMBER) {
    throw FormatError(0, kFrameClause, "payload is not a zstd frame");
  }
  const auto descriptor = static_cast<unsigned>(stored[4]);
  if ((descriptor & 0x20) == 0) {
    throw FormatError(4, kFrameClause, "zstd frame is not a single segment");
  }
  if ((descriptor & 0x03) != 0) throw FormatError(4, kFrameClause, "zstd frame has a dictionary");
  const unsigned long long content = ZSTD_getFrameContentSize(stored.data(), stored.size());
  if (content != raw_bytes) {
    throw FormatError(5, kFrameClause, "zstd frame declares another size than raw_bytes");
  }
  const std::size_t frame = ZSTD_findFrameCompressedSize(stored.data(), stored.size());
  if (ZSTD_isError(frame) || frame != stored.size()) {
    throw FormatError(0, kFrameClause, "payload is not exactly one zstd frame");
  }
}

void check(std::size_t result) {
  if (ZSTD_isError(result)) throw std::invalid_argument(ZSTD_getErrorName(result));
}

}  // namespace

PageEncoder::PageEncoder(Codec codec, int level) : codec_(codec), level_(level) {
  if (codec_ != Codec::zstd) return;
  ZSTD_CCtx* const context = ZSTD_createCCtx();
  if (context == nullptr) throw std::bad_alloc();
  context_ = context;
  try {
    check(ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, level_));
    check(ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, kWindowLog));
  } catch (...) {
    ZSTD_freeCCtx(context);
    throw;
  }
}

PageEncoder::~PageEncoder() {
  ZSTD_freeCCtx(static_cast<ZSTD_CCtx*>(context_));
}

Codec PageEncoder::encode(std::span<const std::byte> raw, std::vector<std::byte>& out) {
  if (codec_ == Codec::zstd) {
    out.resize(raw.size() * 15 / 16);  // a frame that does not fit is not worth it
    const std::size_t size = ZSTD_compress2(static_cast<ZSTD_CCtx*>(context_), out.data(),
                                            out.size(), raw.data(), raw.size());
    if (!ZSTD_isError(size)) {
      out.resize(size);
      return Codec::zstd;
    }
  }
  out.assign(raw.begin(), raw.end());
  return Codec::raw;
}

PageDecoder::PageDecoder() : context_(ZSTD_createDCtx()) {
  if (context_ == nullptr) throw std::bad_alloc();
}

PageDecoder::~PageDecoder() {
  ZSTD_freeDCtx(static_cast<ZSTD_DCtx*>(context_));
}

void PageDecoder::decode(Codec codec, std::span<const std::byte> stored, std::span<std::byte> out) {
  if (codec == Codec::raw) {
    if (stored.size() != out.size()) {
      throw FormatError(0, "spec/container.md#page-length", "raw payload has another size");
    }
    std::ranges::copy(stored, out.begin());
    return;
  }
  check_frame(stored, out.size());
  const std::size_t size = ZSTD_decompressDCtx(static_cast<ZSTD_DCtx*>(context_), out.data(),
                                               out.size(), stored.data(), stored.size());
  if (ZSTD_isError(size) || size != out.size()) {
    throw FormatError(0, kFrameClause, "zstd frame does not decode");
  }
}

}  // namespace ptc
