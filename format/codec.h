// Compression of one page's payload (spec/container.md#codecs).
//
//   encode:  payload --pack columns--> packed --zstd or LZ4--> stored
//   decode:  stored --zstd or LZ4--> packed --unpack columns--> payload
//
// Payloads without columns skip the middle step. A payload that hardly compresses is stored raw.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "format/container.h"
#include "format/packed_columns.h"

namespace ptc {

/// Describes the columns by which a payload may be packed.
struct PayloadColumns {
  std::uint32_t count = 0;                ///< number of values in each column
  std::span<const PackedColumn> columns;  ///< empty when the payload has no columns
};

/// Compresses page payloads.
///
/// Threads: one encoder per thread, because the context of the codec is kept between calls.
class PageEncoder {
 public:
  /// Prepares an encoder for one codec.
  /// @param level  compression level of zstd; the other codecs ignore it
  /// @throws std::bad_alloc when there is no memory for the context of zstd; std::invalid_argument
  ///         when zstd refuses a parameter
  explicit PageEncoder(Codec codec, int level = 1);
  ~PageEncoder();
  PageEncoder(const PageEncoder&) = delete;
  PageEncoder& operator=(const PageEncoder&) = delete;

  /// Writes the stored form of a payload into `out` and returns how it was coded. The payload is
  /// stored raw when compression saves less than a sixteenth. If columns are given, they are packed
  /// first, unless packing would lengthen the payload.
  /// @param raw  the payload as readers decode it; it must not alias `out`
  /// @throws std::bad_alloc when there is no memory; std::invalid_argument when the columns do not
  ///         match the size of the payload or zstd reports another error
  Coding encode(std::span<const std::byte> raw, std::vector<std::byte>& out,
                const PayloadColumns& columns = {});

 private:
  [[nodiscard]] bool compress(std::span<const std::byte> from, std::size_t limit,
                              std::vector<std::byte>& out);

  Codec codec_;
  void* context_ = nullptr;        ///< ZSTD_CCtx; null for the other codecs
  std::vector<std::byte> packed_;  ///< packed columns; the buffer is kept between calls
};

/// Decompresses page payloads.
///
/// Memory: one page for packed columns, and the context of zstd.   Threads: one decoder per thread.
class PageDecoder {
 public:
  /// Creates the context of zstd. @throws std::bad_alloc when there is no memory for it
  PageDecoder();
  ~PageDecoder();
  PageDecoder(const PageDecoder&) = delete;
  PageDecoder& operator=(const PageDecoder&) = delete;

  /// Decodes a stored payload into `out`, whose size must be the raw_bytes of the page.
  /// @param columns  columns of this type of page; they are used only when the payload is packed
  /// @throws FormatError when the payload does not decode to exactly out.size() bytes
  void decode(Coding coding, std::span<const std::byte> stored, std::span<std::byte> out,
              const PayloadColumns& columns = {});

 private:
  /// Undoes a codec other than raw.
  /// @param least, limit  bounds on the number of decoded bytes that the payload may declare
  /// @param room          buffer of at least `limit` bytes
  /// @return the decoded bytes, at the front of `room`
  std::span<const std::byte> expand(Codec codec, std::span<const std::byte> stored,
                                    std::size_t least, std::size_t limit,
                                    std::span<std::byte> room);

  void* context_;                  ///< ZSTD_DCtx
  std::vector<std::byte> packed_;  ///< packed columns; the buffer is kept between calls
};

}  // namespace ptc
