// The superblock: what it repeats, counts and bounds, and the pages of the tail that it lists.
#include <limits>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "format/checksum.h"
#include "format/container.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using ptc::test::get;
using ptc::test::put;

namespace {

constexpr std::uint64_t kSeed = 0x5250555358435450;  // "PTCXSUPR"
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The entries of node pages of five sectors each and, at the end, of a meta page.
std::vector<DirectoryEntry> tail_of(std::uint64_t offset, std::uint32_t pages) {
  std::vector<DirectoryEntry> tail(pages);
  for (std::uint32_t i = 0; i < pages; ++i) {
    DirectoryEntry& entry = tail[i];
    entry.offset = offset + i * std::uint64_t{2560};
    entry.stored_bytes = entry.raw_bytes = 2048 - 64 + 1 + i;
    entry.payload_xxh3 = 0x1111 * i;
    entry.record_count = 1;
    entry.type = i + 1 < pages ? PageType::node : PageType::meta;
    entry.level = i + 1 < pages ? static_cast<std::uint8_t>(i % 63) : kNoLevel;
    entry.first_key = i + 1 < pages ? i : 0;
  }
  return tail;
}

Superblock example() {
  Superblock s;
  for (std::size_t i = 0; i < 16; ++i) s.header.uuid[i] = static_cast<std::byte>(255 - i);
  s.header.page_shift = 12;
  s.page_count = 130;  // 80 of points, 45 of nodes, four skippable ones and the meta page
  s.point_pages = 40;
  s.attribute_groups = 1;
  s.node_pages = 45;
  s.directory_pages = 2;
  s.directory_offset = 4096 * 131;
  s.tail_offset = s.directory_offset + 2 * 4096;
  s.file_bytes = s.tail_offset + 4 * 4096 + 8192;
  s.directory_xxh3 = 0x0123456789abcdef;
  s.root_page = 44;
  s.root_slot = 7;
  s.levels = 63;
  s.leaf_points = 8;
  s.points = 10000;
  s.nodes = 4000;
  s.node_groups = 900;
  s.bounds_low = {-3.5, 2.25, 0};
  s.bounds_high = {3.5, 9, 0};
  s.area = 12.5;
  s.flux = {1, 2, 3};
  s.content_xxh3 = {5, 6};
  s.writer = std::string("ptc 0.1.0");
  s.tail = tail_of(s.tail_offset, 6);
  return s;
}

// Changes the number of pages in the tail, and the length of the file with it.
void resize_tail(Superblock& s, std::uint32_t pages) {
  s.tail = tail_of(s.tail_offset, pages);
  s.file_bytes = s.tail_offset + round_up(pages * std::uint64_t{2560}, 4096) + 8192;
}

std::string clause(const Block& block, const Superblock& s) {
  return clause_of([&] { (void)decode_superblock(block, s.header, s.file_bytes); });
}

// Returns the clause that a superblock breaks under a correct checksum.
template <class Change>
std::string changed(const Change& change) {
  Superblock s = example();
  change(s);
  return clause(encode_superblock(s), s);
}

template <class T>
std::string resealed(std::size_t at, T value) {
  const Superblock s = example();
  Block block = encode_superblock(s);
  put(block, at, value);
  put(block, 4088, xxh3_64(std::span(block).first(4088), kSeed));
  return clause(block, s);
}

}  // namespace

TEST_CASE("superblock: decoding an encoded superblock gives it back", "[format][superblock]") {
  const Superblock s = example();
  const Superblock back = decode_superblock(encode_superblock(s), s.header, s.file_bytes);
  CHECK(encode_superblock(back) == encode_superblock(s));
  CHECK(back.page_count == 130);
  CHECK(back.directory_offset == s.directory_offset);
  CHECK(back.tail_offset == s.tail_offset);
  CHECK(back.point_pages == 40);
  CHECK(back.node_pages == 45);
  CHECK(back.attribute_groups == 1);
  CHECK(back.leaf_points == 8);
  CHECK(back.tail == s.tail);
  CHECK(back.root_page == 44);
  CHECK(back.root_slot == 7);
  CHECK(back.levels == 63);
  CHECK(back.points == 10000);
  CHECK(back.bounds_high == s.bounds_high);
  CHECK(back.flux == s.flux);
  CHECK(back.content_xxh3 == s.content_xxh3);
  CHECK(back.writer == "ptc 0.1.0");
}

TEST_CASE("superblock: its bytes lie where the spec says", "[format][superblock]") {
  const Superblock s = example();
  const Block block = encode_superblock(s);
  CHECK(std::memcmp(block.data(), "PTCXSUPR", 8) == 0);
  CHECK(get<std::uint64_t>(block, 120) == s.file_bytes);
  CHECK(get<std::uint32_t>(block, 128) == 130);
  CHECK(get<std::uint32_t>(block, 132) == 2);
  CHECK(get<std::uint64_t>(block, 136) == s.directory_offset);
  CHECK(get<std::uint64_t>(block, 144) == s.directory_xxh3);
  CHECK(get<std::uint32_t>(block, 152) == 40);
  CHECK(get<std::uint32_t>(block, 156) == 45);
  CHECK(get<std::uint32_t>(block, 160) == 44);
  CHECK(get<std::uint16_t>(block, 164) == 7);
  CHECK(get<std::uint16_t>(block, 166) == 63);
  CHECK(get<std::uint16_t>(block, 168) == 1);
  CHECK(get<std::uint32_t>(block, 172) == 8);
  CHECK(get<std::uint64_t>(block, 176) == 10000);
  CHECK(get<std::uint64_t>(block, 184) == 4000);
  CHECK(get<std::uint64_t>(block, 192) == 900);
  CHECK(get<std::uint64_t>(block, 200) == s.tail_offset);
  CHECK(get<std::uint16_t>(block, 208) == 6);
  CHECK(get<double>(block, 232) == -3.5);
  CHECK(get<double>(block, 264) == 9);
  CHECK(get<double>(block, 280) == 12.5);
  CHECK(get<double>(block, 304) == 3);
  CHECK(get<std::uint64_t>(block, 320) == 6);
  CHECK(std::memcmp(&block[328], "ptc 0.1.0", 10) == 0);
  for (std::size_t i = 0; i < 6; ++i) {
    CHECK(get<std::uint64_t>(block, 512 + 40 * i) == s.tail[i].offset);
  }
}

TEST_CASE("superblock: every truncation and every flipped bit is refused", "[format][superblock]") {
  const Superblock s = example();
  const Block block = encode_superblock(s);
  unsigned accepted = 0;
  for (std::size_t n = 0; n < block.size(); ++n) {
    const auto prefix = std::span(block).first(n);
    accepted +=
        clause_of([&] { (void)decode_superblock(prefix, s.header, s.file_bytes); }) == "none";
  }
  for (std::size_t bit = 0; bit < 8 * block.size(); ++bit) {
    Block flipped = block;
    flipped[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    accepted += clause(flipped, s) == "none";
  }
  CHECK(accepted == 0);
}

TEST_CASE("superblock: a file without a superblock is unfinished", "[format][superblock]") {
  CHECK(clause(Block{}, example()) == "spec/container.md#superblock-magic");
}

TEST_CASE("superblock: it is valid for one file header and one file length only",
          "[format][superblock]") {
  const Superblock s = example();
  const Block block = encode_superblock(s);
  const auto under = [&](auto change) {
    FileHeader header = s.header;
    change(header);
    return clause_of([&] { (void)decode_superblock(block, header, s.file_bytes); });
  };
  CHECK(under([](FileHeader&) {}) == "none");
  CHECK(under([](FileHeader& h) { h.uuid[3] ^= std::byte{1}; }) ==
        "spec/container.md#superblock-header");
  CHECK(under([](FileHeader& h) { h.minor = 1; }) == "spec/container.md#superblock-header");
  CHECK(under([](FileHeader& h) { h.page_shift = 13; }) == "spec/container.md#superblock-header");
  CHECK(under([](FileHeader& h) { h.point_bytes = kEmittingPointBytes; }) ==
        "spec/container.md#superblock-header");
  for (const std::uint64_t file_bytes :
       {s.file_bytes - 4096, s.file_bytes + 4096, s.file_bytes + 1, std::uint64_t{0}}) {
    CHECK(clause_of([&] { (void)decode_superblock(block, s.header, file_bytes); }) ==
          "spec/container.md#superblock-length");
  }
  CHECK(changed([](Superblock& b) { b.file_bytes += 1; }) == "spec/container.md#superblock-length");
}

TEST_CASE("superblock: pages and directory must fill the file", "[format][superblock]") {
  constexpr char kPages[] = "spec/container.md#superblock-pages";
  const auto with = [](auto change) { return changed(change); };
  CHECK(with([](Superblock& s) { s.page_count = 0; }) == kPages);
  CHECK(with([](Superblock& s) { s.page_count = kNoPage; }) == kPages);
  CHECK(with([](Superblock& s) { s.page_count = 100; }) == kPages);  // fill one page
  CHECK(with([](Superblock& s) { s.page_count = 201; }) == kPages);  // fill three
  CHECK(with([](Superblock& s) { s.directory_pages = 1; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_pages = 3; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset += 4096; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset -= 4096; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset += 1; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset = ~0ull; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset = 0; }) == kPages);
  CHECK(with([](Superblock& s) { s.tail_offset += 4096; }) == kPages);
  CHECK(with([](Superblock& s) { s.tail_offset = 0; }) == kPages);
  CHECK(with([](Superblock& s) { s.tail_offset = ~0ull - 4095; }) == kPages);
  // Directory and tail lie where they should, relative to each other.
  const auto shifted = [&](std::uint64_t by) {
    return with([=](Superblock& s) {
      s.directory_offset += by;
      s.tail_offset += by;
    });
  };
  CHECK(shifted(1) == kPages);
  CHECK(shifted(512) == kPages);
  CHECK(shifted(6 * 4096) == kPages);                        // the tail starts past the superblocks
  CHECK(shifted(0 - example().directory_offset) == kPages);  // on the header
}

TEST_CASE("superblock: there are as many pages as points, attributes, nodes and meta need",
          "[format][superblock]") {
  constexpr char kPages[] = "spec/container.md#superblock-pages";
  const auto with = [](auto change) { return changed(change); };
  CHECK(with([](Superblock& s) { s.page_count = 126; }) == "none");
  CHECK(with([](Superblock& s) { s.page_count = 125; }) == kPages);
  CHECK(with([](Superblock& s) { s.node_pages = 49; }) == "none");
  CHECK(with([](Superblock& s) { s.node_pages = 50; }) == kPages);
  CHECK(with([](Superblock& s) { s.point_pages = 42; }) == "none");
  CHECK(with([](Superblock& s) { s.point_pages = 43; }) == kPages);
  CHECK(with([](Superblock& s) { s.attribute_groups = 2; }) == kPages);
  CHECK(with([](Superblock& s) { s.attribute_groups = 0xffff; }) == kPages);
  CHECK(with([](Superblock& s) { s.point_pages = s.node_pages = 0xffffffff; }) == kPages);
}

TEST_CASE("superblock: the tail has 1 to 64 pages", "[format][superblock]") {
  constexpr char kTail[] = "spec/container.md#tail-pages";
  for (std::uint32_t pages = 1; pages <= 64; ++pages) {
    CHECK(changed([=](Superblock& s) { resize_tail(s, pages); }) == "none");
  }
  Superblock s = example();
  resize_tail(s, 65);
  CHECK_THROWS_AS(encode_superblock(s), std::invalid_argument);
  for (const unsigned pages : {0U, 1U, 5U, 65U, 66U, 0xffffU}) {
    CHECK(resealed(208, static_cast<std::uint16_t>(pages)) == kTail);
  }
  // Zeros in place of an entry have no type.
  for (const unsigned pages : {7U, 64U}) {
    CHECK(resealed(208, static_cast<std::uint16_t>(pages)) == "spec/container.md#page-type");
  }
  CHECK(changed([](Superblock& b) { b.tail.clear(); }) == kTail);
  // It does not have more pages than the file.
  const auto of_file = [](std::uint32_t all_pages, std::uint32_t pages) {
    return changed([=](Superblock& b) {
      b.page_count = all_pages;
      b.point_pages = b.attribute_groups = 0;
      b.directory_pages = 1;
      b.tail_offset -= 4096;
      resize_tail(b, pages);
    });
  };
  CHECK(of_file(64, 64) == "none");
  CHECK(of_file(46, 46) == "none");
  CHECK(of_file(46, 47) == kTail);
}

TEST_CASE("superblock: the bytes behind the entries of the tail are zero", "[format][superblock]") {
  for (std::size_t at = 512 + 6 * 40; at < 3072; ++at) {
    if (resealed(at, 'x') != "spec/container.md#tail-pages") FAIL("byte " << at);
  }
}

TEST_CASE("superblock: the pages of the tail fill it from the directory to the superblocks",
          "[format][superblock]") {
  constexpr char kTail[] = "spec/container.md#tail-pages";
  const auto with = [](auto change) { return changed(change); };
  CHECK(with([](Superblock&) {}) == "none");
  for (std::size_t i = 0; i < 6; ++i) {
    CHECK(with([=](Superblock& s) { s.tail[i].offset += 512; }) == kTail);
    CHECK(with([=](Superblock& s) { s.tail[i].offset -= 512; }) == kTail);
    CHECK(with([=](Superblock& s) {
            for (std::size_t k = i; k < 6; ++k) s.tail[k].offset += 512;
          }) == kTail);
  }
  CHECK(with([](Superblock& s) { std::swap(s.tail[1], s.tail[2]); }) == kTail);
  // Pages that end in another block than the tail does.
  CHECK(with([](Superblock& s) { s.file_bytes += 4096; }) == kTail);
  CHECK(with([](Superblock& s) { s.tail.resize(4); }) == kTail);
  CHECK(with([](Superblock& s) { s.tail.back().stored_bytes = s.tail.back().raw_bytes = 3520; }) ==
        "none");
  // Pages of points and attributes do not belong there.
  CHECK(with([](Superblock& s) {
          s.tail[2].type = PageType::point;
          s.tail[2].level = kNoLevel;
          s.tail[2].record_count = 59;
          s.tail[2].raw_bytes = s.tail[2].stored_bytes = 59 * 34;
        }) == kTail);
  CHECK(with([](Superblock& s) {
          s.tail[2].type = PageType::attribute;
          s.tail[2].group = 1;
          s.tail[2].level = kNoLevel;
          s.tail[2].first_key = 0;
        }) == kTail);
  CHECK(with([](Superblock& s) {
          s.tail[2] = {};
          s.tail[2].type = PageType::attribute;
          s.tail[2].group = 1;
          s.tail[2].record_count = 1;
        }) == kTail);
  CHECK(with([](Superblock& s) {
          s.tail[4].type = PageType{130};
          s.tail[4].level = kNoLevel;
          s.tail[4].first_key = 0;
        }) == "none");
}

TEST_CASE("superblock: an entry of the tail keeps the rules of the directory",
          "[format][superblock]") {
  const auto with = [](auto change) { return changed(change); };
  CHECK(with([](Superblock& s) { s.tail[3].type = PageType{7}; }) == "spec/container.md#page-type");
  CHECK(with([](Superblock& s) { s.tail[3].type = PageType::directory; }) ==
        "spec/container.md#directory-listing");
  CHECK(with([](Superblock& s) { s.tail[3].level = 63; }) == "spec/container.md#page-fields");
  CHECK(with([](Superblock& s) { s.tail[3].raw_bytes = 5000; }) == "spec/container.md#page-length");
  CHECK(with([](Superblock& s) { s.tail[3].offset += 1; }) == "spec/container.md#directory-extent");
  CHECK(with([](Superblock& s) { s.tail[3].offset = s.file_bytes; }) ==
        "spec/container.md#directory-extent");
  CHECK(with([](Superblock& s) { s.tail[3].first_key = 1ull << 63; }) ==
        "spec/container.md#page-keys");
  // The error names the place in the superblock.
  Superblock s = example();
  s.tail[3].offset += 1;
  try {
    (void)decode_superblock(encode_superblock(s), s.header, s.file_bytes);
    FAIL("it was accepted");
  } catch (const FormatError& error) {
    CHECK(error.offset() == 512 + 3 * 40);
  }
}

TEST_CASE("superblock: root and counts agree with each other", "[format][superblock]") {
  constexpr char kRoot[] = "spec/container.md#superblock-root";
  constexpr char kCounts[] = "spec/container.md#superblock-counts";
  const auto with = [](auto change) { return changed(change); };
  CHECK(with([](Superblock& s) { s.root_page = 45; }) == kRoot);
  CHECK(with([](Superblock& s) { s.root_page = kNoPage; }) == kRoot);
  CHECK(with([](Superblock& s) { s.levels = 64; }) == kRoot);
  CHECK(with([](Superblock& s) { s.levels = 0; }) == kRoot);
  CHECK(with([](Superblock& s) { s.leaf_points = 0; }) == kCounts);
  CHECK(with([](Superblock& s) { s.leaf_points = 65536; }) == kCounts);
  CHECK(with([](Superblock& s) { s.leaf_points = 65535; }) == "none");
  CHECK(with([](Superblock& s) { s.points = (1ull << 48) + 1; }) == kCounts);
  CHECK(with([](Superblock& s) { s.nodes = (1ull << 48) + 1; }) == kCounts);
  CHECK(with([](Superblock& s) { s.node_groups = s.nodes + 1; }) == kCounts);
  CHECK(with([](Superblock& s) { s.nodes = s.node_groups = 0; }) == kCounts);
  CHECK(with([](Superblock& s) { s.points = 0; }) == kCounts);
  const auto groups = [&](std::uint16_t count) {
    return with([=](Superblock& s) {
      s.point_pages = 0;
      s.attribute_groups = count;
    });
  };
  CHECK(groups(255) == "none");
  CHECK(groups(256) == kCounts);
  CHECK(groups(65535) == kCounts);

  const auto empty = [](Superblock& s) {
    s.points = s.nodes = s.node_groups = 0;
    s.root_page = kNoPage;
    s.root_slot = s.levels = 0;
  };
  CHECK(with(empty) == "none");
  CHECK(with([&](Superblock& s) {
          empty(s);
          s.leaf_points = 0;
        }) == "none");
  CHECK(with([&](Superblock& s) {
          empty(s);
          s.root_page = 0;
        }) == kRoot);
  CHECK(with([&](Superblock& s) {
          empty(s);
          s.root_slot = 1;
        }) == kRoot);
  CHECK(with([&](Superblock& s) {
          empty(s);
          s.levels = 1;
        }) == kRoot);
}

TEST_CASE("superblock: totals are finite, bounds ordered", "[format][superblock]") {
  constexpr char kTotals[] = "spec/container.md#superblock-totals";
  const auto with = [](auto change) { return changed(change); };
  for (const double bad : {kNan, kInfinity, -kInfinity, -1.0}) {
    CHECK(with([=](Superblock& s) { s.area = bad; }) == kTotals);
    for (std::size_t i = 0; i < 3; ++i)
      CHECK(with([=](Superblock& s) { s.flux[i] = bad; }) == kTotals);
  }
  for (const double bad : {kNan, kInfinity, -kInfinity, 100.0}) {
    CHECK(with([=](Superblock& s) { s.bounds_low[1] = bad; }) == kTotals);
    CHECK(with([=](Superblock& s) { s.bounds_high[1] = -bad; }) == kTotals);
  }
}

TEST_CASE("superblock: the writer's name is UTF-8 followed by zeros", "[format][superblock]") {
  constexpr char kWriter[] = "spec/container.md#superblock-writer";
  CHECK(resealed(328, '\xff') == kWriter);
  CHECK(resealed(328 + 63, 'x') == kWriter);
  CHECK(resealed(328 + 10, 'x') == kWriter);  // after the NUL
  Superblock s = example();
  s.writer = std::string(63, 'x');
  CHECK(decode_superblock(encode_superblock(s), s.header, s.file_bytes).writer == s.writer);
  s.writer += 'x';
  CHECK_THROWS_AS(encode_superblock(s), std::invalid_argument);
  s.writer = std::string("\xc0");
  CHECK_THROWS_AS(encode_superblock(s), std::invalid_argument);
}

TEST_CASE("superblock: reserved bytes are zero", "[format][superblock]") {
  constexpr char kZero[] = "spec/container.md#superblock-zero";
  for (const auto& [first, last] : {std::pair{170, 172}, {210, 232}, {392, 512}, {3072, 4088}}) {
    for (int at = first; at < last; ++at) {
      if (resealed(static_cast<std::size_t>(at), 'x') != kZero) FAIL("byte " << at);
    }
  }
}
