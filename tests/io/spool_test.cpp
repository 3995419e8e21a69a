// Lists that move from memory to a temporary file.
#include "engine/io/file/spool.h"

#include <array>
#include <cstdint>

#include <catch2/catch.hpp>

#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

using Item = std::array<std::uint32_t, 3>;  // 12 bytes, which divide no block evenly

Item item(std::uint64_t i) {
  return {static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(i * i), 7};
}

}  // namespace

TEST_CASE("spool: items are the same in memory, on the disk and in between", "[io][spool]") {
  const test::TemporaryDirectory dir;
  constexpr std::uint64_t kItems = 100'000;
  for (const std::uint64_t spill_at :
       {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{30'000}, kItems, kItems + 1}) {
    Spool<Item> spool;
    for (std::uint64_t i = 0; i < kItems; ++i) {
      if (i == spill_at) spool.spill(dir.path());
      spool.push_back(item(i));
    }
    if (spill_at == kItems) spool.spill(dir.path());
    INFO(spill_at);
    CHECK(spool.spilled() == (spill_at <= kItems));
    CHECK(spool.size() == kItems);
    SpoolReader<Item> reader(spool, 1 << 16);
    std::uint64_t unlike = 0;
    for (std::uint64_t i = 0; i < kItems; ++i) {
      if (reader[i] != item(i)) ++unlike;
      const std::uint64_t other = i * 7919 % kItems;  // all over the list
      if (reader[other] != item(other)) ++unlike;
    }
    CHECK(unlike == 0);
    spool.clear();
    CHECK(spool.empty());
    CHECK(!spool.spilled());
  }
  CHECK(dir.listing().empty());  // the files have no names
}
