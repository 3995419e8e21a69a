// Ranges of keys from a sample.
#include "engine/sort/splitters.h"

#include <algorithm>
#include <random>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "tests/sort/records.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::uint64_t kOnes = ~std::uint64_t{0};

std::vector<MortonKey> keys_of(Keys keys, std::size_t count, std::uint64_t seed) {
  return sample_of(make_records(keys, count, seed), count);
}

}  // namespace

TEST_CASE("splitters: ranges ascend with the keys", "[sort][splitters]") {
  for (const Keys shape : kAllKeys)
    for (const std::size_t ranges : {3u, 16u, 100u, 512u}) {
      CAPTURE(static_cast<int>(shape), ranges);
      const Splitters splitters(keys_of(shape, 2000, 1), ranges);
      CHECK(splitters.size() <= ranges);
      std::vector<MortonKey> probes = keys_of(shape, 3000, 2);
      for (const Keys other : {Keys::random, Keys::lattice, Keys::low_word})
        std::ranges::copy(keys_of(other, 300, 3), std::back_inserter(probes));
      probes.insert(probes.end(), {{0, 0}, {kOnes, kOnes}, {0, kOnes}, {kOnes, 0}});
      std::ranges::sort(probes);
      std::size_t last = 0;
      for (const MortonKey& key : probes) {
        const std::size_t range = splitters(key);
        REQUIRE(range >= last);
        REQUIRE(range < splitters.size());
        last = range;
      }
    }
}

TEST_CASE("splitters: distinct keys are spread evenly", "[sort][splitters]") {
  for (const Keys shape : {Keys::random, Keys::lattice, Keys::surface, Keys::low_word}) {
    const Splitters splitters(keys_of(shape, 20000, 1), 64);
    CHECK(splitters.size() == 64);
    std::vector<std::size_t> hits(64, 0);
    for (const MortonKey& key : keys_of(shape, 20000, 7)) ++hits[splitters(key)];
    CHECK(*std::ranges::max_element(hits) < 3 * 20000 / 64);
    CHECK(*std::ranges::min_element(hits) > 20000 / 64 / 3);
  }
}

TEST_CASE("splitters: the key of a splitter begins its range", "[sort][splitters]") {
  const Splitters splitters({{1, 10}, {1, 20}, {1, 30}, {2, 0}, {3, 5}, {3, 6}}, 6);
  REQUIRE(splitters.size() == 6);  // every key but the first
  CHECK(splitters({0, 0}) == 0);
  CHECK(splitters({1, 19}) == 0);
  CHECK(splitters({1, 20}) == 1);
  CHECK(splitters({1, 21}) == 1);
  CHECK(splitters({1, 29}) == 1);
  CHECK(splitters({1, 30}) == 2);
  CHECK(splitters({1, kOnes}) == 2);
  CHECK(splitters({2, 0}) == 3);
  CHECK(splitters({3, 4}) == 3);
  CHECK(splitters({3, 5}) == 4);
  CHECK(splitters({3, 6}) == 5);
  CHECK(splitters({kOnes, kOnes}) == 5);
  CHECK(splitters.single_key(4));  // 3,5 up to 3,6
  for (const std::size_t range : {0u, 1u, 2u, 3u, 5u}) CHECK_FALSE(splitters.single_key(range));
}

TEST_CASE("splitters: a frequent key has a range of its own", "[sort][splitters]") {
  for (const MortonKey heavy : {MortonKey{5, 7}, MortonKey{5, kOnes}, MortonKey{0, 0}}) {
    std::vector<MortonKey> sample(900, heavy);
    for (std::uint64_t i = 0; i < 100; ++i) sample.push_back({i % 11, i});
    const Splitters splitters(sample, 20);
    const std::size_t range = splitters(heavy);
    CHECK(splitters.single_key(range));
    const MortonKey next{heavy.high + (heavy.low == kOnes), heavy.low + 1};
    CHECK(splitters(next) == range + 1);
    if (heavy != MortonKey{0, 0})
      CHECK(splitters({heavy.high - (heavy.low == 0), heavy.low - 1}) == range - 1);
  }
}

TEST_CASE("splitters: the only key of a sample gets a range of its own", "[sort][splitters]") {
  for (const MortonKey key : {MortonKey{0, 0}, MortonKey{3, 4}, MortonKey{kOnes, kOnes}})
    for (const std::size_t count : {1u, 2u, 1000u}) {
      const Splitters splitters(std::vector<MortonKey>(count, key), 8);
      CHECK(splitters.single_key(splitters(key)));
    }
}

TEST_CASE("splitters: different keys in a sample never all share a range", "[sort][splitters]") {
  for (std::size_t first = 1; first < 40; ++first)
    for (std::size_t second = 1; second < 40; ++second)
      for (const std::size_t ranges : {3u, 4u, 16u}) {
        std::vector<MortonKey> sample(first, MortonKey{1, 1});
        sample.insert(sample.end(), second, MortonKey{1, 2});
        const Splitters splitters(sample, ranges);
        REQUIRE(splitters({1, 1}) != splitters({1, 2}));
      }
}

TEST_CASE("splitters: an empty sample and too few ranges are refused", "[sort][splitters]") {
  CHECK_THROWS_AS(Splitters({}, 8), std::invalid_argument);
  CHECK_THROWS_AS(Splitters({{1, 1}}, 2), std::invalid_argument);
  CHECK_THROWS_AS(Splitters({{1, 1}}, 65536), std::invalid_argument);
}
