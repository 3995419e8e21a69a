// Decoding of a chunk of compressed points into the records of the LAS format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/io/laz/layout.h"

namespace ptc::laz {

/// Decodes chunks, one after another. Every chunk stands for itself.
class ChunkDecoder {
 public:
  virtual ~ChunkDecoder() = default;
  /// Begins a chunk.
  /// @param padded  the bytes of the chunk and kSlackBytes more that may have any value; they must
  ///                stay until the last decode()
  /// @param points  number of points of the chunk, at least 1
  /// @throws LazError
  virtual void start(std::span<const std::byte> padded, std::uint64_t points) = 0;
  /// Fills `out` with the next records: a whole number of them, and no more than are left.
  /// @throws LazError when the chunk is damaged or cut off
  virtual void decode(std::span<std::byte> out) = 0;
  /// Checks, after the last record, that the chunk has no byte more.
  /// @throws LazError
  virtual void finish() const = 0;
};

/// Makes a decoder of the chunks of a file.
[[nodiscard]] std::unique_ptr<ChunkDecoder> make_chunk_decoder(const Layout& layout);

}  // namespace ptc::laz
