// Records on disk, and how a sort divides its memory cap.
#include "engine/sort/spill.h"

#include <sys/stat.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <stdexcept>
#include <system_error>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/parallel/thread_pool.h"
#include "engine/sort/direct_file.h"
#include "engine/sort/sort_plan.h"
#include "tests/sort/records.h"

using namespace ptc;
using namespace ptc::test;

namespace {

const std::filesystem::path kDirectory = std::filesystem::temp_directory_path();

// Spills `count` records in runs of at most `run`, partitioned by splitters of all records.
std::shared_ptr<Partition> spilled(SpillFile& file, std::span<const PointRecord> records,
                                   std::size_t run, std::size_t ranges) {
  const ThreadPool two(2);
  Arena memory(run * sizeof(PointRecord) + kDirectBytes);
  const auto partition =
      std::make_shared<Partition>(file, Splitters(sample_of(records, 1000), ranges));
  std::vector<std::uint16_t> range_of(run);
  while (!records.empty()) {
    const std::size_t count = std::min(run, records.size());
    const std::span grouped(memory.data(), memory.size());
    partition->find_ranges(records.first(count), range_of, two);
    partition->write_run(grouped,
                         partition->group_run(records.first(count), range_of, grouped, two));
    records = records.subspan(count);
  }
  return partition;
}

// Returns the bytes on the disk of each open file of this process that has no name.
std::vector<std::uint64_t> nameless_files() {
  std::vector<std::uint64_t> files;
  for (const auto& fd : std::filesystem::directory_iterator("/proc/self/fd")) {
    struct stat status {};
    const bool known = ::stat(fd.path().c_str(), &status) == 0;
    if (known && S_ISREG(status.st_mode) && status.st_nlink == 0)
      files.push_back(static_cast<std::uint64_t>(status.st_blocks) * 512);
  }
  return files;
}

std::uint64_t nameless_bytes() {
  const std::vector<std::uint64_t> files = nameless_files();
  return std::accumulate(files.begin(), files.end(), std::uint64_t{0});
}

}  // namespace

TEST_CASE("direct file: written bytes are read back, aligned or not", "[sort][spill]") {
  DirectFile file(kDirectory);
  const Arena memory(16 * kDirectBytes);
  for (std::size_t i = 0; i < memory.size(); ++i) memory.data()[i] = std::byte(i * 7 + i / 256);
  file.write_at(0, {memory.data(), 8 * kDirectBytes});
  file.write_at(8 * kDirectBytes, {memory.data() + 8 * kDirectBytes, 8 * kDirectBytes});

  const Arena aligned(memory.size());
  file.read_at(0, {aligned.data(), aligned.size()});
  CHECK(std::memcmp(aligned.data(), memory.data(), memory.size()) == 0);

  std::vector<std::byte> odd(1001);
  file.read_at(4097, odd);
  CHECK(std::memcmp(odd.data(), memory.data() + 4097, odd.size()) == 0);
  file.write_at(13, odd);
  std::vector<std::byte> again(1001);
  file.read_at(13, again);
  CHECK(again == odd);
  CHECK_THROWS_AS(file.read_at(16 * kDirectBytes - 5, odd), DataError);
}

TEST_CASE("direct file: a directory that cannot be used is named", "[sort][spill]") {
  CHECK_THROWS_AS(DirectFile("/nonexistent/spill"), std::system_error);
  CHECK_THROWS_WITH(DirectFile("/nonexistent/spill"), Catch::Contains("/nonexistent/spill"));
}

TEST_CASE("direct file: it has no name", "[sort][spill]") {
  const std::filesystem::path directory = kDirectory / "ptc_direct_file_test";
  std::filesystem::create_directory(directory);
  {
    DirectFile file(directory);
    file.write_at(0, std::as_bytes(std::span("hello")));
    CHECK(std::filesystem::is_empty(directory));
  }
  CHECK(std::filesystem::remove(directory));
}

TEST_CASE("spill: each range gives its records back in the order of the input", "[sort][spill]") {
  const std::vector<PointRecord> input = make_records(Keys::surface, 3210);
  const Splitters splitters(sample_of(input, 1000), 10);
  for (const std::size_t run : {512u, 1000u, 5000u}) {
    for (const std::size_t step : {1u, 7u, 5000u}) {
      SpillFile file({&kDirectory, 1});
      const auto partition = spilled(file, input, run, 10);
      SpillReader reader(SpillReader::kMinBytes);
      REQUIRE(partition->ranges() == splitters.size());
      for (std::size_t range = 0; range < partition->ranges(); ++range) {
        std::vector<PointRecord> expected, actual, block(step);
        for (const PointRecord& r : input)
          if (splitters(r.key) == range) expected.push_back(r);
        BucketReader bucket(partition, range);
        CHECK(bucket.size() == expected.size());
        while (const std::size_t count = bucket.read(block, reader)) {
          actual.insert(actual.end(), block.begin(), block.begin() + static_cast<long>(count));
          CHECK(bucket.left() == expected.size() - actual.size());
        }
        CHECK(same_bytes(actual, expected));
      }
    }
  }
}

TEST_CASE("spill: records that were read leave the disk", "[sort][spill]") {
  SpillFile file({&kDirectory, 1});
  const std::uint64_t others = nameless_bytes();
  const std::vector<PointRecord> records = make_records(Keys::surface, 60'000);
  const auto partition = spilled(file, records, 7'000, 20);
  const std::uint64_t all = nameless_bytes() - others;
  CHECK(all >= records.size() * kSpilledBytes);
  file.discard({}, 0);  // no more than requested
  CHECK(nameless_bytes() - others == all);

  SpillReader reader(SpillReader::kMinBytes);
  std::vector<PointRecord> out(records.size());
  for (std::size_t range = 0; range < partition->ranges(); ++range) {
    BucketReader bucket(partition, range);
    const std::vector<MortonKey> before = bucket.sample(10, reader);  // sampling discards nothing
    CHECK(bucket.read(out, reader) == bucket.size());
    std::ranges::sort(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(bucket.size()), {},
                      &PointRecord::key);
    for (const MortonKey& key : before) {
      CHECK(std::ranges::binary_search(out.begin(),
                                       out.begin() + static_cast<std::ptrdiff_t>(bucket.size()),
                                       key, {}, &PointRecord::key));
    }
    if (range == partition->ranges() / 2) CHECK(nameless_bytes() - others < all * 6 / 10);
  }
  const std::size_t runs = records.size() / 7'000 + 1;
  CHECK(nameless_bytes() - others <=
        (runs + 4) * kDirectBytes);  // the last block of each run, and the table of their places
}

TEST_CASE("spill: records are spread over directories and read back from all of them",
          "[sort][spill]") {
  const std::vector<PointRecord> input = make_records(Keys::surface, 32100);
  const std::vector<std::filesystem::path> directories(3, kDirectory);
  const std::vector<std::uint64_t> others = nameless_files();
  SpillFile file(directories);
  const auto partition = spilled(file, input, 1024, 10);
  std::vector<std::uint64_t> sizes = nameless_files();
  REQUIRE(sizes.size() == others.size() + 3);
  std::uint64_t all = 0;
  for (const std::uint64_t size : sizes) {
    if (std::ranges::find(others, size) != others.end()) continue;
    CHECK(size >= 10 * 1024 * kSpilledBytes);  // of 32 runs
    all += size;
  }
  CHECK(all == file.bytes());

  SpillReader reader(SpillReader::kMinBytes);
  std::vector<PointRecord> sorted, block(input.size());
  for (std::size_t range = 0; range < partition->ranges(); ++range) {
    BucketReader bucket(partition, range);
    const std::size_t count = bucket.read(block, reader);
    const std::vector<PointRecord> records =
        stable_sorted({block.begin(), block.begin() + static_cast<std::ptrdiff_t>(count)});
    sorted.insert(sorted.end(), records.begin(), records.end());
  }
  CHECK(same_bytes(sorted, stable_sorted(input)));
}

TEST_CASE("spill: a place is held only when its bytes were appended", "[sort][spill]") {
  SpillFile file({&kDirectory, 1});
  const Arena memory(8 * kDirectBytes);
  const std::size_t bytes = 3 * kDirectBytes;
  static_cast<void>(file.append({memory.data(), bytes / kSpilledBytes * kSpilledBytes}));
  CHECK(file.bytes() == bytes);
  CHECK(file.holds({0, 0}, bytes));
  CHECK(file.holds({0, kDirectBytes}, bytes - kDirectBytes));
  CHECK(file.holds({0, bytes}, 0));
  CHECK_FALSE(file.holds({0, 0}, bytes + 1));
  CHECK_FALSE(file.holds({0, kDirectBytes}, bytes));
  CHECK_FALSE(file.holds({0, 1}, 1));
  CHECK_FALSE(file.holds({0, bytes + kDirectBytes}, 0));
  CHECK_FALSE(file.holds({0, ~std::uint64_t{0} - kDirectBytes + 1}, bytes));
  CHECK_FALSE(file.holds({1, 0}, 1));
}

TEST_CASE("spill: the sample of a range comes from all its parts", "[sort][spill]") {
  const std::vector<PointRecord> input = make_records(Keys::ascending, 5000);
  SpillFile file({&kDirectory, 1});
  const auto partition = spilled(file, input, 600, 3);
  SpillReader reader(SpillReader::kMinBytes);
  for (std::size_t range = 0; range < partition->ranges(); ++range) {
    BucketReader bucket(partition, range);
    std::vector<PointRecord> all(static_cast<std::size_t>(bucket.size()));
    std::vector<std::vector<MortonKey>> samples;
    for (const std::size_t count : {std::size_t{1}, std::size_t{10}, all.size(), 2 * all.size()}) {
      samples.push_back(bucket.sample(count, reader));
      REQUIRE(samples.back().size() == std::min(count, all.size()));
      CHECK(bucket.left() == bucket.size());
    }
    REQUIRE(bucket.read(all, reader) == all.size());
    for (const auto& sample : samples) {
      for (std::size_t i = 0; i < sample.size(); ++i) {  // one from each stride
        CHECK(sample[i] >= all[i * all.size() / sample.size()].key);
        CHECK(sample[i] <= all[(i + 1) * all.size() / sample.size() - 1].key);
      }
    }
  }
}

TEST_CASE("spill: a read buffer below the minimum is refused", "[sort][spill]") {
  CHECK_THROWS_AS(SpillReader(SpillReader::kMinBytes - 1), std::invalid_argument);
}

TEST_CASE("sort plan: for very many records it uses most of the cap and never more",
          "[sort][plan]") {
  for (std::uint64_t cap = 256 << 10; cap < std::uint64_t{1} << 40; cap += cap / 7)
    for (const unsigned threads : {1u, 2u, 64u}) {
      CAPTURE(cap, threads);
      const SortPlan plan = plan_sort(cap, threads, std::uint64_t{1} << 50);
      CHECK(plan_bytes(plan, threads) <= cap);
      CHECK(2 * plan.run_records * sizeof(PointRecord) >=
            std::min(cap, std::uint64_t{1} << 38) / 10 * 3);
      if (cap > 64 << 20 && threads < 64 && cap < std::uint64_t{1} << 38)
        CHECK(2 * plan.run_records * sizeof(PointRecord) > cap / 10 * 9);
      CHECK(plan.run_records * sizeof(PointRecord) % kDirectBytes == 0);
      CHECK(2 * plan.run_records / 4 * sizeof(PointRecord) % kDirectBytes == 0);
      CHECK(plan.ranges >= 48);
      CHECK(plan.read_bytes >= SpillReader::kMinBytes);
    }
  CHECK_THROWS_AS(plan_sort((256 << 10) - 1, 1, 0), std::invalid_argument);
  CHECK_NOTHROW(plan_sort(~std::uint64_t{0}, 1, ~std::uint64_t{0}));
}

TEST_CASE("sort plan: it takes no more memory than a range of the expected records needs",
          "[sort][plan]") {
  constexpr std::uint64_t kRoom = std::uint64_t{64} << 30;
  const SortPlan least = plan_sort(kRoom, 2, 0);
  CHECK(2 * least.run_records * sizeof(PointRecord) < std::uint64_t{400} << 20);
  for (std::uint64_t expected = 1; expected < std::uint64_t{1} << 35; expected *= 3) {
    CAPTURE(expected);
    const SortPlan plan = plan_sort(kRoom, 2, expected);
    const std::uint64_t block = plan.run_records / 2,
                        average = expected / plan.ranges;  // records sorted at once
    CHECK(block >= average * 3 / 2);
    const std::uint64_t piece = block * sizeof(PointRecord) / plan.ranges;
    if (expected < 2'900'000'000) {
      CHECK(plan.run_records <= least.run_records);
      CHECK((expected <= plan.run_records || piece >= 64 << 10));
      if (expected <= least.run_records) CHECK(plan.run_records >= expected);
    } else {
      CHECK(block < average * 7 / 4);
    }
  }
}
