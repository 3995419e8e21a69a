// Counts as users write them.
#include "tools/parse.h"

#include <cstdint>
#include <string>

#include <CLI/CLI.hpp>
#include <catch2/catch.hpp>

namespace ptc {

TEST_CASE("parse: a count with a fraction and a suffix is the whole number that it spells",
          "[cli]") {
  CHECK(parse_count("--points", "4.1M") == 4'100'000);
  CHECK(parse_count("--points", "8.3M") == 8'300'000);
  CHECK(parse_count("--points", "16.1M") == 16'100'000);
  CHECK(parse_count("--points", "0.0011M") == 1'100);
  for (std::uint64_t tenths = 10; tenths < 10'000; ++tenths) {
    const std::string text = std::to_string(tenths / 10) + "." + std::to_string(tenths % 10);
    CHECK(parse_count("--points", text + "k") == tenths * 100);
    CHECK(parse_count("--points", text + "M") == tenths * 100'000);
    CHECK(parse_count("--points", text + "G") == tenths * 100'000'000);
  }
}

TEST_CASE("parse: a count that is no whole number from 1 to 2^48 is refused", "[cli]") {
  for (const char* text : {"1.0000001k", "1.5", "0.5", "0.0001k", "0", "-1M", "4.1234567M", "nan",
                           "1e99", "281474976710657", "M", "1.5Q"}) {
    CHECK_THROWS_AS(parse_count("--points", text), CLI::ValidationError);
  }
  CHECK(parse_count("--points", "281474976710656") == std::uint64_t{1} << 48);
}

}  // namespace ptc
