// The 64 bytes in front of every page (spec/container.md#page-header).
//
//   | magic | type | codec | filter | page_id | stored | raw | group | level | records | 0 |
//   0       4      6       7        8         12       16    20      22      24        28
//   | first_key | last_key | payload XXH3 | header XXH3 |
//   32          40         48             56            64
//
// The checksum of the header is seeded by the uuid of the file, the page number and the type. So it
// is right only in this file, for this number and this type, and a page that was swapped,
// misdirected or left over from another file is found.
#include <algorithm>

#include "format/bytes.h"
#include "format/checksum.h"
#include "format/container.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/page_facts.h"
#include "format/point_page.h"
#include "format/schema.h"

namespace ptc {
namespace {

constexpr std::uint16_t kNoLevel = 0xffff;
constexpr std::uint32_t kMaxGroupCount = 0xffff;
constexpr std::uint64_t kKeyLimit = std::uint64_t{1} << 63;  // halves of keys have 63 bits
constexpr char kFields[] = "spec/container.md#page-fields";

namespace field {
constexpr Field<std::uint32_t> kMagic{0};
constexpr Field<std::uint16_t> kType{4};
constexpr Field<std::uint8_t> kCodec{6};
constexpr Field<std::uint8_t> kFilter{7};
constexpr Field<std::uint32_t> kPageId{8};
constexpr Field<std::uint32_t> kStoredBytes{12};
constexpr Field<std::uint32_t> kRawBytes{16};
constexpr Field<std::uint16_t> kGroup{20};
constexpr Field<std::uint16_t> kLevel{22};
constexpr Field<std::uint32_t> kRecordCount{24};
constexpr Field<std::uint32_t> kReserved{28};
constexpr Field<std::uint64_t> kFirstKey{32};
constexpr Field<std::uint64_t> kLastKey{40};
constexpr Field<std::uint64_t> kPayloadXxh3{48};
constexpr Field<std::uint64_t> kHash{56};
}  // namespace field

// Returns the seed of a page header's checksum (spec/checksums.md#page-seed).
std::uint64_t page_seed(const Uuid& uuid, std::uint32_t page_id, std::uint16_t type) noexcept {
  std::array<std::byte, 22> salt;
  std::ranges::copy(uuid, salt.begin());
  store(salt.data(), 16, page_id);
  store(salt.data(), 20, type);
  return xxh3_64(salt);
}

// Says whether a page of this type and size can have as many records as it says.
bool record_count_fits(const PageFacts& facts) noexcept {
  switch (static_cast<PageType>(facts.type)) {
    case PageType::node:
      return facts.record_count <= kMaxGroupCount;
    case PageType::point:
      return point_page_bytes(facts.record_count) == facts.raw_bytes;
    case PageType::directory:
      return std::uint64_t{facts.record_count} * kDirectoryEntryBytes == facts.raw_bytes;
    case PageType::meta:
      return facts.record_count == 1;
    case PageType::attribute:
      return true;
  }
  return false;
}

// Reads codec and filter and checks that a page of this type may have them.
Coding decode_coding(const std::byte* p, PageType type) {
  const auto codec = field::kCodec.of(p), filter = field::kFilter.of(p);
  constexpr char kCodec[] = "spec/container.md#page-codec";
  if (codec > static_cast<std::uint8_t>(Codec::lz4))
    throw FormatError(field::kCodec.at, kCodec, "unknown codec");
  if (type == PageType::directory && codec != 0)
    throw FormatError(field::kCodec.at, kCodec, "a directory page is compressed");
  constexpr char kFilter[] = "spec/container.md#page-filter";
  if (filter > static_cast<std::uint8_t>(Filter::columns))
    throw FormatError(field::kFilter.at, kFilter, "unknown filter");
  if (filter != 0 && codec == 0)
    throw FormatError(field::kFilter.at, kFilter, "a raw page is filtered");
  if (filter != 0 && type != PageType::point && type != PageType::attribute) {
    throw FormatError(field::kFilter.at, kFilter, "a page of this type has no columns to filter");
  }
  return {static_cast<Codec>(codec), static_cast<Filter>(filter)};
}

void check_level_and_keys(const PageHeader& header) {
  const bool node = header.type == PageType::node;
  if (node ? header.level > kMaxLevel : header.level != kNoLevel) {
    throw FormatError(field::kLevel.at, kFields, "level does not suit the page's type");
  }
  const bool keyed = header.type != PageType::directory && header.type != PageType::meta;
  const std::uint64_t limit = keyed ? kKeyLimit : 1;
  if (header.last_key >= limit || header.first_key > header.last_key) {
    throw FormatError(field::kFirstKey.at, "spec/container.md#page-keys",
                      "first_key or last_key is out of range");
  }
}

}  // namespace

void check_page_facts(const PageFacts& facts, const FileHeader& file) {
  if (facts.type < static_cast<std::uint16_t>(PageType::node) ||
      facts.type > static_cast<std::uint16_t>(PageType::attribute)) {
    throw FormatError(0, "spec/container.md#page-type", "unknown page type");
  }
  constexpr char kLength[] = "spec/container.md#page-length";
  if (facts.raw_bytes == 0 || facts.raw_bytes > payload_limit(file)) {
    throw FormatError(0, kLength, "raw_bytes is not 1 to page size - 64");
  }
  if (facts.stored_bytes == 0 || facts.stored_bytes > facts.raw_bytes) {
    throw FormatError(0, kLength, "stored_bytes is not 1 to raw_bytes");
  }
  const bool attribute = facts.type == static_cast<std::uint16_t>(PageType::attribute);
  if (attribute ? facts.group == 0 || facts.group > kMaxGroup : facts.group != 0) {
    throw FormatError(0, kFields, "group does not suit the page's type");
  }
  if (facts.record_count == 0 || !record_count_fits(facts)) {
    throw FormatError(0, kFields, "record_count does not suit the page's type and size");
  }
}

void encode_page_header(const PageHeader& header, const Uuid& uuid,
                        std::span<std::byte, kPageHeaderBytes> out) {
  const auto type = static_cast<std::uint16_t>(header.type);
  std::byte* const p = out.data();
  field::kMagic.put(p, kPageMagic);
  field::kType.put(p, type);
  field::kCodec.put(p, static_cast<std::uint8_t>(header.coding.codec));
  field::kFilter.put(p, static_cast<std::uint8_t>(header.coding.filter));
  field::kPageId.put(p, header.page_id);
  field::kStoredBytes.put(p, header.stored_bytes);
  field::kRawBytes.put(p, header.raw_bytes);
  field::kGroup.put(p, header.group);
  field::kLevel.put(p, header.level);
  field::kRecordCount.put(p, header.record_count);
  field::kReserved.put(p, std::uint32_t{0});
  field::kFirstKey.put(p, header.first_key);
  field::kLastKey.put(p, header.last_key);
  field::kPayloadXxh3.put(p, header.payload_xxh3);
  const std::uint64_t seed = page_seed(uuid, header.page_id, type);
  field::kHash.put(p, xxh3_64(std::span<const std::byte>(out).first(field::kHash.at), seed));
}

PageHeader decode_page_header(std::span<const std::byte> bytes, const FileHeader& file) {
  // Check magic and checksum.
  if (bytes.size() < kPageHeaderBytes) {
    throw FormatError(bytes.size(), "spec/container.md#page-header", "page header is truncated");
  }
  const std::byte* const p = bytes.data();
  if (field::kMagic.of(p) != kPageMagic) {
    throw FormatError(field::kMagic.at, "spec/container.md#page-magic", "no page starts here");
  }
  PageHeader header;
  const auto type = field::kType.of(p);
  header.page_id = field::kPageId.of(p);
  const std::uint64_t seed = page_seed(file.uuid, header.page_id, type);
  if (field::kHash.of(p) != xxh3_64(bytes.first(field::kHash.at), seed)) {
    throw FormatError(field::kHash.at, "spec/container.md#page-checksum",
                      "page header's checksum is wrong");
  }

  // Read the fields.
  header.stored_bytes = field::kStoredBytes.of(p);
  header.raw_bytes = field::kRawBytes.of(p);
  header.group = field::kGroup.of(p);
  header.level = field::kLevel.of(p);
  header.record_count = field::kRecordCount.of(p);
  header.first_key = field::kFirstKey.of(p);
  header.last_key = field::kLastKey.of(p);
  header.payload_xxh3 = field::kPayloadXxh3.of(p);

  // Check their rules.
  check_page_facts({type, header.group, header.stored_bytes, header.raw_bytes, header.record_count},
                   file);
  header.type = static_cast<PageType>(type);
  header.coding = decode_coding(p, header.type);
  if ((header.coding.codec == Codec::raw) != (header.stored_bytes == header.raw_bytes)) {
    throw FormatError(field::kStoredBytes.at, "spec/container.md#page-length",
                      "stored_bytes equals raw_bytes without codec raw, or differs with codec raw");
  }
  if (field::kReserved.of(p) != 0)
    throw FormatError(field::kReserved.at, kFields, "reserved field is not zero");
  check_level_and_keys(header);
  return header;
}

}  // namespace ptc
