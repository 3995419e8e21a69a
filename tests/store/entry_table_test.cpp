// Entries are read back as they were set, and are not held in memory in between.
#include "engine/store/entry_table.h"

#include <array>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "tests/store/sample.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr PageType kType = PageType::attribute;
constexpr std::uint8_t kGroup = 7;

DirectoryEntry entry(std::uint32_t page) {
  return {kBlockBytes + std::uint64_t{page} * kSectorBytes,
          page + 1,
          page + 2,
          ~std::uint64_t{page},
          page + 4,
          page + 3,
          kType,
          kGroup};
}

std::vector<std::byte> encoded_entries(std::uint32_t pages) {
  std::vector<std::byte> all(std::size_t{pages} * kDirectoryEntryBytes);
  for (std::uint32_t page = 0; page < pages; ++page) {
    encode_directory_entry(
        entry(page),
        std::span(all).subspan(page * kDirectoryEntryBytes).first<kDirectoryEntryBytes>());
  }
  return all;
}

}  // namespace

TEST_CASE("entry table: entries set in any order are encoded in the order of their ranks",
          "[store][entries]") {
  const TemporaryDirectory scratch;
  EntryTable table(scratch.path());
  CHECK(table.complete());
  CHECK(table.encoded().empty());
  CHECK(table.add(kType, kGroup, 3) == 0);
  CHECK(table.add(kType, kGroup, 1) == 3);
  CHECK(table.size() == 4);
  for (const std::uint32_t page : {3U, 0U, 2U}) table.set(page, entry(page));
  CHECK_FALSE(table.awaits(kType, kGroup, 3));
  CHECK(table.awaits(kType, kGroup, 1));
  CHECK_FALSE(table.complete());
  table.set(1, entry(1));
  CHECK(table.complete());
  CHECK((table.encoded() == encoded_entries(4)));
  CHECK_FALSE(table.awaits(kType, kGroup, 4));
  CHECK_THROWS_AS(table.set(4, entry(4)), std::out_of_range);
}

TEST_CASE("entry table: pages of all kinds together are at most as many as a file can have",
          "[store][entries]") {
  const TemporaryDirectory scratch;
  EntryTable table(scratch.path());
  static_cast<void>(table.add(PageType::point, 0, 3));
  static_cast<void>(table.add(PageType::node, 0, 1));
  CHECK_THROWS_AS(table.add(PageType::point, 0, kMaxPages - 3), RequestError);
  CHECK_THROWS_AS(table.add(PageType::meta, 0, kMaxPages - 3), RequestError);
  CHECK(table.size() == 4);
}

TEST_CASE("entry table: pages of each kind are counted from 0 and stand in the directory's order",
          "[store][entries]") {
  const TemporaryDirectory scratch;
  EntryTable table(scratch.path());
  const std::vector<std::pair<PageType, std::uint8_t>> order{
      {PageType::point, 0}, {PageType::attribute, 1}, {PageType::attribute, 255},
      {PageType::node, 0},  {PageType::parts, 0},     {PageType{128}, 0},
      {PageType{255}, 0},   {PageType::meta, 0}};
  std::vector<std::byte> expected;
  for (std::size_t i = order.size(); i-- > 0;) {
    const auto [type, group] = order[i];
    CHECK(table.size(type, group) == 0);
    CHECK_FALSE(table.awaits(type, group, 0));
    CHECK(table.add(type, group, 2) == 0);
    CHECK(table.size(type, group) == 2);
    for (const std::uint32_t rank : {1U, 0U}) {
      DirectoryEntry it = entry(static_cast<std::uint32_t>(2 * i) + rank);
      it.type = type;
      it.group = group;
      CHECK(table.awaits(type, group, rank));
      table.set(rank, it);
      std::array<std::byte, kDirectoryEntryBytes> bytes;
      encode_directory_entry(it, bytes);
      expected.insert(expected.begin(), bytes.begin(), bytes.end());
    }
  }
  CHECK(table.complete());
  CHECK(table.size() == 2 * order.size());
  CHECK((table.encoded() == expected));
}

TEST_CASE("entry table: several threads can add and set pages", "[store][entries]") {
  const TemporaryDirectory scratch;
  EntryTable table(scratch.path());
  constexpr std::uint32_t kEach = 2000;
  const auto fill = [&] {
    for (std::uint32_t i = 0; i < kEach; ++i) {
      const std::uint32_t page = table.add(kType, kGroup, 1);
      table.set(page, entry(page));
    }
  };
  std::jthread other(fill);
  fill();
  other.join();
  CHECK(table.complete());
  CHECK((table.encoded() == encoded_entries(2 * kEach)));
}

TEST_CASE("entry table: a page takes no more than one bit of memory", "[store][entries]") {
  const TemporaryDirectory scratch;
  EntryTable table(scratch.path());
  constexpr std::uint32_t kPages = 300'000;  // whose entries take 12 MB
  const std::uint64_t before = resident_bytes();
  static_cast<void>(table.add(kType, kGroup, kPages));
  for (std::uint32_t page = kPages; page-- > 0;) table.set(page, entry(page));
  CHECK(resident_bytes() < before + (2 << 20));
}
