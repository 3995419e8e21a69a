// The superblock: what it repeats, counts and bounds.
#include <limits>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "format/checksum.h"
#include "format/container.h"
#include "format/point_page.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using ptc::test::put;

namespace {

constexpr std::uint64_t kSeed = 0x5250555358435450;  // "PTCXSUPR"
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Superblock example() {
  Superblock s;
  for (std::size_t i = 0; i < 16; ++i) s.header.uuid[i] = static_cast<std::byte>(255 - i);
  s.header.page_shift = 12;
  s.page_count = 130;
  s.directory_pages = 2;
  s.directory_offset = 4096 * 131;
  s.file_bytes = s.directory_offset + 2 * 4096 + 8192;
  s.directory_xxh3 = 0x0123456789abcdef;
  s.meta_page = 129;
  s.root_page = 128;
  s.root_slot = 7;
  s.levels = 63;
  s.leaf_points = 8;
  s.points_per_page = points_per_page(s.header);
  s.points = 10000;
  s.nodes = 4000;
  s.node_groups = 900;
  s.bounds_low = {-3.5, 2.25, 0};
  s.bounds_high = {3.5, 9, 0};
  s.area = 12.5;
  s.flux = {1, 2, 3};
  s.content_xxh3 = {5, 6};
  s.writer = std::string("ptc 0.1.0");
  return s;
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
  CHECK(back.root_page == 128);
  CHECK(back.root_slot == 7);
  CHECK(back.levels == 63);
  CHECK(back.points == 10000);
  CHECK(back.bounds_high == s.bounds_high);
  CHECK(back.flux == s.flux);
  CHECK(back.content_xxh3 == s.content_xxh3);
  CHECK(back.writer == "ptc 0.1.0");
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
  CHECK(with([](Superblock& s) { s.page_count = 126; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_pages = 1; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset += 4096; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset -= 4096; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset += 1; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset = ~0ull; }) == kPages);
  CHECK(with([](Superblock& s) { s.directory_offset = 0; }) == kPages);
  CHECK(with([](Superblock& s) { s.meta_page = 130; }) == kPages);
  CHECK(with([](Superblock& s) { s.meta_page = kNoPage; }) == kPages);
}

TEST_CASE("superblock: root and counts agree with each other", "[format][superblock]") {
  constexpr char kRoot[] = "spec/container.md#superblock-root";
  constexpr char kCounts[] = "spec/container.md#superblock-counts";
  const auto with = [](auto change) { return changed(change); };
  CHECK(with([](Superblock& s) { s.root_page = 130; }) == kRoot);
  CHECK(with([](Superblock& s) { s.root_page = kNoPage; }) == kRoot);
  CHECK(with([](Superblock& s) { s.levels = 64; }) == kRoot);
  CHECK(with([](Superblock& s) { s.levels = 0; }) == kRoot);
  CHECK(with([](Superblock& s) { s.leaf_points = 0; }) == kCounts);
  CHECK(with([](Superblock& s) { s.leaf_points = 65536; }) == kCounts);
  CHECK(with([](Superblock& s) { s.points_per_page = 0; }) == kCounts);
  CHECK(with([](Superblock& s) { s.points_per_page += 1; }) == kCounts);
  CHECK(with([](Superblock& s) { s.points = (1ull << 48) + 1; }) == kCounts);
  CHECK(with([](Superblock& s) { s.nodes = (1ull << 48) + 1; }) == kCounts);
  CHECK(with([](Superblock& s) { s.node_groups = s.nodes + 1; }) == kCounts);
  CHECK(with([](Superblock& s) { s.nodes = s.node_groups = 0; }) == kCounts);
  CHECK(with([](Superblock& s) { s.points = 0; }) == kCounts);

  const auto empty = [](Superblock& s) {
    s.points = s.nodes = s.node_groups = 0;
    s.root_page = kNoPage;
    s.root_slot = s.levels = 0;
  };
  CHECK(with(empty) == "none");
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
  CHECK(resealed(172, std::uint32_t{1}) == kZero);
  CHECK(resealed(392, 'x') == kZero);
  CHECK(resealed(4087, 'x') == kZero);
}
