// Compression of one page's payload (spec/container.md#codecs).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "format/container.h"

namespace ptc {

/// Compresses page payloads; keeps its context between calls. One per thread.
class PageEncoder {
 public:
  /// @param level  of zstd. @throws std::bad_alloc
  explicit PageEncoder(Codec codec, int level = 1);
  ~PageEncoder();
  PageEncoder(const PageEncoder&) = delete;
  PageEncoder& operator=(const PageEncoder&) = delete;

  /// Stored form of `raw` into `out` and the codec that was used: raw when compression does not
  /// save at least a sixteenth.
  Codec encode(std::span<const std::byte> raw, std::vector<std::byte>& out);

 private:
  Codec codec_;
  int level_;
  void* context_ = nullptr;
};

/// Decodes page payloads. One per thread.
class PageDecoder {
 public:
  /// @throws std::bad_alloc
  PageDecoder();
  ~PageDecoder();
  PageDecoder(const PageDecoder&) = delete;
  PageDecoder& operator=(const PageDecoder&) = delete;

  /// Fills `out`, whose size is the page's raw_bytes.
  /// @throws FormatError when the payload does not decode to exactly out.size() bytes
  void decode(Codec codec, std::span<const std::byte> stored, std::span<std::byte> out);

 private:
  void* context_;
};

}  // namespace ptc
