// XXH3 against published values, and against the table that the second reader is tested with.
#include "format/checksum.h"

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "format/container.h"
#include "tests/format/support.h"

using namespace ptc;

namespace {

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

// The sequence that spec/vectors/xxh3.txt describes.
std::vector<std::byte> sequence(std::size_t size) {
  std::vector<std::byte> bytes(size);
  std::uint64_t x = 1;
  for (std::byte& b : bytes) {
    x = x * 6364136223846793005u + 1442695040888963407u;
    b = static_cast<std::byte>(x >> 56);
  }
  return bytes;
}

}  // namespace

TEST_CASE("checksum: XXH3 of known texts equals the values that xxHash publishes",
          "[format][checksum]") {
  CHECK(xxh3_64(bytes_of("")) == 0x2d06800538d394c2);
  CHECK(xxh3_64(bytes_of("a")) == 0xe6c632b61e964e1f);
  CHECK(xxh3_64(bytes_of("abc")) == 0x78af5f94892f3950);
  CHECK(xxh3_128(bytes_of("")) ==
        std::array<std::uint64_t, 2>{0x6001c324468d497f, 0x99aa06d3014798d8});
}

TEST_CASE("checksum: every length class agrees with the table of the spec", "[format][checksum]") {
  const std::vector<std::byte> bytes = sequence(65536);
  std::ifstream table(PTC_SOURCE_DIR "/spec/vectors/xxh3.txt");
  unsigned rows = 0;
  for (std::string line; std::getline(table, line);) {
    if (line.starts_with("#")) continue;
    std::istringstream row(line);
    std::size_t length = 0;
    std::uint64_t seed = 0;
    std::uint64_t hash = 0;
    std::string wide;
    row >> length >> std::hex >> seed >> hash >> wide;
    REQUIRE(row);
    REQUIRE(length <= bytes.size());
    const auto input = std::span(bytes).first(length);
    INFO(line);
    CHECK(xxh3_64(input, seed) == hash);
    if (seed == 0) {
      CHECK(xxh3_64(input) == hash);
      const auto [low, high] = xxh3_128(input);
      CHECK(high == std::stoull(wide.substr(0, 16), nullptr, 16));
      CHECK(low == std::stoull(wide.substr(16), nullptr, 16));
    }
    ++rows;
  }
  CHECK(rows >= 100);
}

TEST_CASE("checksum: the sum over records equals the sum of their hashes", "[format][checksum]") {
  for (const std::size_t size : {1u, 16u, 40u, 200u, 1000u}) {
    const std::vector<std::byte> bytes = sequence(7 * size);
    std::array<std::uint64_t, 2> wide{};
    std::uint64_t seeded = 0;
    for (std::size_t i = 0; i < 7; ++i) {
      const auto record = std::span(bytes).subspan(i * size, size);
      const auto [low, high] = xxh3_128(record);
      wide = {wide[0] + low, wide[1] + high};
      seeded += xxh3_64(record, 3 + i);
    }
    CHECK(xxh3_128_sum(bytes, size) == wide);
    CHECK(xxh3_64_sum(bytes, size, size, 3) == seeded);
    std::vector<std::byte> apart;  // each followed by a byte that does not count
    for (std::size_t i = 0; i < 7; ++i) {
      const auto record = std::span(bytes).subspan(i * size, size);
      apart.insert(apart.end(), record.begin(), record.end());
      apart.push_back(std::byte(i + 1));
    }
    CHECK(xxh3_64_sum(apart, size, size + 1, 3) == seeded);
  }
  CHECK(xxh3_128_sum({}, 40) == std::array<std::uint64_t, 2>{});
}

TEST_CASE("digest: it is XXH3-128 over 16 bytes per page, in page order", "[format][checksum]") {
  ContentDigest digest;
  std::vector<std::byte> all;
  CHECK(digest.value() == xxh3_128(all));
  for (std::uint32_t i = 0; i < 300; ++i) {
    DirectoryEntry entry;
    entry.offset = 4096ull * i;
    entry.stored_bytes = i;
    entry.raw_bytes = i + 1;
    entry.payload_xxh3 = 0x1234567890abcdefull * i;
    entry.first_key = i;
    entry.record_count = i * 7;
    entry.type = i % 2 != 0 ? PageType::attribute : PageType{200};
    entry.group = static_cast<std::uint8_t>(i % 3);
    entry.level = static_cast<std::uint8_t>(i % 5);
    std::array<std::byte, 16> record{};
    test::put(record, 0, static_cast<std::uint8_t>(entry.type));
    test::put(record, 1, entry.group);
    test::put(record, 4, entry.record_count);
    test::put(record, 8, entry.payload_xxh3);
    all.insert(all.end(), record.begin(), record.end());
    digest.add(entry);
  }
  CHECK(digest.value() == xxh3_128(all));
  ContentDigest moved = std::move(digest);
  CHECK(moved.value() == xxh3_128(all));
}
