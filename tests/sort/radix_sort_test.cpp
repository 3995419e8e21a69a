// The in-memory sort, compared with std::stable_sort.
#include "engine/sort/radix_sort.h"

#include <stdexcept>

#include <catch2/catch.hpp>

#include "engine/base/memory.h"
#include "engine/parallel/thread_pool.h"
#include "engine/sort/external_sort.h"
#include "tests/sort/records.h"

using namespace ptc;
using namespace ptc::test;

namespace {

bool sorts(const std::vector<PointRecord>& input, const std::vector<PointRecord>& expected,
           const Executor& executor) {
  std::vector<PointRecord> records = input, scratch(input.size());
  radix_sort(records, scratch, executor);
  return same_bytes(records, expected);
}

bool sorts(const std::vector<PointRecord>& input, const Executor& executor) {
  return sorts(input, stable_sorted(input), executor);
}

}  // namespace

TEST_CASE("radix_sort: the order is that of a stable sort for keys of every shape",
          "[sort][radix]") {
  const ThreadPool one(1), two(2), five(5);
  for (const Keys keys : kAllKeys) {
    CAPTURE(static_cast<int>(keys));
    for (const std::size_t count : {1000u, 20000u, 150000u}) {
      CAPTURE(count);
      const std::vector<PointRecord> input = make_records(keys, count);
      const std::vector<PointRecord> expected = stable_sorted(input);
      CHECK(sorts(input, expected, one));
      CHECK(sorts(input, expected, two));
      CHECK(sorts(input, expected, five));
    }
  }
}

TEST_CASE("radix_sort: every small size is sorted", "[sort][radix]") {
  const ThreadPool one(1);
  for (std::size_t count = 0; count <= 130; ++count)
    for (const Keys keys : {Keys::random, Keys::few, Keys::surface, Keys::nested})
      CHECK(sorts(make_records(keys, count, count), one));
}

TEST_CASE("radix_sort: sizes around the switch of algorithms are sorted", "[sort][radix]") {
  const ThreadPool one(1), two(2);
  for (const std::size_t limit : {1u << 13, 1u << 15, 1u << 17})
    for (const std::size_t count : {limit - 1, limit, limit + 1}) {
      const std::vector<PointRecord> input = make_records(Keys::lattice, count);
      const std::vector<PointRecord> expected = stable_sorted(input);
      CHECK(sorts(input, expected, one));
      CHECK(sorts(input, expected, two));
    }
}

TEST_CASE("radix_sort: each bit of a key counts", "[sort][radix]") {
  const ThreadPool one(1);
  for (const std::size_t count : {2u, 40u, 9000u})
    for (int bit = 0; bit < 128; ++bit) {
      std::vector<PointRecord> input;
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint64_t one_bit = std::uint64_t{(i & 1) == 0} << bit % 64;
        input.push_back(numbered(bit < 64 ? MortonKey{one_bit, 7} : MortonKey{7, one_bit}, i));
      }
      CHECK(sorts(input, one));
    }
}

TEST_CASE("radix_sort: arrays may begin anywhere in a cache line", "[sort][radix]") {
  const ThreadPool two(2);
  const std::vector<PointRecord> input = make_records(Keys::surface, 140000);
  const std::vector<PointRecord> expected = stable_sorted(input);
  std::vector<PointRecord> records(input.size() + 16), scratch(input.size() + 16);
  for (std::size_t shift = 0; shift < 9; ++shift) {
    const PointRecord guard = numbered({~std::uint64_t{0}, 1}, shift);
    std::ranges::fill(records, guard);
    std::ranges::fill(scratch, guard);
    std::ranges::copy(input, records.begin() + static_cast<std::ptrdiff_t>(shift));
    radix_sort(std::span(records).subspan(shift, input.size()),
               std::span(scratch).subspan(8 - shift, input.size()), two);
    CHECK(same_bytes(std::span(records).subspan(shift, input.size()), expected));
    for (std::size_t i = 0; i < 16; ++i) {  // nothing was written next to them
      const std::size_t before = i < shift ? i : input.size() + i;
      CHECK(same_bytes({&records[before], 1}, {&guard, 1}));
      const std::size_t beside = i < 8 - shift ? i : input.size() + i;
      CHECK(same_bytes({&scratch[beside], 1}, {&guard, 1}));
    }
  }
}

TEST_CASE("radix_sort: no distribution of keys takes many times longer than random ones",
          "[sort][radix]") {
  const ThreadPool one(1);
  const auto seconds = [&](Keys keys) {
    std::vector<PointRecord> records = make_records(keys, 400000), scratch(records.size());
    const double start = cpu_seconds();
    radix_sort(records, scratch, one);
    return cpu_seconds() - start;
  };
  const double random = seconds(Keys::random);
  for (const Keys keys : kAllKeys) {
    CAPTURE(static_cast<int>(keys));
    CHECK(seconds(keys) < 10 * random + 0.05);  // quadratic would be thousands
  }
}

TEST_CASE("radix_sort: scratch that is too small is refused", "[sort][radix]") {
  const ThreadPool one(1);
  std::vector<PointRecord> records(10), scratch(9);
  CHECK_THROWS_AS(radix_sort(records, scratch, one), std::invalid_argument);
  CHECK_NOTHROW(radix_sort({}, {}, one));
}

TEST_CASE("radix_sort: apart from scratch, it allocates a small part of the records' size",
          "[sort][radix]") {
  CHECK(radix_sort_bytes(100, 8) < 100 * sizeof(PointRecord));
  CHECK(radix_sort_bytes(10'000'000, 1) < 10'000'000 * sizeof(PointRecord) / 15);
  CHECK(radix_sort_bytes(10'000'000, 64) < 10'000'000 * sizeof(PointRecord) / 10);
}
