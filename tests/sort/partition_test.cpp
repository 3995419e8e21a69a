// The stable partition, compared with copying one class after another.
#include "engine/sort/partition.h"

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "tests/sort/records.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::size_t kPacked = 34;  // bytes of a record
constexpr std::byte kUntouched{0xa5};

}  // namespace

TEST_CASE("partition: classes ascend and keep their order for any number of blocks",
          "[sort][partition]") {
  const ThreadPool three(3);
  for (const std::size_t count : {1u, 7u, 8u, 9u, 1000u, 4099u})
    for (const std::size_t classes : {1u, 2u, 3u, 64u})
      for (const std::size_t blocks : {1u, 2u, 5u}) {
        const std::vector<PointRecord> input = make_records(Keys::random, count);
        const auto classify = [=](const PointRecord& r) { return r.key.low % classes; };
        std::vector<PointRecord> expected;
        std::vector<std::size_t> starts;
        for (std::size_t c = 0; c < classes; ++c) {
          starts.push_back(expected.size());
          for (const PointRecord& r : input)
            if (classify(r) == c) expected.push_back(r);
        }
        starts.push_back(count);

        const ClassCounts counts(input, classes, blocks, classify, three);
        CHECK(counts.starts() == starts);
        std::vector<std::uint16_t> class_of;
        for (const PointRecord& r : input)
          class_of.push_back(static_cast<std::uint16_t>(classify(r)));
        CHECK(ClassCounts(input, class_of, classes, blocks, three).starts() == starts);
        for (std::size_t shift = 0; shift < 8; ++shift) {  // offsets in a cache line
          std::vector<PointRecord> out(count + 8);
          counts.scatter(out.data() + shift, classify, three);
          REQUIRE(same_bytes(std::span(out).subspan(shift, count), expected));
        }
        std::vector<std::byte> packed;
        for (const PointRecord& r : expected) {
          const auto bytes = std::as_bytes(std::span(&r, 1)).first(kPacked);
          packed.insert(packed.end(), bytes.begin(), bytes.end());
        }
        for (std::size_t shift = 0; shift < 70; shift += 23) {
          std::vector<std::byte> out(packed.size() + 70, kUntouched);
          counts.scatter_packed<kPacked>(out.data() + shift, classify, three);
          const auto begin = out.begin() + static_cast<std::ptrdiff_t>(shift),
                     end = begin + static_cast<std::ptrdiff_t>(packed.size());
          REQUIRE(std::equal(begin, end, packed.begin()));
          CHECK(std::count(out.begin(), begin, kUntouched) == begin - out.begin());
          CHECK(std::count(end, out.end(), kUntouched) == out.end() - end);
        }
      }
}

TEST_CASE("partition: the differences are the bits in which keys differ", "[sort][partition]") {
  const ThreadPool two(2);
  std::vector<PointRecord> input(100, numbered({0xf0, 1}, 0));
  const auto classify = [](const PointRecord&) { return std::size_t{0}; };
  const auto differences = [&] { return ClassCounts(input, 1, 3, classify, two).differences(); };
  CHECK(differences() == MortonKey{0, 0});
  input.back().key.low = 3;
  CHECK(differences() == MortonKey{0, 2});
  input[40].key.high = 0xff;
  CHECK(differences() == MortonKey{0x0f, 2});
  input.front().key = {~std::uint64_t{0}, 0};
  CHECK(differences() == MortonKey{~std::uint64_t{0xf0}, 3});
}

TEST_CASE("partition: there are as many blocks as threads, unless they would take much memory",
          "[sort][partition]") {
  CHECK(partition_blocks(100, 32, 8) == 1);
  CHECK(partition_blocks(10'000'000, 2048, 2) == 2);
  for (const std::size_t records : {1u, 10'000u, 1'000'000u, 100'000'000u})
    for (const std::size_t classes : {32u, 512u, 4096u})
      for (const unsigned threads : {1u, 8u, 256u}) {
        const std::size_t blocks = partition_blocks(records, classes, threads);
        CHECK(blocks >= 1);
        CHECK(blocks <= threads);
        if (blocks > 1)
          CHECK(blocks * partition_bytes(classes) <= records * sizeof(PointRecord) / 32);
      }
}
