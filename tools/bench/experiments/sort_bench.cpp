// Records carry their number in the radiance, so that a result can be checked without a second
// copy: neighbours must ascend by (key, number), which also means stable, and the sum of hashes of
// all records must be that of the input.
//
//   record   | key: 128 bits | ... | radiance: number, 3 x 16 bits | ... |    40 bytes
#include "tools/bench/experiments/sort_bench.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_sort.h>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/base/numbers.h"
#include "engine/io/file/disk_space.h"
#include "engine/parallel/thread_pool.h"
#include "engine/sort/radix_sort.h"
#include "tools/bench/experiments/bench_run.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/record_file.h"

namespace ptc::bench {
namespace {

/// A hash of a number; different numbers give different hashes.
std::uint64_t mixed(std::uint64_t i) noexcept {
  return splitmix64(i * kSplitMixStep);
}

constexpr std::uint64_t kKeyMask = ~std::uint64_t{0} >> 1;  // half of a key has 63 bits

/// The i-th of n keys, in any order but "city".
MortonKey key_at(const std::string& order, std::uint64_t i, std::uint64_t n) noexcept {
  if (order == "random") return {mixed(2 * i) & kKeyMask, mixed(2 * i + 1) & kKeyMask};
  if (order == "sorted") return {i * (kKeyMask / n), mixed(i) & kKeyMask};
  if (order == "reversed") return {(n - 1 - i) * (kKeyMask / n), mixed(i) & kKeyMask};
  if (order == "equal") return {kKeyMask / 3, kKeyMask / 5};
  const std::uint64_t near = mixed(i) >> 34;  // clusters: cubes of 2^10 lattice points a side
  return mixed(~i) % 2 == 0 ? MortonKey{0, near} : MortonKey{kKeyMask, kKeyMask - near};
}

/// Calls sink(records) for all records of an order, whose radiance holds their number.
template <class Sink>
void generate(const std::string& order, std::uint64_t points, const Sink& sink) {
  std::vector<PointRecord> block(4096);
  std::uint64_t number = 0;
  const auto give = [&](std::size_t count) {
    for (std::size_t i = 0; i < count; ++i, ++number) {
      block[i].radiance = {static_cast<std::uint16_t>(number >> 32),
                           static_cast<std::uint16_t>(number >> 16),
                           static_cast<std::uint16_t>(number)};
    }
    sink(std::span<const PointRecord>(block).first(count));
  };
  if (order != "city") {
    for (std::uint64_t i = 0; i < points;) {
      const auto count =
          static_cast<std::size_t>(std::min<std::uint64_t>(block.size(), points - i));
      for (std::size_t k = 0; k < count; ++k, ++i) block[k].key = key_at(order, i, points);
      give(count);
    }
    return;
  }
  for_each_city_record(points, [&](std::span<const PointRecord> records) {
    std::ranges::copy(records, block.begin());
    give(records.size());
  });
}

std::uint64_t number_of(const PointRecord& r) noexcept {
  return std::uint64_t{r.radiance[0]} << 32 | std::uint64_t{r.radiance[1]} << 16 | r.radiance[2];
}

/// The checksum of a sequence of records, which does not depend on their order, and whether they
/// are sorted.
class Check {
 public:
  void add(const PointRecord& r) noexcept {
    sum_ += mixed(r.key.high ^ mixed(r.key.low ^ mixed(number_of(r))));
    if (count_++ > 0)
      sorted_ &= last_.key < r.key || (last_.key == r.key && number_of(last_) < number_of(r));
    last_ = r;
  }
  /// Checks that the records are sorted and are those of the input. @throws DataError otherwise
  void require_sorted(const Check& input, const char* method) const {
    if (!sorted_)
      throw DataError(fmt::format("{}: the records are not sorted, or not stable", method));
    if (sum_ != input.sum_ || count_ != input.count_)
      throw DataError(fmt::format("{}: the output has other records than the input", method));
  }

 private:
  std::uint64_t sum_ = 0, count_ = 0;
  bool sorted_ = true;
  PointRecord last_;
};

bool by_key(const PointRecord& a, const PointRecord& b) noexcept {
  return a.key < b.key;
}

/// Runs all sorts that were asked for.
class SortRun : BenchRun<SortBenchOptions, SortRow> {
 public:
  using BenchRun::BenchRun;

  std::vector<SortRow> measure() {
    for (const std::string& panel : options_.panels) {
      for (const std::uint64_t points : options_.points) {
        if (panel == "memory" && points > options_.memory_points) continue;
        for (const std::string& order : options_.orders) {
          panel == "memory" ? in_memory(order, points) : on_disk(order, points);
          report();
        }
      }
    }
    return std::move(rows_);
  }

 private:
  SortRow& add_row(const char* panel, const std::string& order, const char* method,
                   std::uint64_t points, const TimedRuns& times) {
    return rows_.emplace_back(SortRow{.panel = panel,
                                      .order = order,
                                      .method = method,
                                      .points = points,
                                      .threads = executor_.threads(),
                                      .wall = spread_of(times.wall),
                                      .cpu = spread_of(times.cpu),
                                      .resident_bytes = times.resident});
  }

  void in_memory(const std::string& order, std::uint64_t points) {
    // Make the input
    std::vector<PointRecord> input;
    input.reserve(points);
    Check expected;
    generate(order, points, [&](std::span<const PointRecord> block) {
      input.insert(input.end(), block.begin(), block.end());
      for (const PointRecord& r : block) expected.add(r);
    });
    std::vector<PointRecord> records(input.size()), scratch(input.size());
    // Run all methods in turn, and check ours once
    TimedRuns ours, tbb, std_sort, copy;
    progress_.begin("sort in memory", options_.repeats, "runs");
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      copy.run([&] {
        std::memcpy(static_cast<void*>(records.data()), input.data(),
                    input.size() * sizeof(PointRecord));
      });
      ours.run([&] { radix_sort(records, scratch, executor_); });
      if (repeat == 0) require(records, expected);
      records = input;
      tbb.run([&] {
        const oneapi::tbb::global_control limit(
            oneapi::tbb::global_control::max_allowed_parallelism, executor_.threads());
        oneapi::tbb::parallel_sort(records.begin(), records.end(), by_key);
      });
      records = input;
      std_sort.run([&] { std::sort(records.begin(), records.end(), by_key); });
      progress_.advance(1);
    }
    progress_.end();
    // Add the rows
    add_row("memory", order, "ptcx", input.size(), ours);
    add_row("memory", order, "tbb", input.size(), tbb);
    add_row("memory", order, "std::sort", input.size(), std_sort).threads = 1;
    SortRow& moved = add_row("memory", order, "memcpy", input.size(), copy);
    moved.threads = 1;
    moved.moved_bytes = 2 * input.size() * sizeof(PointRecord);
  }

  static void require(std::span<const PointRecord> records, const Check& expected) {
    Check found;
    for (const PointRecord& r : records) found.add(r);
    found.require_sorted(expected, "radix_sort");
  }

  void on_disk(const std::string& order, std::uint64_t points) {
    // Room for input, spilled records (or the floor's first copy) and output; a city has up to 5 %
    // more points
    constexpr std::uint64_t kFiles = 3;
    require_room({&work_, 1}, kFiles * points * sizeof(PointRecord) * 21 / 20,
                 fmt::format("{} records", points));
    // Write the input
    RecordFile input(work_);
    RecordWriter writer(input);
    Check expected;
    progress_.begin("write input", points, "records");
    generate(order, points, [&](std::span<const PointRecord> block) {
      writer.write(block);
      for (const PointRecord& r : block) expected.add(r);
      progress_.advance(block.size());
    });
    writer.finish();
    progress_.end();
    const std::vector<MortonKey> sample = sample_of(input);
    // Check one run, which is not timed
    TimedRuns ours, floor;
    std::uint64_t spilled = 0;
    progress_.begin("sort on disk", options_.repeats, "runs");
    Check found;
    sort_file(input, sample, &found);
    found.require_sorted(expected, "external sort");
    // Run sort and floor in turn
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      ours.run([&] { spilled = sort_file(input, sample, nullptr); });
      floor.run([&] {
        RecordFile between(work_);
        input.copy_to(between);
        RecordFile output(work_);
        between.copy_to(output);
      });
      progress_.advance(1);
    }
    progress_.end();
    SortRow& row = add_row("disk", order, "ptcx", input.records(), ours);
    row.memory_bytes = run_.memory_bytes;
    row.moved_bytes = 2 * input.bytes() + 2 * spilled;
    add_row("disk", order, "floor", input.records(), floor).moved_bytes = 4 * input.bytes();
  }

  /// Sorts from file to file.
  /// @param check  adds every record of the output; may be null
  /// @return the number of bytes spilled
  std::uint64_t sort_file(const RecordFile& input, std::span<const MortonKey> sample,
                          Check* check) {
    ExternalSorter sorter(
        {.memory_bytes = run_.memory_bytes, .temp_dirs = {work_}, .expected = input.records()},
        executor_, sample);
    {
      RecordReader reader(input);
      for (std::span<const PointRecord> block = reader.next(); !block.empty();
           block = reader.next())
        sorter.add(block);
    }
    const std::unique_ptr<PointStream> sorted = sorter.finish();
    RecordFile output(work_);
    RecordWriter writer(output);
    std::vector<PointRecord> block(4096);
    while (const std::size_t count = sorted->next(block)) {
      const auto records = std::span<const PointRecord>(block).first(count);
      writer.write(records);
      if (check) {
        for (const PointRecord& r : records) check->add(r);
      }
    }
    writer.finish();
    return sorter.statistics().spilled_bytes;
  }

  ThreadPool executor_{run_.threads};
};

}  // namespace

std::vector<SortRow> measure_sort(const SortBenchOptions& options,
                                  const std::filesystem::path& work, const RunOptions& run,
                                  Progress& progress,
                                  const std::function<void(const std::vector<SortRow>&)>& report) {
  return SortRun(options, work, run, progress, report).measure();
}

}  // namespace ptc::bench
