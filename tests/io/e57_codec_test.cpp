// The checksum and the bit-packed numbers of E57, without a file.
#include <random>

#include <catch2/catch.hpp>

#include "engine/io/e57/bit_pack.h"
#include "engine/io/e57/crc32c.h"
#include "tests/io/e57_file.h"

using namespace ptc;
using test::e57_bits;

TEST_CASE("e57: the checksum is CRC-32C", "[io][e57]") {
  const auto crc = [](std::string_view text) { return crc32c(std::as_bytes(std::span(text))); };
  CHECK(crc("123456789") == 0xe3069283);            // the check value of the catalogues
  CHECK(crc(std::string(32, '\0')) == 0x8a9136aa);  // RFC 3720, B.4
  CHECK(crc(std::string(32, '\xff')) == 0x62a8ab43);
  std::minstd_rand random(1);
  std::string text;
  for (std::size_t size = 0; size < 50; ++size) {
    CHECK(crc(text) == test::crc32c_by_bits(text));
    text += static_cast<char>(random());
  }
}

TEST_CASE("e57: numbers of every width are unpacked from every bit", "[io][e57]") {
  std::mt19937_64 random(1);
  for (unsigned width = 0; width <= 64; ++width) {
    for (std::size_t first = 0; first < 16; ++first) {
      std::vector<std::uint64_t> values(19);
      for (std::uint64_t& value : values) value = width == 0 ? 0 : random() >> (64 - width);
      // The numbers behind `first` ones, in exactly the bytes that they take.
      std::vector<std::uint64_t> bits(first, 1);
      for (const std::uint64_t value : values) {
        for (unsigned bit = 0; bit < width; ++bit) bits.push_back(value >> bit & 1);
      }
      const std::string packed = e57_bits(bits, 1);
      const auto view = std::as_bytes(std::span(packed));
      const std::vector<std::byte> bytes(view.begin(), view.end());
      std::vector<std::uint64_t> unpacked(values.size(), 42);
      unpack_bits(bytes, first, width, unpacked);
      if (unpacked != values) FAIL("width " << width << " from bit " << first);
    }
  }
}
