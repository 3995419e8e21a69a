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

constexpr std::size_t kPageHashAt = 56;
constexpr std::uint16_t kNoLevel = 0xffff;
constexpr std::uint32_t kMaxGroupCount = 0xffff;
constexpr std::uint64_t kKeyLimit = std::uint64_t{1} << 63;  // halves of keys have 63 bits
constexpr char kFields[] = "spec/container.md#page-fields";

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
  const auto codec = load<std::uint8_t>(p, 6), filter = load<std::uint8_t>(p, 7);
  constexpr char kCodec[] = "spec/container.md#page-codec";
  if (codec > static_cast<std::uint8_t>(Codec::lz4)) throw FormatError(6, kCodec, "unknown codec");
  if (type == PageType::directory && codec != 0)
    throw FormatError(6, kCodec, "a directory page is compressed");
  constexpr char kFilter[] = "spec/container.md#page-filter";
  if (filter > static_cast<std::uint8_t>(Filter::columns))
    throw FormatError(7, kFilter, "unknown filter");
  if (filter != 0 && codec == 0) throw FormatError(7, kFilter, "a raw page is filtered");
  if (filter != 0 && type != PageType::point && type != PageType::attribute) {
    throw FormatError(7, kFilter, "a page of this type has no columns to filter");
  }
  return {static_cast<Codec>(codec), static_cast<Filter>(filter)};
}

void check_level_and_keys(const PageHeader& header) {
  const bool node = header.type == PageType::node;
  if (node ? header.level > kMaxLevel : header.level != kNoLevel) {
    throw FormatError(22, kFields, "level does not suit the page's type");
  }
  const bool keyed = header.type != PageType::directory && header.type != PageType::meta;
  const std::uint64_t limit = keyed ? kKeyLimit : 1;
  if (header.last_key >= limit || header.first_key > header.last_key) {
    throw FormatError(32, "spec/container.md#page-keys", "first_key or last_key is out of range");
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
  store(p, 0, kPageMagic);
  store(p, 4, type);
  store(p, 6, static_cast<std::uint8_t>(header.coding.codec));
  store(p, 7, static_cast<std::uint8_t>(header.coding.filter));
  store(p, 8, header.page_id);
  store(p, 12, header.stored_bytes);
  store(p, 16, header.raw_bytes);
  store(p, 20, header.group);
  store(p, 22, header.level);
  store(p, 24, header.record_count);
  store(p, 28, std::uint32_t{0});
  store(p, 32, header.first_key);
  store(p, 40, header.last_key);
  store(p, 48, header.payload_xxh3);
  const std::uint64_t seed = page_seed(uuid, header.page_id, type);
  store(p, kPageHashAt, xxh3_64(std::span<const std::byte>(out).first(kPageHashAt), seed));
}

PageHeader decode_page_header(std::span<const std::byte> bytes, const FileHeader& file) {
  // Check magic and checksum.
  if (bytes.size() < kPageHeaderBytes) {
    throw FormatError(bytes.size(), "spec/container.md#page-header", "page header is truncated");
  }
  const std::byte* const p = bytes.data();
  if (load<std::uint32_t>(p, 0) != kPageMagic) {
    throw FormatError(0, "spec/container.md#page-magic", "no page starts here");
  }
  PageHeader header;
  const auto type = load<std::uint16_t>(p, 4);
  header.page_id = load<std::uint32_t>(p, 8);
  const std::uint64_t seed = page_seed(file.uuid, header.page_id, type);
  if (load<std::uint64_t>(p, kPageHashAt) != xxh3_64(bytes.first(kPageHashAt), seed)) {
    throw FormatError(kPageHashAt, "spec/container.md#page-checksum",
                      "page header's checksum is wrong");
  }

  // Read the fields.
  header.stored_bytes = load<std::uint32_t>(p, 12);
  header.raw_bytes = load<std::uint32_t>(p, 16);
  header.group = load<std::uint16_t>(p, 20);
  header.level = load<std::uint16_t>(p, 22);
  header.record_count = load<std::uint32_t>(p, 24);
  header.first_key = load<std::uint64_t>(p, 32);
  header.last_key = load<std::uint64_t>(p, 40);
  header.payload_xxh3 = load<std::uint64_t>(p, 48);

  // Check their rules.
  check_page_facts({type, header.group, header.stored_bytes, header.raw_bytes, header.record_count},
                   file);
  header.type = static_cast<PageType>(type);
  header.coding = decode_coding(p, header.type);
  if ((header.coding.codec == Codec::raw) != (header.stored_bytes == header.raw_bytes)) {
    throw FormatError(12, "spec/container.md#page-length",
                      "stored_bytes equals raw_bytes without codec raw, or differs with codec raw");
  }
  if (load<std::uint32_t>(p, 28) != 0) throw FormatError(28, kFields, "reserved field is not zero");
  check_level_and_keys(header);
  return header;
}

}  // namespace ptc
