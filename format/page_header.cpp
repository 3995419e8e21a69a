// The 64 bytes in front of every page (spec/container.md#page-header).
//
//   | magic | type | group | codec | filter | rank | stored | raw | records | level | 0 |
//   0       4      5       6       7        8      12       16    20        24      25
//   | first_key | last_key | payload XXH3 | header XXH3 |
//   32          40         48             56            64
//
// The checksum of the header is seeded by the uuid of the file, the rank, the type and the group.
// So it is right only in this file, for this page, and a page that was swapped, misdirected or left
// over from another file is found.
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

constexpr std::uint32_t kMaxGroupCount = 0xffff;
constexpr std::uint64_t kKeyLimit = std::uint64_t{1} << 63;  // halves of keys have 63 bits
constexpr char kFields[] = "spec/container.md#page-fields";

namespace field {
constexpr Field<std::uint32_t> kMagic{0};
constexpr Field<std::uint8_t> kType{4};
constexpr Field<std::uint8_t> kGroup{5};
constexpr Field<std::uint8_t> kCodec{6};
constexpr Field<std::uint8_t> kFilter{7};
constexpr Field<std::uint32_t> kRank{8};
constexpr Field<std::uint32_t> kStoredBytes{12};
constexpr Field<std::uint32_t> kRawBytes{16};
constexpr Field<std::uint32_t> kRecordCount{20};
constexpr Field<std::uint8_t> kLevel{24};
constexpr std::size_t kReservedAt = 25;
constexpr Field<std::uint64_t> kFirstKey{32};
constexpr Field<std::uint64_t> kLastKey{40};
constexpr Field<std::uint64_t> kPayloadXxh3{48};
constexpr Field<std::uint64_t> kHash{56};
}  // namespace field

// Returns the seed of a page header's checksum (spec/checksums.md#page-seed).
std::uint64_t page_seed(const Uuid& uuid, const PageHeader& page) noexcept {
  std::array<std::byte, 22> salt;
  std::ranges::copy(uuid, salt.begin());
  store(salt.data(), 16, page.rank);
  store(salt.data(), 20, static_cast<std::uint8_t>(page.type));
  store(salt.data(), 21, page.group);
  return xxh3_64(salt);
}

// Says whether a page of this type and size can have as many records as it says.
bool record_count_fits(const DirectoryEntry& facts, const FileHeader& file) noexcept {
  const auto takes = [&](std::uint64_t bytes) {
    return facts.record_count * bytes == facts.raw_bytes;
  };
  switch (facts.type) {
    case PageType::node:
      return facts.record_count <= kMaxGroupCount;
    case PageType::point:
      return takes(file.point_bytes);
    case PageType::directory:
      return takes(kDirectoryEntryBytes);
    case PageType::meta:
      return facts.record_count == 1;
    case PageType::parts:
      return takes(kPartBytes);
    case PageType::attribute:
      return true;
  }
  return is_skippable(facts.type);
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

bool is_known(PageType type) noexcept {
  return (type >= PageType::node && type <= PageType::parts) || is_skippable(type);
}

// Says whether a page has keys of points or groups; the keys of others are 0.
bool has_keys(PageType type) noexcept {
  return type == PageType::node || type == PageType::point || type == PageType::parts;
}

}  // namespace

void check_page_facts(const DirectoryEntry& facts, const FileHeader& file) {
  if (!is_known(facts.type))
    throw FormatError(0, "spec/container.md#page-type", "unknown page type");
  constexpr char kLength[] = "spec/container.md#page-length";
  if (!facts.is_void()) {
    if (facts.raw_bytes == 0 || facts.raw_bytes > payload_limit(file.page_shift)) {
      throw FormatError(0, kLength, "raw_bytes is not 1 to page size - 64");
    }
    if (facts.stored_bytes == 0 || facts.stored_bytes > facts.raw_bytes) {
      throw FormatError(0, kLength, "stored_bytes is not 1 to raw_bytes");
    }
  }
  if ((facts.type == PageType::attribute) == (facts.group == 0)) {
    throw FormatError(0, kFields, "group does not suit the page's type");
  }
  if (facts.record_count == 0 || (!facts.is_void() && !record_count_fits(facts, file))) {
    throw FormatError(0, kFields, "record_count does not suit the page's type and size");
  }
  if (facts.type == PageType::node ? facts.level > kMaxLevel : facts.level != kNoLevel) {
    throw FormatError(0, kFields, "level does not suit the page's type");
  }
  if (facts.first_key >= (has_keys(facts.type) ? kKeyLimit : 1)) {
    throw FormatError(0, "spec/container.md#page-keys", "first_key is out of range");
  }
}

void encode_page_header(const PageHeader& header, const Uuid& uuid,
                        std::span<std::byte, kPageHeaderBytes> out) {
  std::ranges::fill(out, std::byte{0});
  std::byte* const p = out.data();
  field::kMagic.put(p, kPageMagic);
  field::kType.put(p, static_cast<std::uint8_t>(header.type));
  field::kGroup.put(p, header.group);
  field::kCodec.put(p, static_cast<std::uint8_t>(header.coding.codec));
  field::kFilter.put(p, static_cast<std::uint8_t>(header.coding.filter));
  field::kRank.put(p, header.rank);
  field::kStoredBytes.put(p, header.stored_bytes);
  field::kRawBytes.put(p, header.raw_bytes);
  field::kRecordCount.put(p, header.record_count);
  field::kLevel.put(p, header.level);
  field::kFirstKey.put(p, header.first_key);
  field::kLastKey.put(p, header.last_key);
  field::kPayloadXxh3.put(p, header.payload_xxh3);
  const std::uint64_t seed = page_seed(uuid, header);
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
  header.type = static_cast<PageType>(field::kType.of(p));
  header.group = field::kGroup.of(p);
  header.rank = field::kRank.of(p);
  if (field::kHash.of(p) != xxh3_64(bytes.first(field::kHash.at), page_seed(file.uuid, header))) {
    throw FormatError(field::kHash.at, "spec/container.md#page-checksum",
                      "page header's checksum is wrong");
  }

  // Read the fields.
  header.stored_bytes = field::kStoredBytes.of(p);
  header.raw_bytes = field::kRawBytes.of(p);
  header.record_count = field::kRecordCount.of(p);
  header.level = field::kLevel.of(p);
  header.first_key = field::kFirstKey.of(p);
  header.last_key = field::kLastKey.of(p);
  header.payload_xxh3 = field::kPayloadXxh3.of(p);

  // Check their rules.
  check_page_facts(entry_of(header, 0), file);
  if (header.raw_bytes == 0) {
    throw FormatError(field::kRawBytes.at, "spec/container.md#page-length",
                      "raw_bytes is not 1 to page size - 64");
  }
  header.coding = decode_coding(p, header.type);
  if ((header.coding.codec == Codec::raw) != (header.stored_bytes == header.raw_bytes)) {
    throw FormatError(field::kStoredBytes.at, "spec/container.md#page-length",
                      "stored_bytes equals raw_bytes without codec raw, or differs with codec raw");
  }
  const std::size_t set =
      field::kReservedAt +
      first_nonzero(bytes.subspan(field::kReservedAt, field::kFirstKey.at - field::kReservedAt));
  if (set != field::kFirstKey.at) throw FormatError(set, kFields, "reserved field is not zero");
  if (header.last_key < header.first_key ||
      header.last_key >= (has_keys(header.type) ? kKeyLimit : 1)) {
    throw FormatError(field::kFirstKey.at, "spec/container.md#page-keys",
                      "first_key or last_key is out of range");
  }
  return header;
}

}  // namespace ptc
