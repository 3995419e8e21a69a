// What the header of a LAZ file says about its compression: the "laszip encoded" record and the
// chunk table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace ptc::laz {

/// The greatest number of points of a chunk that is read.
inline constexpr std::uint64_t kMaxChunkPoints = std::uint64_t{1} << 24;

/// How the points of a file are compressed.
enum class Compressor : std::uint8_t {
  pointwise = 1,  ///< all points in one stream, no chunk table
  chunked = 2,    ///< chunks of one stream each
  layered = 3     ///< chunks of one stream for each group of fields
};

/// How the records of a file are compressed.
struct Layout {
  Compressor compressor = Compressor::chunked;
  unsigned format = 0;  ///< of the points, 0 to 10
  std::size_t record_bytes = 0;
  /// Points of each chunk but the last; nothing when the chunk table has their number.
  std::optional<std::uint32_t> chunk_points;
  /// Whether colours, wave packets and extra bytes are predicted from the last point of their own
  /// scanner channel. So it is in version 4 of layered items. In version 3 their channel is 0
  /// unless the channel of the point has just changed, and the first value after a change to a
  /// channel that was seen before is predicted from the last one of the former channel, and takes
  /// its place.
  bool own_channel = false;
};

/// Returns the bytes of a record of a point format of 0 to 10, without extra bytes.
[[nodiscard]] std::size_t format_bytes(unsigned format) noexcept;
/// Says whether a point format has GPS times, colours, near infrared, wave packets.
[[nodiscard]] bool has_time(unsigned format) noexcept;
[[nodiscard]] bool has_rgb(unsigned format) noexcept;
[[nodiscard]] bool has_nir(unsigned format) noexcept;
[[nodiscard]] bool has_wave_packet(unsigned format) noexcept;

/// Decodes the payload of the record "laszip encoded", number 22204.
/// @param format        point format of the file, 0 to 10
/// @param record_bytes  length of a point record, at least format_bytes(format)
/// @throws LazError when it breaks a rule, does not fit the point format or needs what this decoder
///         does not support
[[nodiscard]] Layout decode_layout(std::span<const std::byte> payload, unsigned format,
                                   std::size_t record_bytes);

/// Where a chunk lies in its file, and its points.
struct Chunk {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::uint64_t points = 0;
};

/// Decodes a chunk table.
/// @param table   the bytes of the file from the table on, and kSlackBytes more that may have any
///                value
/// @param points  number of points of the file, at least 1
/// @param offset  of the first chunk
/// @param end     of the last chunk, where the table begins
/// @return chunks that hold all points and follow one another from `offset` to `end`
/// @throws LazError
[[nodiscard]] std::vector<Chunk> decode_chunk_table(std::span<const std::byte> table,
                                                    const Layout& layout, std::uint64_t points,
                                                    std::uint64_t offset, std::uint64_t end);

}  // namespace ptc::laz
