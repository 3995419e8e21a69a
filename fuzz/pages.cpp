// Property, for any bytes: the decoders of file header, superblock, page header, directory entry,
// meta, point and node pages, codecs and packed columns return values that can be read completely,
// or throw FormatError. What has exactly one encoding is encoded as it was: both headers, entry,
// superblock, meta page and points.
//
// The first four bytes are the number of records (two bytes), the codec, and the filter with the
// bytes of a point and of a page; a payload follows. Header, superblock and page header are decoded
// twice, as the bytes are and with their magic and checksum repaired, because the fuzzer finds no
// checksum.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "format/bytes.h"
#include "format/checksum.h"
#include "format/codec.h"
#include "format/container.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "format/schema.h"
#include "fuzz/require.h"

namespace {

using ptc::fuzz::require;
using Bytes = std::span<const std::byte>;

// Runs a body, which may throw FormatError but nothing else.
template <class Body>
void expect_format_error(const Body& body) {
  try {
    body();
  } catch (const ptc::FormatError&) {
  }
}

// Returns the first N bytes, and zeros for those that are missing.
template <std::size_t N>
std::array<std::byte, N> front(Bytes bytes) {
  std::array<std::byte, N> out{};
  std::ranges::copy(bytes.first(std::min(N, bytes.size())), out.begin());
  return out;
}

void read_header(Bytes bytes) {
  const ptc::FileHeader header = ptc::decode_file_header(bytes);
  require(std::ranges::equal(ptc::encode_file_header(header), bytes.first(ptc::kBlockBytes)));
}

void read_superblock(Bytes bytes, const ptc::FileHeader& file, std::uint64_t file_bytes) {
  const ptc::Superblock superblock = ptc::decode_superblock(bytes, file, file_bytes);
  require(std::ranges::equal(ptc::encode_superblock(superblock), bytes.first(ptc::kBlockBytes)));
}

void read_page_header(Bytes bytes, const ptc::FileHeader& file) {
  const ptc::PageHeader page = ptc::decode_page_header(bytes, file);
  std::array<std::byte, ptc::kPageHeaderBytes> again;
  ptc::encode_page_header(page, file.uuid, again);
  require(std::ranges::equal(again, bytes.first(again.size())));
}

void read_entry(Bytes bytes, const ptc::FileHeader& file) {
  const ptc::DirectoryEntry entry =
      ptc::decode_directory_entry(bytes, file, std::uint64_t{1} << 40);
  std::array<std::byte, ptc::kDirectoryEntryBytes> again;
  ptc::encode_directory_entry(entry, again);
  require(std::ranges::equal(again, bytes.first(again.size())));
}

// Decodes the structures that a magic and a checksum guard, with both repaired.
void read_repaired(Bytes bytes, const ptc::FileHeader& file) {
  ptc::Block header = front<ptc::kBlockBytes>(bytes);
  const ptc::Block good = ptc::encode_file_header(file);
  std::ranges::copy(std::span(good).first(10), header.begin());  // magic and major
  ptc::store(header.data(), 120, ptc::xxh3_64(std::span(header).first(120), 0x4441454858435450));
  expect_format_error([&] { read_header(header); });

  ptc::Block superblock = front<ptc::kBlockBytes>(bytes);
  constexpr std::uint64_t kMagic = 0x5250555358435450;  // "PTCXSUPR", also the seed
  ptc::store(superblock.data(), 0, kMagic);
  std::ranges::copy(std::span(good).subspan(8, 112), superblock.begin() + 8);
  ptc::store(superblock.data(), 4088, ptc::xxh3_64(std::span(superblock).first(4088), kMagic));
  const auto file_bytes = ptc::load<std::uint64_t>(superblock.data(), 120);
  expect_format_error([&] { read_superblock(superblock, file, file_bytes); });

  auto page = front<ptc::kPageHeaderBytes>(bytes);
  ptc::store(page.data(), 0, ptc::kPageMagic);
  std::array<std::byte, 22> salt{};
  std::ranges::copy(file.uuid, salt.begin());
  std::memcpy(&salt[16], &page[8], 4);
  std::memcpy(&salt[20], &page[4], 2);
  ptc::store(page.data(), 56, ptc::xxh3_64(std::span(page).first(56), ptc::xxh3_64(salt)));
  expect_format_error([&] { read_page_header(page, file); });
}

// Decodes a meta page, and makes the void pages and the packed columns of its channel groups.
void read_meta(Bytes bytes, std::uint8_t point_bytes) {
  const ptc::Meta meta = ptc::decode_meta(bytes, point_bytes);
  require(std::ranges::equal(ptc::encode_meta(meta, point_bytes), bytes));
  for (const std::uint8_t group : ptc::channel_groups(meta.channels)) {
    const std::size_t point = ptc::group_point_bytes(meta.channels, group);
    require(point >= 1 && point <= point_bytes);
    std::vector<std::byte> payload(3 * point);
    ptc::fill_void(meta.channels, group, payload);
    std::size_t bits = 0;
    for (const ptc::PackedColumn& column : ptc::packed_group_columns(meta.channels, group))
      bits += column.bits;
    require(bits == 8 * point);
  }
}

void read_nodes(Bytes bytes, std::uint32_t count, bool may_emit) {
  const ptc::NodePage page(bytes, count, 1000, 1'000'000, may_emit);
  for (std::uint32_t slot = 0; slot < page.size(); ++slot) {
    const ptc::NodeGroup group = page.decode(slot);
    require(page[slot].emits() == ptc::emits_light(group) && (may_emit || !page[slot].emits()));
    require(group.level >= 0 && group.level <= ptc::kMaxLevel && !group.children.empty());
  }
}

void read_points(Bytes bytes, std::uint32_t count, std::uint8_t point_bytes) {
  const ptc::PointPage page(bytes, count, point_bytes);
  page.verify();
  std::vector<ptc::PointRecord> points(page.size());
  for (std::uint32_t i = 0; i < page.size(); ++i) points[i] = page[i];
  require(std::ranges::equal(ptc::encode_point_page(points, point_bytes), bytes));
}

void decode_payload(Bytes bytes, std::uint32_t count, ptc::Coding coding,
                    std::uint8_t point_bytes) {
  std::vector<std::byte> payload(std::size_t{point_bytes} * count);
  ptc::PageDecoder().decode(coding, bytes, payload,
                            {count, ptc::packed_point_columns(point_bytes)});
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 4) return 0;
  const Bytes bytes(reinterpret_cast<const std::byte*>(data), size);
  const Bytes body = bytes.subspan(4);
  const std::uint32_t count = data[0] | std::uint32_t{data[1]} << 8;
  ptc::FileHeader file;
  file.point_bytes = data[3] / 2 % 2 == 0 ? ptc::kPointBytes : ptc::kEmittingPointBytes;
  file.page_shift = static_cast<std::uint8_t>(12 + data[3] / 4 % 9);
  const bool may_emit = file.point_bytes == ptc::kEmittingPointBytes;

  // Decode the structures around the pages.
  expect_format_error([&] { read_header(bytes); });
  expect_format_error([&] { read_superblock(bytes, file, size); });
  expect_format_error([&] { read_page_header(bytes, file); });
  expect_format_error([&] { read_entry(body, file); });
  read_repaired(body, file);

  // Decode payloads.
  expect_format_error([&] { read_meta(body, file.point_bytes); });
  expect_format_error([&] { read_nodes(body, count, may_emit); });
  expect_format_error([&] { read_points(body, count, file.point_bytes); });
  const ptc::Coding coding{static_cast<ptc::Codec>(data[2] % 3),
                           static_cast<ptc::Filter>(data[3] % 2)};
  if (count > 0 && coding.codec != ptc::Codec::raw) {
    expect_format_error([&] { decode_payload(body, count, coding, file.point_bytes); });
  }
  return 0;
}
