// Compression of one page's payload (spec/container.md#codecs).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "format/container.h"
#include "format/packed_columns.h"

namespace ptc {

/// The columns that a payload may be packed by, none when it has none.
struct PayloadColumns {
  std::uint32_t count = 0;  ///< values of each
  std::span<const PackedColumn> columns;
};

/// Codes page payloads; keeps its context between calls. One per thread.
class PageEncoder {
 public:
  /// @param level  of zstd. @throws std::bad_alloc
  explicit PageEncoder(Codec codec, int level = 1);
  ~PageEncoder();
  PageEncoder(const PageEncoder&) = delete;
  PageEncoder& operator=(const PageEncoder&) = delete;

  /// Stored form of `raw` into `out` and how it was coded: not at all when that does not save at
  /// least a sixteenth. Columns that are given are packed first, where that does not lengthen them.
  Coding encode(std::span<const std::byte> raw, std::vector<std::byte>& out,
                const PayloadColumns& columns = {});

 private:
  [[nodiscard]] bool compress(std::span<const std::byte> from, std::size_t limit,
                              std::vector<std::byte>& out);

  Codec codec_;
  int level_;
  void* context_ = nullptr;        ///< of zstd
  std::vector<std::byte> packed_;  ///< kept between calls
};

/// Decodes page payloads. One per thread.   Memory: a page.
class PageDecoder {
 public:
  /// @throws std::bad_alloc
  PageDecoder();
  ~PageDecoder();
  PageDecoder(const PageDecoder&) = delete;
  PageDecoder& operator=(const PageDecoder&) = delete;

  /// Fills `out`, whose size is the page's raw_bytes.
  /// @param columns  of the page's type; looked at when it is packed
  /// @throws FormatError when the payload does not decode to exactly out.size() bytes
  void decode(Coding coding, std::span<const std::byte> stored, std::span<std::byte> out,
              const PayloadColumns& columns = {});

 private:
  /// Undoes a codec that is not raw. @param least, limit  how many bytes there may be. @return what
  /// was decoded, in `room`
  std::span<const std::byte> expand(Codec codec, std::span<const std::byte> stored,
                                    std::size_t least, std::size_t limit,
                                    std::span<std::byte> room);

  void* context_;
  std::vector<std::byte> packed_;  ///< kept between calls
};

}  // namespace ptc
