// The file header and the directory (spec/container.md#file-header, spec/container.md#directory).
//
//   file header   | magic | version | features | uuid | constants | frame | 0 | XXH3 | 0 ... 4095 |
//                 0       8         16         40     56          64      96  120    128
//
//   entry   | offset | stored | raw | payload XXH3 | first_key | records | type | group | level | 0
//   |
//           0        8        12    16             24          32        36     37      38      39
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
constexpr std::uint64_t kKnownIncompat = kReleaseFeature | kPartsFeature;
constexpr std::size_t kUuidAt = 40;
constexpr double kMaxWhole = 0x1p53;  // doubles hold all whole numbers up to here

namespace field {
constexpr Field<std::uint64_t> kMagic{0};
constexpr Field<std::uint16_t> kMajor{8};
constexpr Field<std::uint16_t> kMinor{10};
constexpr Field<std::uint32_t> kHeaderBytes{12};
constexpr Field<std::uint64_t> kIncompat{16};
constexpr Field<std::uint64_t> kReadOnly{24};
constexpr Field<std::uint64_t> kCompat{32};
constexpr Field<std::uint8_t> kPageShift{56};
constexpr Field<std::uint8_t> kAlignShift{57};
constexpr Field<std::uint16_t> kChecksum{58};
constexpr Field<std::uint32_t> kByteOrder{60};
constexpr Field<std::array<double, 3>> kOrigin{64};
constexpr Field<double> kEdge{88};
constexpr Field<std::uint8_t> kPointBytes{96};
constexpr Field<std::uint64_t> kHash{120};
}  // namespace field

namespace entry_field {
constexpr Field<std::uint64_t> kOffset{0};
constexpr Field<std::uint32_t> kStoredBytes{8};
constexpr Field<std::uint32_t> kRawBytes{12};
constexpr Field<std::uint64_t> kPayloadXxh3{16};
constexpr Field<std::uint64_t> kFirstKey{24};
constexpr Field<std::uint32_t> kRecordCount{32};
constexpr Field<std::uint8_t> kType{36};
constexpr Field<std::uint8_t> kGroup{37};
constexpr Field<std::uint8_t> kLevel{38};
constexpr Field<std::uint8_t> kReserved{39};
}  // namespace entry_field

void check_constants(const std::byte* p) {
  constexpr char kConstants[] = "spec/container.md#header-constants";
  if (field::kHeaderBytes.of(p) != kBlockBytes) {
    throw FormatError(field::kHeaderBytes.at, kConstants, "header_bytes is not 4096");
  }
  if (field::kAlignShift.of(p) != kAlignShift) {
    throw FormatError(field::kAlignShift.at, kConstants, "align_shift is not 9");
  }
  if (field::kChecksum.of(p) != kChecksumXxh3) {
    throw FormatError(field::kChecksum.at, kConstants, "checksum is not XXH3-64");
  }
  if (field::kByteOrder.of(p) != kByteOrderMark) {
    throw FormatError(field::kByteOrder.at, kConstants, "byte order mark is not 0x01020304");
  }
}

// Checks that the lattice points of a frame are doubles (spec/morton.md#frame).
void check_frame(const Frame& frame) {
  constexpr char kFrame[] = "spec/container.md#header-frame";
  const auto bits = std::bit_cast<std::uint64_t>(frame.edge);
  const bool power_of_two = (bits & 0x800fffffffffffff) == 0;
  if (!power_of_two || !(frame.edge >= 0x1p-960) || !(frame.edge <= 0x1p1010)) {
    throw FormatError(field::kEdge.at, kFrame, "edge is not a power of two from 2^-960 to 2^1010");
  }
  for (const double origin : frame.origin) {
    const double steps = origin / frame.unit();
    if (!(steps >= -kMaxWhole && steps <= kMaxWhole - 0x1p42) || std::rint(steps) != steps) {
      throw FormatError(field::kOrigin.at, kFrame,
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

// "bit 3" or "bits 3, 5".
std::string bits_text(std::uint64_t bits) {
  std::string text = std::has_single_bit(bits) ? "bit" : "bits";
  for (const char* between = " "; bits != 0; bits &= bits - 1, between = ", ")
    text += between + std::to_string(std::countr_zero(bits));
  return text;
}

}  // namespace

PageNumbers::PageNumbers(const Superblock& superblock, std::vector<std::uint8_t> groups)
    : points_(superblock.point_pages),
      nodes_{(1U + superblock.attribute_groups) * superblock.point_pages, superblock.node_pages},
      others_(superblock.page_count - 1 - nodes_.first - nodes_.count),
      groups_(std::move(groups)) {}

PageNumbers::Range PageNumbers::attributes(std::uint8_t group) const noexcept {
  const auto found = std::ranges::find(groups_, group);
  if (found == groups_.end()) return {};
  const auto before = static_cast<std::uint32_t>(found - groups_.begin());
  return {(1 + before) * points_, points_};
}

Uuid uuid_of(std::span<const std::byte> text) noexcept {
  return std::bit_cast<Uuid>(xxh3_128(text));
}

void encode_identity(const FileHeader& header, std::span<std::byte, kBlockBytes> block) noexcept {
  std::byte* const p = block.data();
  field::kMajor.put(p, header.major);
  field::kMinor.put(p, header.minor);
  field::kHeaderBytes.put(p, static_cast<std::uint32_t>(kBlockBytes));
  field::kIncompat.put(p, header.feature_incompat);
  field::kReadOnly.put(p, header.feature_ro_compat);
  field::kCompat.put(p, header.feature_compat);
  std::ranges::copy(header.uuid, p + kUuidAt);
  field::kPageShift.put(p, header.page_shift);
  field::kAlignShift.put(p, kAlignShift);
  field::kChecksum.put(p, kChecksumXxh3);
  field::kByteOrder.put(p, kByteOrderMark);
  field::kOrigin.put(p, header.frame.origin);
  field::kEdge.put(p, header.frame.edge);
  field::kPointBytes.put(p, header.point_bytes);
}

Block encode_file_header(const FileHeader& header) {
  Block block{};
  field::kMagic.put(block.data(), kFileMagic);
  encode_identity(header, block);
  field::kHash.put(block.data(), xxh3_64(std::span(block).first(field::kHash.at), kHeaderSeed));
  return block;
}

FileHeader decode_file_header(std::span<const std::byte> bytes) {
  // Check that the block is a whole header.
  if (bytes.size() < 8 || field::kMagic.of(bytes.data()) != kFileMagic) {
    throw FormatError(field::kMagic.at, "spec/container.md#header-magic", "not a PTCX file");
  }
  if (bytes.size() < kBlockBytes) {
    throw FormatError(bytes.size(), "spec/container.md#header-length", "file ends in its header");
  }
  const std::byte* const p = bytes.data();
  const std::uint64_t hash = xxh3_64(bytes.first(field::kHash.at), kHeaderSeed);
  if (field::kHash.of(p) != hash) {
    throw FormatError(field::kHash.at, "spec/container.md#header-checksum",
                      "file header's checksum is wrong");
  }

  // Check that this version and its features are known.
  FileHeader header;
  header.major = field::kMajor.of(p);
  header.minor = field::kMinor.of(p);
  if (header.major != kMajor) {
    throw FormatError(field::kMajor.at, "spec/container.md#header-version",
                      "format version " + std::to_string(header.major) + " is not supported");
  }
  header.feature_incompat = field::kIncompat.of(p);
  header.feature_ro_compat = field::kReadOnly.of(p);
  header.feature_compat = field::kCompat.of(p);
  if ((header.feature_incompat & kReleaseFeature) == 0) {
    throw FormatError(field::kIncompat.at, "spec/container.md#header-draft",
                      "file is a draft of before version 1.0, which this program does not read");
  }
  if ((header.feature_incompat & ~kKnownIncompat) != 0) {
    throw FormatError(field::kIncompat.at, "spec/container.md#header-features",
                      "file needs a feature that this program does not know: " +
                          bits_text(header.feature_incompat & ~kKnownIncompat) +
                          " of feature_incompat");
  }

  // Read and check everything else.
  check_constants(p);
  std::ranges::copy(bytes.subspan(kUuidAt, sizeof(Uuid)), header.uuid.begin());
  header.page_shift = field::kPageShift.of(p);
  if (header.page_shift < 12 || header.page_shift > 20) {
    throw FormatError(field::kPageShift.at, "spec/container.md#header-page-shift",
                      "page_shift is not 12 to 20");
  }
  header.point_bytes = field::kPointBytes.of(p);
  if (header.point_bytes != kPointBytes && header.point_bytes != kEmittingPointBytes) {
    throw FormatError(field::kPointBytes.at, "spec/container.md#header-point-bytes",
                      "point_bytes is neither 34 nor 40");
  }
  header.frame = {field::kOrigin.of(p), field::kEdge.of(p)};
  check_frame(header.frame);
  check_zero(bytes, field::kPointBytes.at + 1, field::kHash.at);
  check_zero(bytes, field::kHash.at + 8, kBlockBytes);
  return header;
}

FileHeader decode_repeated_header(std::span<const std::byte> superblock) {
  Block block{};
  field::kMagic.put(block.data(), kFileMagic);
  std::ranges::copy(superblock.subspan(8, field::kHash.at - 8), block.begin() + 8);
  field::kHash.put(block.data(), xxh3_64(std::span(block).first(field::kHash.at), kHeaderSeed));
  return decode_file_header(block);
}

void check_copyable(const FileHeader& header) {
  if (header.feature_ro_compat == 0) return;
  throw FormatError(field::kReadOnly.at, "spec/versions.md#features",
                    "only a program that knows " + bits_text(header.feature_ro_compat) +
                        " of feature_ro_compat may copy, extend or repair this file");
}

void encode_directory_entry(const DirectoryEntry& entry,
                            std::span<std::byte, kDirectoryEntryBytes> out) noexcept {
  std::byte* const p = out.data();
  entry_field::kOffset.put(p, entry.offset);
  entry_field::kStoredBytes.put(p, entry.stored_bytes);
  entry_field::kRawBytes.put(p, entry.raw_bytes);
  entry_field::kPayloadXxh3.put(p, entry.payload_xxh3);
  entry_field::kFirstKey.put(p, entry.first_key);
  entry_field::kRecordCount.put(p, entry.record_count);
  entry_field::kType.put(p, static_cast<std::uint8_t>(entry.type));
  entry_field::kGroup.put(p, entry.group);
  entry_field::kLevel.put(p, entry.level);
  entry_field::kReserved.put(p, std::uint8_t{0});
}

DirectoryEntry decode_directory_entry(std::span<const std::byte> bytes, const FileHeader& file,
                                      std::uint64_t file_bytes) {
  if (bytes.size() < kDirectoryEntryBytes) {
    throw FormatError(bytes.size(), "spec/container.md#directory", "directory entry is truncated");
  }
  const std::byte* const p = bytes.data();

  // Read the fields and check those that a page header has, too.
  DirectoryEntry entry;
  entry.offset = entry_field::kOffset.of(p);
  entry.stored_bytes = entry_field::kStoredBytes.of(p);
  entry.raw_bytes = entry_field::kRawBytes.of(p);
  entry.payload_xxh3 = entry_field::kPayloadXxh3.of(p);
  entry.first_key = entry_field::kFirstKey.of(p);
  entry.record_count = entry_field::kRecordCount.of(p);
  entry.type = static_cast<PageType>(entry_field::kType.of(p));
  entry.group = entry_field::kGroup.of(p);
  entry.level = entry_field::kLevel.of(p);
  if (entry.type == PageType::directory) {
    throw FormatError(entry_field::kType.at, "spec/container.md#directory-listing",
                      "directory lists itself");
  }
  if (entry_field::kReserved.of(p) != 0) {
    throw FormatError(entry_field::kReserved.at, "spec/container.md#page-fields",
                      "reserved field is not zero");
  }
  check_page_facts(entry, file);
  if (entry.is_void()) return entry;

  // Check that the page lies between the header and the superblocks.
  constexpr char kExtent[] = "spec/container.md#directory-extent";
  if (entry.offset % kSectorBytes != 0) {
    throw FormatError(entry_field::kOffset.at, kExtent, "page does not start on a sector");
  }
  const std::uint64_t end = file_bytes < 2 * kBlockBytes ? 0 : file_bytes - 2 * kBlockBytes;
  if (entry.offset < kBlockBytes || entry.offset > end ||
      round_up(kPageHeaderBytes + entry.stored_bytes, kSectorBytes) > end - entry.offset) {
    throw FormatError(entry_field::kOffset.at, kExtent, "page lies outside the file's pages");
  }
  return entry;
}

std::uint32_t directory_entries_per_page(const FileHeader& file) noexcept {
  return payload_limit(file.page_shift) / static_cast<std::uint32_t>(kDirectoryEntryBytes);
}

std::uint64_t directory_bytes(const FileHeader& file, std::uint32_t page_count) noexcept {
  const std::uint32_t full = directory_entries_per_page(file);
  const std::uint64_t rest = page_count % full;
  const std::uint64_t last =
      rest == 0 ? 0 : round_up(kPageHeaderBytes + rest * kDirectoryEntryBytes, kBlockBytes);
  return (std::uint64_t{page_count / full} << file.page_shift) + last;
}

}  // namespace ptc
