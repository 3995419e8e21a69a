// The external sort, compared with std::stable_sort; its memory, its files and its errors.
#include "engine/sort/external_sort.h"

#include <malloc.h>
#include <sys/resource.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <system_error>

#include <catch2/catch.hpp>

#include "engine/base/memory.h"
#include "engine/parallel/thread_pool.h"
#include "engine/sort/spill.h"
#include "tests/sort/records.h"
#include "tests/support/sanitizers.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::uint64_t kMiB = 1 << 20;
constexpr std::uint64_t kMinCap = kMiB / 4;  // runs of 1536 records

struct Outcome {
  std::vector<PointRecord> records;
  SortStatistics statistics;
  std::array<std::uint64_t, 2> digest{};
};

void add_in_blocks(ExternalSorter& sorter, std::span<const PointRecord> input, std::size_t block) {
  for (std::size_t i = 0; i < input.size(); i += block)
    sorter.add(input.subspan(i, std::min(block, input.size() - i)));
}

std::vector<PointRecord> drain(PointStream& stream, std::size_t block) {
  std::vector<PointRecord> records, out(block);
  while (const std::size_t count = stream.next(out))
    records.insert(records.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(count));
  return records;
}

Outcome sort(std::span<const PointRecord> input, std::uint64_t cap, unsigned threads,
             std::span<const MortonKey> sample, std::uint64_t expected = 0) {
  const TemporaryDirectory directory;
  const ThreadPool executor(threads);
  ExternalSorter sorter({cap, {directory.path()}, expected}, executor, sample);
  add_in_blocks(sorter, input, 3001);
  Outcome outcome;
  outcome.records = drain(*sorter.finish(), 2222);
  outcome.statistics = sorter.statistics();
  outcome.digest = sorter.digest();
  CHECK(std::filesystem::is_empty(directory.path()));
  return outcome;
}

std::size_t open_files() {
  const std::filesystem::directory_iterator files("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

// Limits the size of files while it lives, which simulates a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(std::uint64_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    REQUIRE(getrlimit(RLIMIT_FSIZE, &before_) == 0);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    REQUIRE(setrlimit(RLIMIT_FSIZE, &limit) == 0);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int);
};

}  // namespace

TEST_CASE("external sort: the result depends on neither cap nor threads", "[sort][external]") {
  for (const Keys keys : kAllKeys) {
    CAPTURE(static_cast<int>(keys));
    const std::vector<PointRecord> input = make_records(keys, 15000);  // 0.6 MB
    const std::vector<PointRecord> expected = stable_sorted(input);
    const std::vector<MortonKey> sample = sample_of(input, 2000);
    for (const std::uint64_t cap : {kMinCap, 64 * kMiB}) {
      CAPTURE(cap);
      const Outcome one = sort(input, cap, 1, sample), two = sort(input, cap, 2, sample);
      CHECK(same_bytes(one.records, expected));
      CHECK(same_bytes(two.records, expected));
      for (const std::uint64_t told :
           {input.size() / 100, 10 * input.size()}) {  // wrong guesses only cost time
        CHECK(same_bytes(sort(input, cap, 2, sample, told).records, expected));
      }
      CHECK(same_bytes(sort(input, cap, 1, sample, input.size()).records, expected));
      CHECK(one.digest == two.digest);
      CHECK(one.statistics.points == input.size());
      CHECK(one.statistics.spilled_bytes == two.statistics.spilled_bytes);
      CHECK(one.statistics.buckets == two.statistics.buckets);
      if (cap == 64 * kMiB) {
        CHECK(one.statistics.spilled_bytes == 0);
        CHECK(one.statistics.buckets == 1);
      } else {
        CHECK(one.statistics.spilled_bytes >= input.size() * kSpilledBytes);
      }
    }
  }
}

TEST_CASE("external sort: a sort that does not fit on the disk is refused before it begins",
          "[sort][external]") {
  const TemporaryDirectory directory;
  const ThreadPool executor(1);
  try {
    const ExternalSorter sorter({kMinCap, {directory.path()}, std::uint64_t{1} << 50}, executor,
                                {});
    FAIL("begun");
  } catch (const std::system_error& error) {
    CHECK(error.code() == std::errc::no_space_on_device);
    CHECK_THAT(error.what(), Catch::Matchers::Contains(directory.path().string()));
    CHECK_THAT(error.what(), Catch::Matchers::Contains(
                                 "36366567.0 GB"));  // the need, less the possible error of a guess
  }
}

TEST_CASE("external sort: missing, small or misleading samples cost passes, not the result",
          "[sort][external]") {
  const std::vector<PointRecord> input = make_records(Keys::surface, 100000);  // 4 MB
  const std::vector<PointRecord> expected = stable_sorted(input);
  const std::uint64_t bytes = input.size() * kSpilledBytes;
  for (const unsigned threads : {1u, 2u}) {
    const Outcome fair = sort(input, kMiB, threads, sample_of(input, 1000));
    CHECK(same_bytes(fair.records, expected));
    CHECK(fair.statistics.spilled_bytes < bytes + bytes / 10);

    const std::vector<MortonKey> one_key(1000, input.front().key);
    const Outcome misled = sort(input, kMiB, threads, one_key);
    CHECK(same_bytes(misled.records, expected));
    CHECK(misled.statistics.spilled_bytes > bytes + bytes / 2);  // buckets were split again

    CHECK(same_bytes(sort(input, kMiB, threads, {}).records, expected));
    CHECK(same_bytes(sort(input, kMiB, threads, sample_of(input, 63)).records, expected));
    CHECK(same_bytes(sort(input, kMiB, threads, sample_of(input, 64)).records, expected));
  }
}

TEST_CASE("external sort: clusters inside clusters are split until they fit", "[sort][external]") {
  // Nine of ten lie in a cell 2^-20 as wide as the one before: each partition sees one level.
  std::mt19937_64 random(5);
  std::vector<PointRecord> input;
  for (std::size_t i = 0; i < 60000; ++i) {
    std::uint64_t r = random();
    int level = 0;
    for (; level < 5 && r % 10 != 0; r /= 10) ++level;
    const int bit = 20 * level;  // from the highest
    const std::uint64_t noise = random() >> 44;
    const MortonKey key = bit <= 40
                              ? MortonKey{noise << (44 - bit), random()}
                              : MortonKey{0, bit == 60 ? noise << 48 : noise << (128 - bit - 24)};
    input.push_back(numbered(key, i));
  }
  const std::vector<PointRecord> expected = stable_sorted(input);
  for (const unsigned threads : {1u, 2u}) {
    const Outcome outcome = sort(input, kMinCap, threads, sample_of(input, 100));
    CHECK(same_bytes(outcome.records, expected));
    CHECK(outcome.statistics.spilled_bytes > input.size() * kSpilledBytes / 2 * 3);
  }
}

TEST_CASE("external sort: equal keys beyond memory stream in the order of the input",
          "[sort][external]") {
  for (const Keys keys : {Keys::equal, Keys::heavy, Keys::few}) {
    const std::vector<PointRecord> input = make_records(keys, 80000);
    const Outcome outcome = sort(input, kMinCap, 2, sample_of(input, 500));
    CHECK(same_bytes(outcome.records, stable_sorted(input)));
    // Equal keys are not partitioned again and again.
    CHECK(outcome.statistics.spilled_bytes < 3 * input.size() * kSpilledBytes);
  }
}

TEST_CASE("external sort: every count around a run's end is sorted", "[sort][external]") {
  const ThreadPool two(2);
  const std::vector<PointRecord> input = make_records(Keys::lattice, 5000);
  for (const std::size_t count : {0u, 1u, 2u, 1535u, 1536u, 1537u, 3071u, 3072u, 3073u, 5000u}) {
    const std::span<const PointRecord> part(input.data(), count);
    const Outcome outcome = sort(part, kMinCap, 2, {});
    CHECK(same_bytes(outcome.records, stable_sorted({part.begin(), part.end()})));
    CHECK(outcome.statistics.points == count);
  }
}

TEST_CASE("external sort: blocks of any size give the same stream", "[sort][external]") {
  const TemporaryDirectory directory;
  const ThreadPool two(2);
  const std::vector<PointRecord> input = make_records(Keys::surface, 20000);
  const std::vector<PointRecord> expected = stable_sorted(input);
  for (const std::uint64_t cap : {kMinCap, 16 * kMiB})
    for (const std::size_t block : {1u, 13u, 4096u, 100000u}) {
      ExternalSorter sorter({cap, {directory.path()}}, two, {});
      add_in_blocks(sorter, input, block);
      const std::unique_ptr<PointStream> stream = sorter.finish();
      CHECK(same_bytes(drain(*stream, block), expected));
      PointRecord more;
      CHECK(stream->next({&more, 1}) == 0);
      CHECK(stream->next({&more, 1}) == 0);
      CHECK(stream->next({}) == 0);
    }
}

TEST_CASE("external sort: each block is filled as long as there are records", "[sort][external]") {
  const TemporaryDirectory directory;
  const ThreadPool two(2);
  const std::vector<PointRecord> input = make_records(Keys::surface, 20000);
  ExternalSorter sorter({kMinCap, {directory.path()}}, two, {});
  sorter.add(input);
  const std::unique_ptr<PointStream> stream = sorter.finish();
  std::vector<PointRecord> out(15000);
  CHECK(stream->next(out) == 15000);
  CHECK(stream->next(out) == 5000);
}

TEST_CASE("external sort: one that begins anew sorts only what came since", "[sort]") {
  const std::vector<PointRecord> records = make_records(Keys::surface, 9000);
  const auto cap =
      GENERATE(as<std::uint64_t>{}, kMinCap, 64 * kMiB);  // spills the larger ones, or none
  const auto threads = GENERATE(1U, 2U);
  const TemporaryDirectory directory;
  const ThreadPool executor(threads);
  SortOptions options{cap, {directory.path()}, 4'000};
  options.restarts = true;
  ExternalSorter sorter(options, executor, {});
  std::size_t begin = 0;
  for (const std::size_t count : {3'900U, 1'000U, 0U, 4'000U, 100U}) {
    CAPTURE(cap, threads, count);
    const auto own = std::span(records).subspan(begin, count);
    begin += count;
    sorter.restart(count, {});
    add_in_blocks(sorter, own, 777);
    const Outcome wanted = sort(own, 64 * kMiB, 1, {});
    CHECK(sorter.digest() == wanted.digest);
    CHECK(same_bytes(drain(*sorter.finish(), 500), wanted.records));
    CHECK((sorter.statistics().spilled_bytes > 0) == (cap == kMinCap && count > 1'536));
  }
  CHECK(begin == records.size());
}

TEST_CASE("external sort: only a sort that keeps its memory can begin anew", "[sort]") {
  const TemporaryDirectory directory;
  const ThreadPool executor(1);
  ExternalSorter sorter({kMinCap, {directory.path()}}, executor, {});
  CHECK_THROWS_AS(sorter.restart(1, {}), std::invalid_argument);
}

TEST_CASE("external sort: the digest depends on the set of records, not on their order",
          "[sort][digest]") {
  const TemporaryDirectory directory;
  const ThreadPool one(1), two(2);
  const auto digest = [&](std::span<const PointRecord> records, const Executor& executor,
                          std::size_t block) {
    ExternalSorter sorter({64 * kMiB, {directory.path()}}, executor, {});
    add_in_blocks(sorter, records, block);
    return sorter.digest();
  };
  std::vector<PointRecord> records = make_records(Keys::random, 100000);
  const auto whole = digest(records, one, records.size());
  CHECK(digest(records, two, records.size()) == whole);
  CHECK(digest(records, two, 777) == whole);
  std::ranges::shuffle(records, std::mt19937_64(3));
  CHECK(digest(records, two, records.size()) == whole);
  CHECK(whole[0] != whole[1]);
  CHECK(digest({}, one, 1) == std::array<std::uint64_t, 2>{});

  const std::vector<PointRecord> few(records.begin(), records.begin() + 3);
  const auto before = digest(few, one, 3);
  for (std::size_t i = 0; i < few.size() * sizeof(PointRecord); ++i) {  // each byte counts
    std::vector<PointRecord> changed = few;
    std::as_writable_bytes(std::span(changed))[i] ^= std::byte{1};
    const auto after = digest(changed, one, 3);
    CHECK(after[0] != before[0]);
    CHECK(after[1] != before[1]);
  }
  std::vector<PointRecord> twice = few;  // a sum, not an xor: pairs do not vanish
  twice.insert(twice.end(), {few[0], few[0]});
  CHECK(digest(twice, one, 5) != before);
}

TEST_CASE("external sort: no file is left when the sort ends, wherever it stops",
          "[sort][external]") {
  const TemporaryDirectory directory;
  const ThreadPool two(2);
  const std::vector<PointRecord> input = make_records(Keys::surface, 50000);
  const std::size_t files = open_files();
  {
    ExternalSorter sorter({kMinCap, {directory.path()}}, two, {});
    sorter.add(input);
    CHECK(open_files() == files + 1);
  }
  CHECK(open_files() == files);
  for (const std::size_t taken : {0u, 1u, 30000u}) {
    ExternalSorter sorter({kMinCap, {directory.path()}}, two, {});
    sorter.add(input);
    const std::unique_ptr<PointStream> stream = sorter.finish();
    std::vector<PointRecord> out(taken);
    CHECK(stream->next(out) == taken);
  }
  CHECK(open_files() == files);
  CHECK(std::filesystem::is_empty(directory.path()));
}

TEST_CASE("external sort: add() after finish() and a second finish() are refused",
          "[sort][external]") {
  const TemporaryDirectory directory;
  const ThreadPool one(1);
  ExternalSorter sorter({kMiB, {directory.path()}}, one, {});
  const std::unique_ptr<PointStream> stream = sorter.finish();
  CHECK_THROWS_AS(sorter.add({}), std::invalid_argument);
  CHECK_THROWS_AS(sorter.finish(), std::invalid_argument);
  CHECK_THROWS_AS(ExternalSorter({1000, {directory.path()}}, one, {}), std::invalid_argument);
}

TEST_CASE("external sort: a directory that cannot be written to is named when it is needed",
          "[sort][external]") {
  const ThreadPool two(2);
  const std::vector<PointRecord> input = make_records(Keys::lattice, 50000);
  ExternalSorter small({64 * kMiB, {"/nonexistent/spill"}}, two, {});
  small.add(input);
  CHECK(drain(*small.finish(), 1000).size() == input.size());

  ExternalSorter large({kMinCap, {"/nonexistent/spill"}}, two, {});
  CHECK_THROWS_AS(large.add(input), std::system_error);
  ExternalSorter again({kMinCap, {"/nonexistent/spill"}}, two, {});
  CHECK_THROWS_WITH(again.add(input), Catch::Contains("/nonexistent/spill"));
}

TEST_CASE("external sort: a disk that fills up is reported and leaves nothing behind",
          "[sort][external]") {
  const TemporaryDirectory directory;
  const std::vector<PointRecord> input = make_records(Keys::lattice, 100000);  // 4 MB
  const ThreadPool two(2);
  for (const std::uint64_t room : {std::uint64_t{0}, kMiB / 10, kMiB, 3 * kMiB}) {
    CAPTURE(room);
    const std::size_t files = open_files();
    std::string message;
    {
      const FileSizeLimit limit(room);
      try {
        ExternalSorter sorter({kMiB, {directory.path()}}, two, {});
        add_in_blocks(sorter, input, 1000);
        static_cast<void>(sorter.finish());
      } catch (const std::system_error& error) {
        message = error.what();
      }
    }
    CHECK_THAT(message, Catch::Contains(directory.path().string()));
    CHECK(open_files() == files);
    CHECK(std::filesystem::is_empty(directory.path()));
  }
}

TEST_CASE("external sort: records that one directory cannot take go to the others",
          "[sort][external]") {
  const TemporaryDirectory directory;
  const std::vector<PointRecord> input = make_records(Keys::surface, 100000);  // 4 MB
  const std::vector<MortonKey> sample = sample_of(input, 1000);
  const ThreadPool two(2);
  std::vector<std::filesystem::path> directories(2, directory.path());
  if (std::filesystem::exists("/dev/shm"))
    directories[1] = "/dev/shm";  // on another disk, with its own free space
  const FileSizeLimit limit(input.size() * kSpilledBytes * 7 / 10);
  {
    ExternalSorter sorter({kMiB, directories}, two, sample);
    sorter.add(input);
    CHECK(same_bytes(drain(*sorter.finish(), 2222), stable_sorted(input)));
  }
  ExternalSorter sorter({kMiB, {directories[0]}}, two, sample);
  CHECK_THROWS_AS(
      [&] {
        sorter.add(input);
        static_cast<void>(sorter.finish());
      }(),
      std::system_error);
}

TEST_CASE("external sort: add() fails soon after the disk is full, not when the input ends",
          "[sort][external]") {
  const TemporaryDirectory directory;
  const std::vector<PointRecord> input = make_records(Keys::surface, 200000);  // 8 MB
  for (const unsigned threads : {1u, 2u}) {
    const ThreadPool executor(threads);
    const FileSizeLimit limit(kMiB);
    ExternalSorter sorter({kMiB, {directory.path()}}, executor, sample_of(input, 1000));
    std::size_t added = 0;
    CHECK_THROWS_AS(
        [&] {
          for (; added < input.size(); added += 1000)
            sorter.add(std::span(input).subspan(added, 1000));
        }(),
        std::system_error);
    CHECK(added < input.size() / 2);
  }
}

TEST_CASE("external sort: a stream that failed does not look like one that ended",
          "[sort][external]") {
  const TemporaryDirectory directory;
  const std::vector<PointRecord> input = make_records(Keys::surface, 50000);  // 2 MB
  const std::vector<MortonKey> one_key(1000, input.front().key);
  for (const unsigned threads : {1u, 2u}) {
    const ThreadPool executor(threads);
    ExternalSorter sorter({kMinCap, {directory.path()}}, executor, one_key);
    sorter.add(input);
    // The first spill fits on the disk, the partition of the oversized bucket does not.
    const FileSizeLimit limit(input.size() * kSpilledBytes + kMiB);
    const std::unique_ptr<PointStream> stream = sorter.finish();
    std::vector<PointRecord> out(input.size());
    for (int i = 0; i < 3; ++i) CHECK_THROWS_AS(stream->next(out), std::system_error);
  }
}

namespace {

// Resets the peak of resident memory to what is resident now.
bool reset_peak() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";
  return peak_resident_bytes() < resident_bytes() + kMiB;
}

// Sorts this many random records under a cap without holding them itself. @return true if it
// spilled
bool sort_random(std::size_t count, std::uint64_t cap, const Executor& executor, bool fair_sample) {
  const TemporaryDirectory directory;
  std::mt19937_64 random(1);
  std::vector<MortonKey> sample(1000, MortonKey{1, 1});
  if (fair_sample)
    for (MortonKey& key : sample) key = key_of(Keys::lattice, 0, 1, random);
  std::vector<PointRecord> block(4096);
  ExternalSorter sorter({cap, {directory.path()}}, executor, sample);
  for (std::size_t i = 0; i < count; i += block.size()) {
    for (PointRecord& r : block) r.key = key_of(Keys::lattice, 0, 1, random);
    sorter.add(block);
  }
  const std::unique_ptr<PointStream> stream = sorter.finish();
  std::size_t seen = 0;
  bool ascending = true;
  MortonKey last;
  while (const std::size_t n = stream->next(block)) {
    for (const PointRecord& r : std::span(block).first(n)) {
      ascending = ascending && last <= r.key;
      last = r.key;
    }
    seen += n;
  }
  CHECK(ascending);
  CHECK(seen == sorter.statistics().points);
  return sorter.statistics().spilled_bytes > 0;
}

}  // namespace

TEST_CASE("external sort: resident memory stays below the cap and is freed", "[sort][external]") {
  constexpr std::uint64_t kCap = 8 * kMiB;
  if (kSanitized || !reset_peak()) {
    WARN(
        "skipped: the system does not reset the peak of resident memory, or a sanitizer adds to "
        "it");
    return;
  }
  for (const unsigned threads : {1u, 2u}) {
    const ThreadPool executor(threads);
    sort_random(1 << 18, 8 * kMiB, executor, true);  // starts threads and their heaps
    for (const bool fair_sample : {true, false})
      for (const bool spills : {true, false}) {
        CAPTURE(threads, fair_sample, spills);
        REQUIRE(reset_peak());
        const std::uint64_t before = resident_bytes();
        const std::size_t count = (spills ? 5 * kCap : kCap * 2 / 5) / sizeof(PointRecord);
        CHECK(sort_random(count, kCap, executor, fair_sample) == spills);
        CHECK(peak_resident_bytes() < before + kCap + kMiB);   // stacks and the like come on top
        CHECK(peak_resident_bytes() > before + kCap * 3 / 4);  // else this would test nothing
        CHECK(resident_bytes() < before + kMiB);
      }
  }
}
