// Decoding of the "laszip encoded" record and of the chunk table.
//
//   record   compressor u16 | coder u16 | version u8 u8 u16 | options u32 | points of a chunk i32 |
//            two i64 | n u16 | n times: type u16, bytes u16, version u16
//   table    version u32 = 0 | chunks u32 | arithmetic code: for each chunk its points, where they
//            vary, and its bytes
//
// The items of the record must be those that the point format asks for, in the order of a record.
// Source: LASzip VLR, in "LASzip: lossless compression of LiDAR data", PE&RS 79(2), 2013.
#include "engine/io/laz/layout.h"

#include <array>
#include <cstring>
#include <string>

#include "engine/io/laz/arithmetic.h"
#include "engine/io/laz/error.h"
#include "engine/io/laz/integer.h"
#include "format/bytes.h"

namespace ptc::laz {
namespace {

constexpr std::size_t kFixedBytes = 34;  // of the record, before its items
constexpr std::size_t kItemBytes = 6;
constexpr std::size_t kTableHeaderBytes = 8;

struct Item {
  unsigned type = 0;
  std::size_t bytes = 0;
};

constexpr std::array<const char*, 15> kItemNames = {
    "BYTE",  "SHORT",        "INT",     "LONG",  "FLOAT",    "DOUBLE",       "POINT10", "GPSTIME11",
    "RGB12", "WAVEPACKET13", "POINT14", "RGB14", "RGBNIR14", "WAVEPACKET14", "BYTE14"};
constexpr unsigned kWavePacket13 = 9;

// Returns the items of a record.
std::vector<Item> items_of(unsigned format, std::size_t record_bytes) {
  std::vector<Item> items;
  if (format <= 5) {
    items.push_back({6, 20});
    if (has_time(format)) items.push_back({7, 8});
    if (has_rgb(format)) items.push_back({8, 6});
    if (has_wave_packet(format)) items.push_back({kWavePacket13, 29});
  } else {
    items.push_back({10, 30});
    if (has_nir(format)) {
      items.push_back({12, 8});
    } else if (has_rgb(format)) {
      items.push_back({11, 6});
    }
    if (has_wave_packet(format)) items.push_back({13, 29});
  }
  const std::size_t extra = record_bytes - format_bytes(format);
  if (extra > 0) items.push_back({format <= 5 ? 0U : 14U, extra});
  return items;
}

std::string item_name(unsigned type) {
  return type < kItemNames.size() ? kItemNames[type] : "number " + std::to_string(type);
}

// Returns the version that the items have; all but the wave packet of formats 4 and 5 share it.
// That has version 1, or 2 by writers that give all items the same number; the code is the same.
unsigned decode_items(std::span<const std::byte> payload, unsigned format,
                      std::size_t record_bytes) {
  const std::vector<Item> expected = items_of(format, record_bytes);
  if (payload.size() / kItemBytes != expected.size() || payload.size() % kItemBytes != 0) {
    throw LazError("the laszip record does not have the items of point format " +
                   std::to_string(format) + " and its extra bytes");
  }
  unsigned version = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const auto type = load<std::uint16_t>(payload.data(), i * kItemBytes);
    const auto bytes = load<std::uint16_t>(payload.data(), i * kItemBytes + 2);
    const unsigned item_version = load<std::uint16_t>(payload.data(), i * kItemBytes + 4);
    if (type != expected[i].type || bytes != expected[i].bytes) {
      throw LazError("the laszip record has item " + item_name(type) + " of " +
                     std::to_string(bytes) + " bytes where point format " + std::to_string(format) +
                     " needs " + item_name(expected[i].type) + " of " +
                     std::to_string(expected[i].bytes));
    }
    const bool is_wave_packet = type == kWavePacket13;
    const bool known = is_wave_packet ? item_version == 1 || item_version == 2
                       : format <= 5  ? item_version == 2
                                      : item_version == 3 || item_version == 4;
    if (!known || (i > 0 && !is_wave_packet && item_version != version)) {
      throw LazError("item " + item_name(type) + " of version " + std::to_string(item_version) +
                     " is not supported");
    }
    if (!is_wave_packet) version = item_version;
  }
  return version;
}

}  // namespace

std::size_t format_bytes(unsigned format) noexcept {
  constexpr std::array<std::uint8_t, 11> kBytes = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
  return kBytes[format];
}

bool has_time(unsigned format) noexcept {
  return format != 0 && format != 2;
}

bool has_rgb(unsigned format) noexcept {
  return format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10;
}

bool has_nir(unsigned format) noexcept {
  return format == 8 || format == 10;
}

bool has_wave_packet(unsigned format) noexcept {
  return format == 4 || format == 5 || format == 9 || format == 10;
}

Layout decode_layout(std::span<const std::byte> payload, unsigned format,
                     std::size_t record_bytes) {
  if (payload.size() < kFixedBytes) throw LazError("the laszip record is too short");
  Layout layout;
  layout.format = format;
  layout.record_bytes = record_bytes;

  // Decode the compressor.
  const auto compressor = load<std::uint16_t>(payload.data(), 0);
  if (compressor < 1 || compressor > 3)
    throw LazError("compressor " + std::to_string(compressor) + " is not supported");
  layout.compressor = static_cast<Compressor>(compressor);
  if ((layout.compressor == Compressor::layered) != (format >= 6)) {
    throw LazError("compressor " + std::to_string(compressor) + " for point format " +
                   std::to_string(format) + " is not supported");
  }
  const auto coder = load<std::uint16_t>(payload.data(), 2);
  if (coder != 0) throw LazError("coder " + std::to_string(coder) + " is not supported");

  // Decode the size of chunks.
  const auto chunk_points = load<std::uint32_t>(payload.data(), 12);
  const bool vary = chunk_points == 0xffffffffU;
  if (layout.compressor != Compressor::pointwise && !vary) {
    if (chunk_points == 0) throw LazError("the laszip record has chunks of no points");
    layout.chunk_points = chunk_points;
  }

  // Decode the items.
  const std::size_t items = load<std::uint16_t>(payload.data(), 32);
  if (payload.size() - kFixedBytes < items * kItemBytes)
    throw LazError("the laszip record is too short for its items");
  const auto described = payload.subspan(kFixedBytes, items * kItemBytes);
  layout.own_channel = decode_items(described, format, record_bytes) == 4;
  return layout;
}

std::vector<Chunk> decode_chunk_table(std::span<const std::byte> table, const Layout& layout,
                                      std::uint64_t points, std::uint64_t offset,
                                      std::uint64_t end) {
  // Check the number of chunks against the points and the bytes.
  if (table.size() < kTableHeaderBytes + kSlackBytes) throw LazError("the chunk table is cut off");
  if (load<std::uint32_t>(table.data(), 0) != 0)
    throw LazError("the version of the chunk table is not 0");
  const std::uint64_t count = load<std::uint32_t>(table.data(), 4);
  if (count > (end - offset) / layout.record_bytes)
    throw LazError("the chunk table has more chunks than the file can hold");
  if (layout.chunk_points && count != (points - 1) / *layout.chunk_points + 1) {
    throw LazError("the chunk table has " + std::to_string(count) + " chunks, but " +
                   std::to_string(points) + " points make " +
                   std::to_string((points - 1) / *layout.chunk_points + 1));
  }

  // Decode the points and bytes of each chunk.
  ArithmeticDecoder in;
  in.start(table.subspan(kTableHeaderBytes, table.size() - kTableHeaderBytes - kSlackBytes));
  IntegerDecoder integer(32, 2);
  std::vector<Chunk> chunks;
  std::uint32_t last_points = 0;
  std::uint32_t last_bytes = 0;
  std::uint64_t points_left = points;
  for (std::uint64_t i = 0; i < count; ++i) {
    Chunk chunk;
    chunk.offset = offset;
    if (layout.chunk_points) {
      chunk.points = std::min<std::uint64_t>(*layout.chunk_points, points_left);
    } else {
      last_points =
          static_cast<std::uint32_t>(integer.decode(in, static_cast<std::int32_t>(last_points), 0));
      chunk.points = last_points;
    }
    last_bytes =
        static_cast<std::uint32_t>(integer.decode(in, static_cast<std::int32_t>(last_bytes), 1));
    chunk.bytes = last_bytes;
    if (!in.ok()) throw LazError("the chunk table is cut off or damaged");
    if (chunk.points > points_left || chunk.bytes > end - offset) {
      throw LazError("chunk " + std::to_string(i) + " has more points or bytes than the file");
    }
    if (chunk.points > kMaxChunkPoints) {
      throw LazError("chunk " + std::to_string(i) + " has " + std::to_string(chunk.points) +
                     " points, which is more than 2^24");
    }
    points_left -= chunk.points;
    offset += chunk.bytes;
    if (chunk.points > 0) chunks.push_back(chunk);  // a chunk without points is only bytes
  }
  if (points_left > 0)
    throw LazError("the chunk table has " + std::to_string(points_left) + " points too few");
  if (offset != end) throw LazError("the chunks do not end where the chunk table begins");
  return chunks;
}

}  // namespace ptc::laz
