// The file header and the directory (spec/container.md#file-header, spec/container.md#directory).
//
//   file header   | magic | version | features | uuid | constants | frame | 0 | XXH3 | 0 ... 4095 |
//                 0       8         16         40     56          64      96  120    128
//
//   entry         | offset | stored | raw | payload XXH3 | type | group | records |
//                 0        8        12    16             24     26      28        32
//
// The fields are decoded in the order in which the spec lists the rules, so that damage is told
// apart from another version: magic, length, checksum, version, features, and the rest then.
#include "format/container.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "format/bytes.h"
#include "format/checksum.h"
#include "format/error.h"
#include "format/page_facts.h"

namespace ptc {
namespace {

// The bytes 89 'P' 'T' 'C' 0d 0a 1a 0a, which break when a channel strips the eighth bit, a copy
// translates line ends, or a program stops at 1a.
constexpr std::uint64_t kFileMagic = 0x0a1a0a0d43545089;
constexpr std::uint64_t kHeaderSeed = 0x4441454858435450;  // "PTCXHEAD"
constexpr std::uint32_t kByteOrderMark = 0x01020304;
constexpr std::uint16_t kMajor = 1;
constexpr std::uint8_t kAlignShift = 9;
constexpr std::uint16_t kChecksumXxh3 = 1;
constexpr std::size_t kHeaderHashAt = 120;
constexpr std::uint64_t kKnownIncompat = 0;
constexpr std::size_t kOriginAt = 64;
constexpr std::size_t kEdgeAt = 88;
constexpr double kMaxWhole = 0x1p53;  // doubles hold all whole numbers up to here

void check_constants(const std::byte* p) {
  constexpr char kConstants[] = "spec/container.md#header-constants";
  if (load<std::uint32_t>(p, 12) != kBlockBytes) {
    throw FormatError(12, kConstants, "header_bytes is not 4096");
  }
  if (load<std::uint8_t>(p, 57) != kAlignShift) {
    throw FormatError(57, kConstants, "align_shift is not 9");
  }
  if (load<std::uint16_t>(p, 58) != kChecksumXxh3) {
    throw FormatError(58, kConstants, "checksum is not XXH3-64");
  }
  if (load<std::uint32_t>(p, 60) != kByteOrderMark) {
    throw FormatError(60, kConstants, "byte order mark is not 0x01020304");
  }
}

// Checks that the lattice points of a frame are doubles (spec/morton.md#frame).
void check_frame(const Frame& frame) {
  constexpr char kFrame[] = "spec/container.md#header-frame";
  const auto bits = std::bit_cast<std::uint64_t>(frame.edge);
  const bool power_of_two = (bits & 0x800fffffffffffff) == 0;
  if (!power_of_two || !(frame.edge >= 0x1p-960) || !(frame.edge <= 0x1p1010)) {
    throw FormatError(kEdgeAt, kFrame, "edge is not a power of two from 2^-960 to 2^1010");
  }
  for (const double origin : frame.origin) {
    const double steps = origin / frame.unit();
    if (!(steps >= -kMaxWhole && steps <= kMaxWhole - 0x1p42) || std::rint(steps) != steps) {
      throw FormatError(kOriginAt, kFrame,
                        "origin is not a multiple of the unit, or is beyond 2^53 units");
    }
  }
}

void check_zero(std::span<const std::byte> block, std::size_t first, std::size_t last) {
  const std::size_t found = first + first_nonzero(block.subspan(first, last - first));
  if (found != last) {
    throw FormatError(found, "spec/container.md#header-zero", "reserved byte is not zero");
  }
}

}  // namespace

Uuid uuid_of(std::span<const std::byte> text) noexcept {
  return std::bit_cast<Uuid>(xxh3_128(text));
}

void encode_identity(const FileHeader& header, std::span<std::byte, kBlockBytes> block) noexcept {
  std::byte* const p = block.data();
  store(p, 8, header.major);
  store(p, 10, header.minor);
  store(p, 12, static_cast<std::uint32_t>(kBlockBytes));
  store(p, 16, header.feature_incompat);
  store(p, 24, header.feature_ro_compat);
  store(p, 32, header.feature_compat);
  std::ranges::copy(header.uuid, p + 40);
  store(p, 56, header.page_shift);
  store(p, 57, kAlignShift);
  store(p, 58, kChecksumXxh3);
  store(p, 60, kByteOrderMark);
  store(p, kOriginAt, header.frame.origin);
  store(p, kEdgeAt, header.frame.edge);
}

Block encode_file_header(const FileHeader& header) {
  Block block{};
  store(block.data(), 0, kFileMagic);
  encode_identity(header, block);
  store(block.data(), kHeaderHashAt, xxh3_64(std::span(block).first(kHeaderHashAt), kHeaderSeed));
  return block;
}

FileHeader decode_file_header(std::span<const std::byte> bytes) {
  // Check that the block is a whole header.
  if (bytes.size() < 8 || load<std::uint64_t>(bytes.data(), 0) != kFileMagic) {
    throw FormatError(0, "spec/container.md#header-magic", "not a PTCX file");
  }
  if (bytes.size() < kBlockBytes) {
    throw FormatError(bytes.size(), "spec/container.md#header-length", "file ends in its header");
  }
  const std::byte* const p = bytes.data();
  const std::uint64_t hash = xxh3_64(bytes.first(kHeaderHashAt), kHeaderSeed);
  if (load<std::uint64_t>(p, kHeaderHashAt) != hash) {
    throw FormatError(kHeaderHashAt, "spec/container.md#header-checksum",
                      "file header's checksum is wrong");
  }

  // Check that this version and its features are known.
  FileHeader header;
  header.major = load<std::uint16_t>(p, 8);
  header.minor = load<std::uint16_t>(p, 10);
  if (header.major != kMajor) {
    throw FormatError(8, "spec/container.md#header-version",
                      "format version " + std::to_string(header.major) + " is not supported");
  }
  header.feature_incompat = load<std::uint64_t>(p, 16);
  header.feature_ro_compat = load<std::uint64_t>(p, 24);
  header.feature_compat = load<std::uint64_t>(p, 32);
  if ((header.feature_incompat & ~kKnownIncompat) != 0) {
    throw FormatError(16, "spec/container.md#header-features",
                      "file needs a feature that this program does not know");
  }

  // Read and check everything else.
  check_constants(p);
  std::ranges::copy(bytes.subspan(40, 16), header.uuid.begin());
  header.page_shift = load<std::uint8_t>(p, 56);
  if (header.page_shift < 12 || header.page_shift > 20) {
    throw FormatError(56, "spec/container.md#header-page-shift", "page_shift is not 12 to 20");
  }
  header.frame = {load<std::array<double, 3>>(p, kOriginAt), load<double>(p, kEdgeAt)};
  check_frame(header.frame);
  check_zero(bytes, kEdgeAt + 8, kHeaderHashAt);
  check_zero(bytes, kHeaderHashAt + 8, kBlockBytes);
  return header;
}

FileHeader decode_repeated_header(std::span<const std::byte> superblock) {
  Block block{};
  store(block.data(), 0, kFileMagic);
  std::ranges::copy(superblock.subspan(8, kHeaderHashAt - 8), block.begin() + 8);
  store(block.data(), kHeaderHashAt, xxh3_64(std::span(block).first(kHeaderHashAt), kHeaderSeed));
  return decode_file_header(block);
}

void encode_directory_entry(const DirectoryEntry& entry,
                            std::span<std::byte, kDirectoryEntryBytes> out) noexcept {
  std::byte* const p = out.data();
  store(p, 0, entry.offset);
  store(p, 8, entry.stored_bytes);
  store(p, 12, entry.raw_bytes);
  store(p, 16, entry.payload_xxh3);
  store(p, 24, static_cast<std::uint16_t>(entry.type));
  store(p, 26, entry.group);
  store(p, 28, entry.record_count);
}

DirectoryEntry decode_directory_entry(std::span<const std::byte> bytes, const FileHeader& file,
                                      std::uint64_t file_bytes) {
  if (bytes.size() < kDirectoryEntryBytes) {
    throw FormatError(bytes.size(), "spec/container.md#directory", "directory entry is truncated");
  }
  const std::byte* const p = bytes.data();

  // Read the fields and check those that a page header has, too.
  DirectoryEntry entry;
  entry.offset = load<std::uint64_t>(p, 0);
  entry.stored_bytes = load<std::uint32_t>(p, 8);
  entry.raw_bytes = load<std::uint32_t>(p, 12);
  entry.payload_xxh3 = load<std::uint64_t>(p, 16);
  entry.group = load<std::uint16_t>(p, 26);
  entry.record_count = load<std::uint32_t>(p, 28);
  const auto type = load<std::uint16_t>(p, 24);
  check_page_facts({type, entry.group, entry.stored_bytes, entry.raw_bytes, entry.record_count},
                   file);
  entry.type = static_cast<PageType>(type);
  if (entry.type == PageType::directory) {
    throw FormatError(24, "spec/container.md#directory-listing", "directory lists itself");
  }

  // Check that the page lies between the header and the superblocks.
  constexpr char kExtent[] = "spec/container.md#directory-extent";
  if (entry.offset % kSectorBytes != 0) {
    throw FormatError(0, kExtent, "page does not start on a sector");
  }
  const std::uint64_t end = file_bytes < 2 * kBlockBytes ? 0 : file_bytes - 2 * kBlockBytes;
  if (entry.offset < kBlockBytes || entry.offset > end ||
      round_up(kPageHeaderBytes + entry.stored_bytes, kSectorBytes) > end - entry.offset) {
    throw FormatError(0, kExtent, "page lies outside the file's pages");
  }
  return entry;
}

std::uint32_t directory_entries_per_page(const FileHeader& file) noexcept {
  return payload_limit(file) / static_cast<std::uint32_t>(kDirectoryEntryBytes);
}

std::uint64_t directory_bytes(const FileHeader& file, std::uint32_t page_count) noexcept {
  const std::uint32_t full = directory_entries_per_page(file);
  const std::uint64_t rest = page_count % full;
  const std::uint64_t last =
      rest == 0 ? 0 : round_up(kPageHeaderBytes + rest * kDirectoryEntryBytes, kBlockBytes);
  return (std::uint64_t{page_count / full} << file.page_shift) + last;
}

}  // namespace ptc
