// File header, page header and directory entry: the checksum finds damage, and a rule that is
// broken under a correct checksum is named. Pages have numbers that follow from their kind.
#include "format/container.h"

#include <limits>
#include <ranges>

#include <catch2/catch.hpp>

#include "format/checksum.h"
#include "format/point_page.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using ptc::test::get;
using ptc::test::put;
using Bytes = std::vector<std::byte>;
using PageBytes = std::array<std::byte, kPageHeaderBytes>;
using EntryBytes = std::array<std::byte, kDirectoryEntryBytes>;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kHeaderSeed = 0x4441454858435450;  // "PTCXHEAD"

FileHeader example_file() {
  FileHeader header;
  for (std::size_t i = 0; i < 16; ++i) header.uuid[i] = static_cast<std::byte>(17 * i + 1);
  header.minor = 3;
  header.feature_ro_compat = 1ull << 63;
  header.feature_compat = 0xff00;
  header.page_shift = 12;
  header.frame = {{-4, 2, 0}, 8};
  return header;
}

PageHeader example_page() {
  PageHeader header;
  header.type = PageType::point;
  header.coding.codec = Codec::zstd;
  header.rank = 0x01020304;
  header.stored_bytes = 1000;
  header.raw_bytes = 34 * 40;
  header.record_count = 40;
  header.first_key = 5;
  header.last_key = 0x7fffffffffffffff;
  header.payload_xxh3 = 0x1122334455667788;
  return header;
}

DirectoryEntry example_entry() {
  return entry_of(example_page(), 8192);
}

std::string header_clause(const Block& block) {
  return clause_of([&] { (void)decode_file_header(block); });
}

// Returns the clause that a header block breaks when its bytes changed and its checksum is correct.
template <class T>
std::string resealed_header(std::size_t at, T value) {
  Block block = encode_file_header(example_file());
  put(block, at, value);
  put(block, 120, xxh3_64(std::span(block).first(120), kHeaderSeed));
  return header_clause(block);
}

PageBytes encode_page(const PageHeader& header) {
  PageBytes bytes;
  encode_page_header(header, example_file().uuid, bytes);
  return bytes;
}

std::string page_clause(const PageHeader& header) {
  const PageBytes bytes = encode_page(header);
  return clause_of([&] { (void)decode_page_header(bytes, example_file()); });
}

template <class Change>
std::string changed_page(const Change& change) {
  PageHeader header = example_page();
  change(header);
  return page_clause(header);
}

EntryBytes encode_entry(const DirectoryEntry& entry) {
  EntryBytes bytes;
  encode_directory_entry(entry, bytes);
  return bytes;
}

template <class Change>
std::string changed_entry(const Change& change) {
  DirectoryEntry entry = example_entry();
  change(entry);
  const EntryBytes bytes = encode_entry(entry);
  return clause_of([&] { (void)decode_directory_entry(bytes, example_file(), 65536); });
}

}  // namespace

TEST_CASE("file header: decoding an encoded header gives it back", "[format][container]") {
  const FileHeader header = example_file();
  const FileHeader back = decode_file_header(encode_file_header(header));
  CHECK(back.major == 1);
  CHECK(back.minor == 3);
  CHECK(back.feature_incompat == kReleaseFeature);
  CHECK(back.feature_ro_compat == header.feature_ro_compat);
  CHECK(back.feature_compat == header.feature_compat);
  CHECK(back.uuid == header.uuid);
  CHECK(back.page_shift == 12);
  CHECK(back.point_bytes == 34);
  CHECK(back.frame.origin == header.frame.origin);
  CHECK(back.frame.edge == 8);
}

TEST_CASE("file header: its bytes lie where the spec says", "[format][container]") {
  const Block block = encode_file_header(example_file());
  const unsigned char magic[8] = {0x89, 'P', 'T', 'C', 0x0d, 0x0a, 0x1a, 0x0a};
  CHECK(std::memcmp(block.data(), magic, 8) == 0);
  CHECK(get<std::uint16_t>(block, 8) == 1);
  CHECK(get<std::uint16_t>(block, 10) == 3);
  CHECK(get<std::uint32_t>(block, 12) == 4096);
  CHECK(get<std::uint64_t>(block, 16) == 1);
  CHECK(get<std::uint64_t>(block, 24) == 1ull << 63);
  CHECK(get<std::uint64_t>(block, 32) == 0xff00);
  CHECK(block[40] == std::byte{1});
  CHECK(get<std::uint8_t>(block, 56) == 12);
  CHECK(get<std::uint8_t>(block, 57) == 9);
  CHECK(get<std::uint16_t>(block, 58) == 1);
  CHECK(get<std::uint32_t>(block, 60) == 0x01020304);
  CHECK(get<double>(block, 64) == -4);
  CHECK(get<double>(block, 72) == 2);
  CHECK(get<double>(block, 80) == 0);
  CHECK(get<double>(block, 88) == 8);
  CHECK(get<std::uint8_t>(block, 96) == 34);
}

TEST_CASE("file header: every truncation and every flipped bit is refused", "[format][container]") {
  const Block block = encode_file_header(example_file());
  for (std::size_t n = 0; n < block.size(); ++n) {
    const Bytes prefix(block.begin(), block.begin() + static_cast<std::ptrdiff_t>(n));
    const std::string clause = clause_of([&] { (void)decode_file_header(prefix); });
    if (clause != (n < 8 ? "spec/container.md#header-magic" : "spec/container.md#header-length")) {
      FAIL("prefix of " << n << " bytes: " << clause);
    }
  }
  unsigned accepted = 0;
  for (std::size_t bit = 0; bit < 8 * block.size(); ++bit) {
    Block flipped = block;
    flipped[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    accepted += header_clause(flipped) == "none";
  }
  CHECK(accepted == 0);
}

TEST_CASE("file header: a broken rule is named, whether the checksum is correct or not",
          "[format][container]") {
  Block block = encode_file_header(example_file());
  block[8] ^= std::byte{1};
  CHECK(header_clause(block) == "spec/container.md#header-checksum");
  CHECK(resealed_header(0, 'x') == "spec/container.md#header-magic");
  CHECK(resealed_header(8, std::uint16_t{2}) == "spec/container.md#header-version");
  CHECK(resealed_header(8, std::uint16_t{0}) == "spec/container.md#header-version");
  CHECK(resealed_header(10, std::uint16_t{999}) == "none");
  CHECK(resealed_header(12, std::uint32_t{8192}) == "spec/container.md#header-constants");
  for (int bit = 0; bit < 64; ++bit) {
    CHECK(resealed_header(16, std::uint64_t{1} | std::uint64_t{1} << bit) ==
          (bit < 2 ? "none" : "spec/container.md#header-features"));
    CHECK(resealed_header(24, std::uint64_t{1} << bit) == "none");
    CHECK(resealed_header(32, std::uint64_t{1} << bit) == "none");
  }
  for (unsigned shift = 0; shift < 256; ++shift) {
    const bool allowed = shift >= 12 && shift <= 20;
    CHECK(resealed_header(56, static_cast<std::uint8_t>(shift)) ==
          (allowed ? "none" : "spec/container.md#header-page-shift"));
  }
  CHECK(resealed_header(57, std::uint8_t{13}) == "spec/container.md#header-constants");
  CHECK(resealed_header(58, std::uint16_t{2}) == "spec/container.md#header-constants");
  CHECK(resealed_header(60, std::uint32_t{0x04030201}) == "spec/container.md#header-constants");
  CHECK(resealed_header(97, 'x') == "spec/container.md#header-zero");
  CHECK(resealed_header(119, 'x') == "spec/container.md#header-zero");
  CHECK(resealed_header(128, 'x') == "spec/container.md#header-zero");
  CHECK(resealed_header(4095, 'x') == "spec/container.md#header-zero");
}

TEST_CASE("file header: without the bit of released versions a file is a draft",
          "[format][container]") {
  for (const std::uint64_t features : {std::uint64_t{0}, kPartsFeature, ~kReleaseFeature}) {
    CHECK(resealed_header(16, features) == "spec/container.md#header-draft");
  }
}

TEST_CASE("file header: a point has 34 bytes, or 40 with emission", "[format][container]") {
  for (unsigned bytes = 0; bytes < 256; ++bytes) {
    CHECK(resealed_header(96, static_cast<std::uint8_t>(bytes)) ==
          (bytes == 34 || bytes == 40 ? "none" : "spec/container.md#header-point-bytes"));
  }
  FileHeader header = example_file();
  header.point_bytes = kEmittingPointBytes;
  CHECK(decode_file_header(encode_file_header(header)).point_bytes == 40);
}

TEST_CASE("file header: the copy in a superblock keeps the same rules", "[format][container]") {
  Block superblock = encode_file_header(example_file());
  put(superblock, 0, ~std::uint64_t{0});  // a superblock has another magic and no such checksum
  put(superblock, 120, ~std::uint64_t{0});
  const FileHeader back = decode_repeated_header(superblock);
  CHECK(encode_file_header(back) == encode_file_header(example_file()));
  put(superblock, 96, std::uint8_t{35});
  CHECK(clause_of([&] { (void)decode_repeated_header(superblock); }) ==
        "spec/container.md#header-point-bytes");
}

TEST_CASE("file header: a frame is exact in doubles", "[format][container]") {
  constexpr char kFrame[] = "spec/container.md#header-frame";
  const auto edge = [](double e) { return resealed_header(88, e); };
  for (const double bad : {0.0, -8.0, 7.0, 0x1p-961, 0x1p1011, kNan, kInfinity, 5e-324}) {
    CHECK(edge(bad) == kFrame);
  }
  const auto origin = [](double x, double e) {
    FileHeader header = example_file();
    header.frame = {{x, 0, 0}, e};
    return header_clause(encode_file_header(header));
  };
  CHECK(origin(0x1p-42, 1) == "none");
  CHECK(origin(-0x1p11, 1) == "none");
  CHECK(origin(0x1p11 - 1, 1) == "none");
  CHECK(origin(0, 0x1p1010) == "none");
  CHECK(origin(0, 0x1p-960) == "none");
  CHECK(origin(0x1p-43, 1) == kFrame);
  CHECK(origin(0x1p11, 1) == kFrame);
  CHECK(origin(-0x1.0000000000001p11, 1) == kFrame);
  CHECK(origin(kNan, 1) == kFrame);
  CHECK(origin(-kInfinity, 1) == kFrame);
}

TEST_CASE("page header: decoding an encoded header gives it back", "[format][container]") {
  const PageHeader header = example_page();
  const PageHeader back = decode_page_header(encode_page(header), example_file());
  CHECK(back.type == header.type);
  CHECK(back.coding.codec == header.coding.codec);
  CHECK(back.rank == header.rank);
  CHECK(back.stored_bytes == header.stored_bytes);
  CHECK(back.raw_bytes == header.raw_bytes);
  CHECK(back.group == header.group);
  CHECK(back.level == header.level);
  CHECK(back.record_count == header.record_count);
  CHECK(back.first_key == header.first_key);
  CHECK(back.last_key == header.last_key);
  CHECK(back.payload_xxh3 == header.payload_xxh3);
}

TEST_CASE("page header: every truncation and every flipped bit is refused", "[format][container]") {
  const PageBytes bytes = encode_page(example_page());
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    CHECK_THROWS_AS((void)decode_page_header(std::span(bytes).first(n), example_file()),
                    FormatError);
  }
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    PageBytes flipped = bytes;
    flipped[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    CHECK_THROWS_AS((void)decode_page_header(flipped, example_file()), FormatError);
  }
}

TEST_CASE("page header: its bytes lie where the spec says", "[format][container]") {
  PageHeader header = example_page();
  header.type = PageType::node;
  header.coding = {Codec::lz4, Filter::columns};
  header.group = 9;
  header.level = 17;
  const PageBytes bytes = encode_page(header);
  CHECK(std::memcmp(bytes.data(), "PTCp", 4) == 0);
  CHECK(get<std::uint8_t>(bytes, 4) == 1);
  CHECK(get<std::uint8_t>(bytes, 5) == 9);
  CHECK(get<std::uint8_t>(bytes, 6) == 2);
  CHECK(get<std::uint8_t>(bytes, 7) == 1);
  CHECK(get<std::uint32_t>(bytes, 8) == 0x01020304);
  CHECK(get<std::uint32_t>(bytes, 12) == 1000);
  CHECK(get<std::uint32_t>(bytes, 16) == 34 * 40);
  CHECK(get<std::uint32_t>(bytes, 20) == 40);
  CHECK(get<std::uint64_t>(bytes, 24) == 17);  // level, then seven reserved bytes
  CHECK(get<std::uint64_t>(bytes, 32) == 5);
  CHECK(get<std::uint64_t>(bytes, 40) == 0x7fffffffffffffff);
  CHECK(get<std::uint64_t>(bytes, 48) == 0x1122334455667788);
}

TEST_CASE("page header: the checksum is valid for one file, rank, type and group only",
          "[format][container]") {
  PageHeader header = example_page();
  header.type = PageType::attribute;
  header.group = 7;
  header.first_key = header.last_key = 0;
  PageBytes bytes = encode_page(header);
  const auto clause = [&](const FileHeader& file) {
    return clause_of([&] { (void)decode_page_header(bytes, file); });
  };
  CHECK(clause(example_file()) == "none");
  FileHeader other = example_file();
  other.uuid[15] ^= std::byte{1};
  CHECK(clause(other) == "spec/container.md#page-checksum");
  // The hash of bytes 0 to 55 under the seed of the spec: uuid, rank, type, group.
  const Uuid uuid = example_file().uuid;
  Bytes salt(uuid.begin(), uuid.end());
  salt.resize(22);
  put(salt, 16, std::uint32_t{0x01020304});
  put(salt, 20, std::uint8_t{5});
  put(salt, 21, std::uint8_t{7});
  CHECK(get<std::uint64_t>(bytes, 56) == xxh3_64(std::span(bytes).first(56), xxh3_64(salt)));
  // A header that is sealed under the seed of any other page is refused.
  for (std::size_t at = 0; at < salt.size(); ++at) {
    Bytes wrong = salt;
    wrong[at] ^= std::byte{1};
    put(bytes, 56, xxh3_64(std::span(bytes).first(56), xxh3_64(wrong)));
    CHECK(clause(example_file()) == "spec/container.md#page-checksum");
  }
}

TEST_CASE("page header: the reserved bytes are zero", "[format][container]") {
  const Uuid uuid = example_file().uuid;
  Bytes salt(uuid.begin(), uuid.end());
  salt.resize(22);
  put(salt, 16, std::uint32_t{0x01020304});
  put(salt, 20, std::uint8_t{2});
  for (std::size_t at = 25; at < 32; ++at) {
    PageBytes bytes = encode_page(example_page());
    bytes[at] = std::byte{1};
    put(bytes, 56, xxh3_64(std::span(bytes).first(56), xxh3_64(salt)));
    CHECK(clause_of([&] { (void)decode_page_header(bytes, example_file()); }) ==
          "spec/container.md#page-fields");
  }
}

TEST_CASE("page header: a broken rule is named", "[format][container]") {
  constexpr char kLength[] = "spec/container.md#page-length";
  constexpr char kFields[] = "spec/container.md#page-fields";
  constexpr char kKeys[] = "spec/container.md#page-keys";
  const auto page = [](auto change) { return changed_page(change); };
  CHECK(page([](PageHeader&) {}) == "none");
  CHECK(page([](PageHeader& h) { h.type = PageType{0}; }) == "spec/container.md#page-type");
  CHECK(page([](PageHeader& h) { h.coding.codec = Codec{3}; }) == "spec/container.md#page-codec");
  constexpr char kFilter[] = "spec/container.md#page-filter";
  CHECK(page([](PageHeader& h) { h.coding = {Codec::zstd, Filter{2}}; }) == kFilter);
  CHECK(page([](PageHeader& h) { h.coding = {Codec::raw, Filter::columns}; }) == kFilter);
  CHECK(page([](PageHeader& h) {
          h.coding = {Codec::zstd, Filter::columns};
          h.type = PageType::node;
          h.level = 5;
        }) == kFilter);
  CHECK(page([](PageHeader& h) { h.stored_bytes = 0; }) == kLength);
  CHECK(page([](PageHeader& h) { h.stored_bytes = h.raw_bytes; }) == kLength);
  CHECK(page([](PageHeader& h) { h.stored_bytes = 0xffffffff; }) == kLength);
  CHECK(page([](PageHeader& h) { h.coding.codec = Codec::raw; }) == kLength);
  CHECK(page([](PageHeader& h) { h.raw_bytes = 4096 - 63; }) == kLength);
  CHECK(page([](PageHeader& h) { h.raw_bytes = 0; }) == kLength);
  CHECK(page([](PageHeader& h) { h.group = 1; }) == kFields);
  CHECK(page([](PageHeader& h) { h.level = 0; }) == kFields);
  CHECK(page([](PageHeader& h) { h.level = 254; }) == kFields);
  CHECK(page([](PageHeader& h) { h.record_count = 41; }) == kFields);
  CHECK(page([](PageHeader& h) { h.record_count = 0; }) == kFields);
  CHECK(page([](PageHeader& h) { h.first_key = 1ull << 63; }) == kKeys);
  CHECK(page([](PageHeader& h) { h.last_key = 1ull << 63; }) == kKeys);
  CHECK(page([](PageHeader& h) { h.last_key = 4; }) == kKeys);
}

TEST_CASE("page header: each type has its own fields", "[format][container]") {
  constexpr char kFields[] = "spec/container.md#page-fields";
  constexpr char kKeys[] = "spec/container.md#page-keys";
  const auto of_type = [](PageType type, auto change) {
    return changed_page([&](PageHeader& h) {
      h.type = type;
      h.first_key = h.last_key = 0;
      if (type == PageType::node) h.level = 62;
      if (type == PageType::directory) {
        h.coding.codec = Codec::raw;
        h.stored_bytes = h.raw_bytes = 40 * h.record_count;
      }
      if (type == PageType::meta) h.record_count = 1;
      if (type == PageType::parts) {
        h.record_count = 4;
        h.raw_bytes = 4 * 384;
      }
      if (type == PageType::attribute) h.group = 255;
      change(h);
    });
  };
  const auto same = [](PageHeader&) {};
  const auto key = [](PageHeader& h) { h.first_key = h.last_key = 1; };
  for (const PageType type : {PageType::node, PageType::point, PageType::directory, PageType::meta,
                              PageType::attribute, PageType::parts, PageType{200}}) {
    INFO(static_cast<unsigned>(type));
    CHECK(of_type(type, same) == "none");
    CHECK(of_type(type, [](PageHeader& h) { h.record_count = 0; }) == kFields);
    CHECK(of_type(type, [](PageHeader& h) { h.group = h.group == 0 ? 1 : 0; }) == kFields);
    CHECK(of_type(type, [](PageHeader& h) { h.last_key = 1ull << 63; }) == kKeys);
    // Only pages of points, nodes and parts have keys, and only node pages have a level.
    const bool keyed = type == PageType::node || type == PageType::point || type == PageType::parts;
    CHECK(of_type(type, key) == (keyed ? "none" : kKeys));
    const auto level = [](PageHeader& h) { h.level = h.level == kNoLevel ? 62 : kNoLevel; };
    CHECK(of_type(type, level) == kFields);
  }
  for (unsigned level = 0; level < 256; ++level) {
    const auto at = [=](PageHeader& h) { h.level = static_cast<std::uint8_t>(level); };
    CHECK(of_type(PageType::node, at) == (level <= 62 ? "none" : kFields));
  }
  CHECK(of_type(PageType::node, [](PageHeader& h) { h.record_count = 65536; }) == kFields);
  CHECK(of_type(PageType::node, [](PageHeader& h) { h.first_key = 1; }) == kKeys);
  CHECK(of_type(PageType::directory, [](PageHeader& h) { h.record_count = 39; }) == kFields);
  CHECK(of_type(PageType::directory, [](PageHeader& h) {
          h.coding.codec = Codec::zstd;
          h.stored_bytes = 100;
        }) == "spec/container.md#page-codec");
  CHECK(of_type(PageType::meta, [](PageHeader& h) { h.record_count = 2; }) == kFields);
  CHECK(of_type(PageType::meta, [](PageHeader& h) { h.last_key = 1; }) == kKeys);
  CHECK(of_type(PageType::attribute, [](PageHeader& h) { h.record_count = 41; }) == "none");
  CHECK(of_type(PageType::parts, [](PageHeader& h) { h.record_count = 3; }) == kFields);
}

TEST_CASE("page header: pages of types from 128 on are passed over, other types are refused",
          "[format][container]") {
  for (unsigned type = 0; type < 256; ++type) {
    PageHeader header = example_page();
    header.type = static_cast<PageType>(type);
    header.first_key = header.last_key = 0;
    header.record_count = 12345;  // what it counts is known to its own version only
    const std::string clause = page_clause(header);
    INFO(type << " " << clause);
    CHECK(is_skippable(header.type) == (type >= 128));
    if (type >= 128) CHECK(clause == "none");
    if (type == 0 || (type > 6 && type < 128)) CHECK(clause == "spec/container.md#page-type");
  }
}

TEST_CASE("page header: a page has as many points as its bytes hold", "[format][container]") {
  PageHeader header = example_page();
  header.raw_bytes = 40 * 40;
  CHECK(page_clause(header) == "spec/container.md#page-fields");
  FileHeader file = example_file();
  file.point_bytes = kEmittingPointBytes;
  CHECK_NOTHROW((void)decode_page_header(encode_page(header), file));
  CHECK(clause_of([&] { (void)decode_page_header(encode_page(example_page()), file); }) ==
        "spec/container.md#page-fields");
}

TEST_CASE("directory: decoding an encoded entry gives it back", "[format][directory]") {
  const DirectoryEntry entry = example_entry();
  CHECK(decode_directory_entry(encode_entry(entry), example_file(), 65536) == entry);
}

TEST_CASE("directory: the bytes of an entry lie where the spec says", "[format][directory]") {
  DirectoryEntry entry = example_entry();
  entry.group = 9;
  entry.level = 17;
  const EntryBytes bytes = encode_entry(entry);
  CHECK(get<std::uint64_t>(bytes, 0) == 8192);
  CHECK(get<std::uint32_t>(bytes, 8) == 1000);
  CHECK(get<std::uint32_t>(bytes, 12) == 34 * 40);
  CHECK(get<std::uint64_t>(bytes, 16) == 0x1122334455667788);
  CHECK(get<std::uint64_t>(bytes, 24) == 5);
  CHECK(get<std::uint32_t>(bytes, 32) == 40);
  CHECK(get<std::uint8_t>(bytes, 36) == 2);
  CHECK(get<std::uint8_t>(bytes, 37) == 9);
  CHECK(get<std::uint8_t>(bytes, 38) == 17);
  CHECK(get<std::uint8_t>(bytes, 39) == 0);
}

TEST_CASE("directory: every proper prefix of an entry is truncated", "[format][directory]") {
  const EntryBytes bytes = encode_entry(example_entry());
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    CHECK_THROWS_AS((void)decode_directory_entry(std::span(bytes).first(n), example_file(), 65536),
                    FormatError);
  }
}

TEST_CASE("directory: a page outside the file is refused, whatever overflow its numbers cause",
          "[format][directory]") {
  constexpr char kExtent[] = "spec/container.md#directory-extent";
  const auto at = [](std::uint64_t offset) {
    return changed_entry([=](DirectoryEntry& e) { e.offset = offset; });
  };
  CHECK(at(4096) == "none");
  CHECK(at(4608) == "none");
  CHECK(at(65536 - 8192 - 4096) == "none");
  for (const std::uint64_t offset :
       {std::uint64_t{0}, std::uint64_t{4095}, std::uint64_t{8193}, std::uint64_t{8448},
        std::uint64_t{65536 - 8192}, std::uint64_t{65536}, ~std::uint64_t{0}, ~std::uint64_t{4095},
        std::uint64_t{1} << 63}) {
    CHECK(at(offset) == kExtent);
  }
  const EntryBytes bytes = encode_entry(example_entry());
  for (const std::uint64_t file_bytes : {0ull, 4096ull, 8191ull, 8192ull, 16384ull, 17919ull}) {
    CHECK(clause_of([&] { (void)decode_directory_entry(bytes, example_file(), file_bytes); }) ==
          kExtent);
  }
  CHECK_NOTHROW((void)decode_directory_entry(bytes, example_file(), 17920));
}

TEST_CASE("directory: an entry obeys the rules of its page's header", "[format][directory]") {
  const auto entry = [](auto change) { return changed_entry(change); };
  CHECK(entry([](DirectoryEntry& e) { e.type = PageType{0}; }) == "spec/container.md#page-type");
  for (const PageType type : {PageType{7}, PageType{64}, PageType{127}}) {
    CHECK(entry([=](DirectoryEntry& e) { e.type = type; }) == "spec/container.md#page-type");
  }
  for (const PageType type : {PageType{128}, PageType{255}}) {
    CHECK(entry([=](DirectoryEntry& e) {
            e.type = type;
            e.first_key = 0;
          }) == "none");
  }
  CHECK(entry([](DirectoryEntry& e) { e.raw_bytes = 5000; }) == "spec/container.md#page-length");
  CHECK(entry([](DirectoryEntry& e) { e.stored_bytes = e.raw_bytes + 1; }) ==
        "spec/container.md#page-length");
  CHECK(entry([](DirectoryEntry& e) { e.record_count = 39; }) == "spec/container.md#page-fields");
  CHECK(entry([](DirectoryEntry& e) { e.group = 3; }) == "spec/container.md#page-fields");
  CHECK(entry([](DirectoryEntry& e) { e.level = 62; }) == "spec/container.md#page-fields");
  CHECK(entry([](DirectoryEntry& e) { e.first_key = 1ull << 63; }) ==
        "spec/container.md#page-keys");
  CHECK(entry([](DirectoryEntry& e) { e.type = PageType{128}; }) == "spec/container.md#page-keys");
  EntryBytes reserved = encode_entry(example_entry());
  reserved[39] = std::byte{1};
  CHECK(clause_of([&] { (void)decode_directory_entry(reserved, example_file(), 65536); }) ==
        "spec/container.md#page-fields");
  CHECK(entry([](DirectoryEntry& e) {
          e.type = PageType::directory;
          e.raw_bytes = 40 * e.record_count;
        }) == "spec/container.md#directory-listing");
}

TEST_CASE("directory: only an attribute page may be void, and then it has no place and no bytes",
          "[format][directory]") {
  constexpr char kLength[] = "spec/container.md#page-length";
  const auto make_void = [](DirectoryEntry& e) {
    e = {};
    e.type = PageType::attribute;
    e.group = 1;
    e.record_count = 40;
  };
  const auto with = [&](auto change) {
    return changed_entry([&](DirectoryEntry& e) {
      make_void(e);
      change(e);
    });
  };
  DirectoryEntry entry;
  make_void(entry);
  CHECK(entry.is_void());
  CHECK_FALSE(example_entry().is_void());
  CHECK(decode_directory_entry(encode_entry(entry), example_file(), 0) == entry);
  CHECK(with([](DirectoryEntry& e) { e.offset = 8192; }) == kLength);
  CHECK(with([](DirectoryEntry& e) { e.stored_bytes = 1; }) == kLength);
  CHECK(with([](DirectoryEntry& e) { e.payload_xxh3 = 1; }) == kLength);
  CHECK(with([](DirectoryEntry& e) { e.record_count = 0; }) == "spec/container.md#page-fields");
  CHECK(with([](DirectoryEntry& e) { e.group = 0; }) == "spec/container.md#page-fields");
  CHECK(with([](DirectoryEntry& e) { e.level = 0; }) == "spec/container.md#page-fields");
  CHECK(with([](DirectoryEntry& e) { e.first_key = 1; }) == "spec/container.md#page-keys");
  for (const PageType type :
       {PageType::node, PageType::point, PageType::meta, PageType::parts, PageType{128}}) {
    CHECK(with([=](DirectoryEntry& e) {
            e.type = type;
            e.group = 0;
            e.level = type == PageType::node ? 0 : kNoLevel;
          }) == kLength);
  }
  // A page that is in the file has a payload.
  CHECK(changed_page([](PageHeader& h) {
          h.type = PageType::attribute;
          h.group = 1;
          h.first_key = h.last_key = 0;
          h.coding.codec = Codec::raw;
          h.stored_bytes = h.raw_bytes = 0;
        }) == kLength);
}

TEST_CASE("directory: its size follows from the number of pages", "[format][directory]") {
  FileHeader file = example_file();
  CHECK(directory_entries_per_page(file) == 100);
  CHECK(directory_bytes(file, 1) == 4096);
  CHECK(directory_bytes(file, 100) == 4096);
  CHECK(directory_bytes(file, 101) == 8192);
  file.page_shift = 16;
  CHECK(directory_entries_per_page(file) == 1636);
  CHECK(directory_bytes(file, 100) == 4096);
  CHECK(directory_bytes(file, 101) == 8192);
  CHECK(directory_bytes(file, 1636) == 65536);
  CHECK(directory_bytes(file, 1637) == 65536 + 4096);
  const std::uint64_t full = 0xfffffffe / 1636, rest = 0xfffffffe % 1636;
  CHECK(directory_bytes(file, 0xfffffffe) == full * 65536 + round_up(64 + 40 * rest, 4096));
}

TEST_CASE("pages: their numbers follow from type, group and rank", "[format][directory]") {
  Superblock s;
  s.point_pages = 5;
  s.node_pages = 3;
  s.attribute_groups = 2;
  s.page_count = 5 + 2 * 5 + 3 + 4 + 1;  // four pages of other types
  const PageNumbers numbers(s, {2, 7});
  const auto listed = [](const PageNumbers::Range& range) {
    return std::vector<std::uint32_t>(range.begin(), range.end());
  };
  CHECK(listed(numbers.points()) == std::vector<std::uint32_t>{0, 1, 2, 3, 4});
  CHECK(listed(numbers.attributes(2)) == std::vector<std::uint32_t>{5, 6, 7, 8, 9});
  CHECK(listed(numbers.attributes(7)) == std::vector<std::uint32_t>{10, 11, 12, 13, 14});
  CHECK(numbers.attributes(1).empty());
  CHECK(listed(numbers.nodes()) == std::vector<std::uint32_t>{15, 16, 17});
  CHECK(listed(numbers.others()) == std::vector<std::uint32_t>{18, 19, 20, 21});
  CHECK(numbers.meta() == 22);
  CHECK(std::ranges::equal(numbers.groups(), std::array{2, 7}));
}

TEST_CASE("pages: a range of pages knows its members and its parts", "[format][directory]") {
  constexpr PageNumbers::Range kRange{10, 4};
  CHECK(kRange.size() == 4);
  CHECK(kRange[3] == 13);
  for (std::uint32_t page = 0; page < 20; ++page) {
    CHECK(kRange.contains(page) == (page >= 10 && page < 14));
  }
  const PageNumbers::Range part = kRange.subrange(1, 2);
  CHECK(part.first == 11);
  CHECK(part.size() == 2);
  CHECK(kRange.subrange(4, 0).empty());
}

TEST_CASE("container: the points of a page are a multiple of 8 that fits", "[format][container]") {
  FileHeader file = example_file();
  for (const std::uint8_t point_bytes : {kPointBytes, kEmittingPointBytes}) {
    file.point_bytes = point_bytes;
    for (std::uint8_t shift = 12; shift <= 20; ++shift) {
      file.page_shift = shift;
      const std::uint32_t points = points_per_page(file);
      const std::uint64_t limit = (1ull << shift) - kPageHeaderBytes;
      CHECK(points % 8 == 0);
      CHECK(std::uint64_t{point_bytes} * points <= limit);
      CHECK(std::uint64_t{point_bytes} * (points + 8) > limit);
    }
  }
}
