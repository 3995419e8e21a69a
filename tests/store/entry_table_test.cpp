// Entries are read back as they were set, and are not held in memory in between.
#include "engine/store/entry_table.h"

#include <stdexcept>
#include <thread>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "tests/store/sample.h"

using namespace ptc;
using namespace ptc::test;

namespace {

DirectoryEntry entry(std::uint32_t page) {
  return {kBlockBytes + std::uint64_t{page} * kSectorBytes,
          page + 1,
          page + 2,
          ~std::uint64_t{page},
          PageType::attribute,
          7,
          page + 3};
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

TEST_CASE("entry table: entries set in any order are encoded in page order", "[store][entries]") {
  const TemporaryDirectory scratch;
  EntryTable table(scratch.path());
  CHECK(table.complete());
  CHECK(table.encoded().empty());
  CHECK(table.add(3) == 0);
  CHECK(table.add(1) == 3);
  CHECK(table.size() == 4);
  for (const std::uint32_t page : {3U, 0U, 2U}) table.set(page, entry(page));
  CHECK(table.has(3));
  CHECK_FALSE(table.has(1));
  CHECK_FALSE(table.complete());
  table.set(1, entry(1));
  CHECK(table.complete());
  CHECK((table.encoded() == encoded_entries(4)));
  CHECK_THROWS_AS(table.set(4, entry(4)), std::out_of_range);
  CHECK_THROWS_AS(table.has(4), std::out_of_range);
  CHECK_THROWS_AS(table.add(kMaxPages - 3), RequestError);
}

TEST_CASE("entry table: several threads can add and set pages", "[store][entries]") {
  const TemporaryDirectory scratch;
  EntryTable table(scratch.path());
  constexpr std::uint32_t kEach = 2000;
  const auto fill = [&] {
    for (std::uint32_t i = 0; i < kEach; ++i) {
      const std::uint32_t page = table.add(1);
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
  constexpr std::uint32_t kPages = 300'000;  // whose entries take 9.6 MB
  const std::uint64_t before = resident_bytes();
  static_cast<void>(table.add(kPages));
  for (std::uint32_t page = kPages; page-- > 0;) table.set(page, entry(page));
  CHECK(resident_bytes() < before + (2 << 20));
}
