// The back ends read the bytes that are in the file.
#include "engine/cache/page_source.h"

#include <unistd.h>

#include <algorithm>
#include <random>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "tests/cache/pages.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::size_t kMaxBytes = 20'000;

std::vector<std::byte> noise(std::size_t bytes) {
  std::mt19937 random(1);
  std::vector<std::byte> all(bytes);
  std::ranges::generate(all, [&] { return static_cast<std::byte>(random()); });
  return all;
}

/// A file of noise that ends within a block.
class NoiseFile {
 public:
  NoiseFile() { write_file(path(), bytes); }
  [[nodiscard]] std::filesystem::path path() const { return scratch_ / "noise"; }
  [[nodiscard]] bool same(std::uint64_t offset, std::span<const std::byte> found) const {
    return std::ranges::equal(std::span(bytes).subspan(offset, found.size()), found);
  }

  const std::vector<std::byte> bytes = noise(1'000'003);

 private:
  TemporaryDirectory scratch_;
};

}  // namespace

TEST_CASE("page source: any range has the bytes of the file, expected or not", "[cache][source]") {
  const NoiseFile noise;
  const InputFile file(noise.path());
  for (const BackEnd back_end : available_back_ends(file)) {
    INFO("back end " << static_cast<int>(back_end));
    std::mt19937 random(2);
    const auto source = make_page_source(back_end, file, kMaxBytes);
    std::size_t wrong = 0;
    for (int i = 0; i < 2000; ++i) {
      // Expect more ranges than any back end keeps; some are read afterwards, in any order.
      const std::uint32_t expected = below(i % 50 == 0 ? 100 : 4, random);
      std::vector<std::pair<std::uint64_t, std::size_t>> ranges;
      for (std::uint32_t k = 0; k <= expected; ++k) {
        const std::size_t bytes = 1 + below(kMaxBytes, random);
        ranges.emplace_back(
            below(static_cast<std::uint32_t>(noise.bytes.size() - bytes + 1), random), bytes);
        if (k > 0) source->expect(ranges.back().first, bytes);
      }
      for (const auto& [offset, bytes] : ranges) {
        if (below(3, random) == 0) continue;
        const std::span<const std::byte> found = source->read(offset, bytes);
        if (found.size() != bytes || !noise.same(offset, found)) ++wrong;
      }
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("page source: the last bytes of a file are read, and none beyond them",
          "[cache][source]") {
  const NoiseFile noise;
  const InputFile file(noise.path());
  for (const BackEnd back_end : available_back_ends(file)) {
    INFO("back end " << static_cast<int>(back_end));
    const auto source = make_page_source(back_end, file, kMaxBytes);
    for (const std::size_t bytes : {1U, 2U, 3U, 4U, 4099U, 4100U}) {
      const std::uint64_t offset = noise.bytes.size() - bytes;
      CHECK(noise.same(offset, source->read(offset, bytes)));
    }
  }
}

TEST_CASE("page source: a file that became shorter is an error that names the file",
          "[cache][source][failure]") {
  const NoiseFile noise;
  const InputFile file(noise.path());
  for (const BackEnd back_end : available_back_ends(file)) {
    if (back_end == BackEnd::mmap) continue;  // SIGBUS, as BackEnd documents
    INFO("back end " << static_cast<int>(back_end));
    const auto source = make_page_source(back_end, file, kMaxBytes);
    write_file(noise.path(), noise.bytes);
    CHECK(noise.same(600'000, source->read(600'000, 5000)));
    REQUIRE(::truncate(noise.path().c_str(), 603'000) == 0);
    source->expect(700'000, 5000);
    CHECK_THROWS_AS(source->read(700'000, 5000), DataError);
    CHECK_THROWS_WITH(source->read(600'000, 5000), Catch::StartsWith(noise.path().string()));
    CHECK(noise.same(600'000, source->read(600'000, 3000)));
  }
}

TEST_CASE("page source: a destroyed source leaves no read in flight", "[cache][source]") {
  const NoiseFile noise;
  const InputFile file(noise.path());
  for (const BackEnd back_end : available_back_ends(file)) {
    for (int i = 0; i < 20; ++i) {
      const auto source = make_page_source(back_end, file, kMaxBytes);
      static_cast<void>(source->read(0, 10));
      for (std::uint64_t k = 1; k < 20; ++k) source->expect(k * 20'000, kMaxBytes);
      if (i % 2 == 0) CHECK(noise.same(380'000, source->read(380'000, kMaxBytes)));
    }
  }
}
