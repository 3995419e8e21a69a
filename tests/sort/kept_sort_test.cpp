// Sorts whose files outlive them.
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/file/direct_range.h"
#include "engine/parallel/thread_pool.h"
#include "engine/sort/sort_plan.h"
#include "engine/sort/spill.h"
#include "tests/sort/records.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::uint64_t kCap = 1 << 18;

struct Kept {
  TemporaryDirectory directory;
  SortOptions options{.memory_bytes = kCap,
                      .temp_dirs = {directory.path()},
                      .kept_files = {directory / "a", directory / "b"}};
  std::vector<std::byte> state;

  Kept(std::span<const PointRecord> input, std::span<const MortonKey> sample,
       std::uint64_t cap = kCap) {
    const ThreadPool two(2);
    options.memory_bytes = cap;
    ExternalSorter sorter(options, two, sample);
    if (!input.empty()) sorter.add(input);
    StateWriter writer;
    sorter.keep(writer);
    state = writer.take();
  }

  /// Returns the sorted records from `first` on, read by another sorter.
  std::vector<PointRecord> from(std::uint64_t first, std::uint64_t cap = kCap) const {
    SortOptions other = options;
    other.memory_bytes = cap;
    StateReader reader(state, "state");
    const ThreadPool one(1);
    ExternalSorter sorter(other, one, reader);
    reader.end();
    const auto stream = sorter.finish(first);
    std::vector<PointRecord> all(sorter.statistics().points - first);
    CHECK(stream->next(all) == all.size());
    PointRecord more;
    CHECK(stream->next({&more, 1}) == 0);
    return all;
  }
};

std::vector<std::byte> read_file(const std::filesystem::path& path) {
  std::vector<std::byte> bytes(std::filesystem::file_size(path));
  std::ifstream(path, std::ios::binary)
      .read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return bytes;
}

void write_at(const std::filesystem::path& path, std::size_t offset,
              std::span<const std::byte> bytes) {
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(static_cast<std::streamoff>(offset));
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

/// Sorts kept records after some bytes of one file were replaced. The file must be refused by name,
/// after at most the first of the sorted records were handed out.
void check_torn(const Kept& kept, std::span<const PointRecord> expected,
                const std::filesystem::path& file, std::size_t offset,
                std::span<const std::byte> torn) {
  const std::vector<std::byte> whole = read_file(file);
  write_at(file, offset, torn);
  StateReader reader(kept.state, "state");
  const ThreadPool two(2);
  SortOptions options = kept.options;
  options.memory_bytes = kCap;
  ExternalSorter sorter(options, two, reader);
  std::vector<PointRecord> all;
  std::string told;
  try {
    const auto stream = sorter.finish();
    std::vector<PointRecord> block(100);
    while (const std::size_t count = stream->next(block)) {
      all.insert(all.end(), block.begin(), block.begin() + static_cast<std::ptrdiff_t>(count));
    }
  } catch (const DataError& error) {
    told = error.what();
  }
  CAPTURE(offset, all.size());
  CHECK_THAT(told, Catch::StartsWith(file.string() + ": offset ") &&
                       Catch::EndsWith(" points there are not what was written"));
  CHECK((all.size() < expected.size() && same_bytes(all, expected.first(all.size()))));
  write_at(file, offset, std::span(whole).subspan(offset, torn.size()));
}

}  // namespace

TEST_CASE("kept sort: another sorter continues from any record under any cap", "[sort][kept]") {
  for (const Keys keys : kAllKeys) {
    const std::vector<PointRecord> input = make_records(keys, 10000);
    const std::vector<PointRecord> expected = stable_sorted(input);
    for (const bool fair : {true, false}) {  // false: buckets are partitioned again
      const Kept kept(
          input, fair ? sample_of(input, 2000) : std::vector<MortonKey>(100, input.front().key));
      for (const std::uint64_t first : {0u, 1u, 400u, 7777u, 9999u, 10000u}) {
        for (const std::uint64_t cap : {kCap, std::uint64_t{8} << 20}) {
          CHECK(same_bytes(kept.from(first, cap), std::span(expected).subspan(first)));
        }
      }
    }
  }
}

TEST_CASE("kept sort: records that memory would hold are on the disk, and no records work",
          "[sort][kept]") {
  const std::vector<PointRecord> input = make_records(Keys::surface, 10);
  CHECK(same_bytes(Kept(input, {}).from(0, 1 << 20), stable_sorted(input)));
  CHECK(Kept({}, {}).from(0).empty());
}

TEST_CASE("kept sort: records stay on the disk until they are discarded", "[sort][kept]") {
  const std::vector<PointRecord> input = make_records(Keys::surface, 200'000);
  const std::vector<PointRecord> expected = stable_sorted(input);
  const Kept kept(input, sample_of(input, 2000));
  const auto blocks = [&] {
    std::uint64_t bytes = 0;
    for (const auto& file : kept.options.kept_files) {
      struct stat status {};
      REQUIRE(::stat(file.c_str(), &status) == 0);
      bytes += static_cast<std::uint64_t>(status.st_blocks) * 512;
    }
    return bytes;
  };
  const std::uint64_t all = blocks();
  CHECK(all >= input.size() * kSpilledBytes);
  CHECK(kept.from(0).size() == input.size());
  CHECK(blocks() == all);
  StateReader reader(kept.state, "state");
  const ThreadPool one(1);
  ExternalSorter sorter(kept.options, one, reader);
  std::uint64_t before = all;
  for (const std::uint64_t record : {0u, 100'000u, 100'000u, 150'000u}) {
    sorter.discard_before(record);
    CHECK(blocks() <= before);
    CHECK(blocks() >= all - record * kSpilledBytes - (1 << 16));
    before = blocks();
    CHECK(same_bytes(kept.from(record), std::span(expected).subspan(record)));
  }
  CHECK(blocks() < all / 2);
}

TEST_CASE("kept sort: changed files and tables are refused", "[sort][kept]") {
  const std::vector<PointRecord> input = make_records(Keys::surface, 3000);
  const Kept kept(input, sample_of(input, 300));
  const auto open = [&](std::span<const std::byte> state) {
    StateReader reader(state, "state");
    const ThreadPool one(1);
    const ExternalSorter sorter(kept.options, one, reader);
    reader.end();
  };
  CHECK_NOTHROW(open(kept.state));
  for (std::size_t n = 0; n < kept.state.size(); ++n)
    CHECK_THROWS_AS(open(std::span(kept.state).first(n)), std::exception);
  for (std::size_t n = 16; n < kept.state.size(); ++n) {  // no crash, whatever the numbers say
    std::vector<std::byte> changed = kept.state;
    changed[n] ^= std::byte{0xff};
    try {
      open(changed);
    } catch (const std::exception&) {
    }
  }
  const auto bytes = std::filesystem::file_size(kept.options.kept_files[0]);
  std::filesystem::resize_file(kept.options.kept_files[0], bytes - 4096);
  CHECK_THROWS_WITH(open(kept.state), Catch::Contains("does not have the recorded length"));
  std::filesystem::remove(kept.options.kept_files[0]);
  CHECK_THROWS_WITH(open(kept.state), Catch::Contains(kept.options.kept_files[0].string()));
}

TEST_CASE("kept sort: changed records are refused by file name before they are handed out",
          "[sort][kept]") {
  constexpr std::size_t kCount = 40 * kPageRecords, kWholeBlocks = 4 * kPageRecords;
  static_assert(kCount % kWholeBlocks == 0 && kWholeBlocks * kSpilledBytes % kDirectBytes == 0);
  std::uint64_t cap =
      4 * kCap;  // a run's part of a range is larger than the blocks that are handed out
  while (plan_sort(cap, 2, kCount).run_records / 2 % kWholeBlocks != 0)
    cap += kDirectBytes;  // every byte of the files belongs to a record
  for (const Keys keys : {Keys::surface, Keys::equal, Keys::heavy}) {
    const std::vector<PointRecord> input = make_records(keys, kCount);
    const std::vector<PointRecord> expected = stable_sorted(input);
    for (const bool fair : {true, false}) {  // false: buckets are partitioned again
      const Kept kept(input,
                      fair ? sample_of(input, 2000)
                           : std::vector<MortonKey>(100, MortonKey{~std::uint64_t{0}, 0}),
                      cap);
      CAPTURE(keys, fair);
      std::uint64_t bytes = 0;
      for (const auto& file : kept.options.kept_files) {
        const std::vector<std::byte> whole = read_file(file);
        bytes += whole.size();
        REQUIRE(whole.size() >= 3 * kDirectBytes);
        constexpr std::size_t kSteps = 11;
        for (std::size_t step = 0; step < kSteps; ++step) {
          // Change one byte: of the key, of the rest, of each in turn.
          const std::size_t record =
              step * (whole.size() / kSpilledBytes - 1) / (kSteps - 1) * kSpilledBytes;
          for (const std::size_t offset :
               {record + step % sizeof(MortonKey), record + 16 + step % (kSpilledBytes - 16)}) {
            const std::byte flipped = whole[offset] ^ std::byte{0x10};
            check_torn(kept, expected, file, offset, {&flipped, 1});
          }
          // Replace a block by zeros or by another one.
          const std::size_t block =
              step * (whole.size() / kDirectBytes - 1) / (kSteps - 1) * kDirectBytes;
          check_torn(kept, expected, file, block, std::vector<std::byte>(kDirectBytes));
          const std::size_t other = block == 0 ? kDirectBytes : 0;
          check_torn(kept, expected, file, block, std::span(whole).subspan(other, kDirectBytes));
        }
        // Swap two whole records of a range.
        std::vector<std::byte> exchanged(whole.begin() + kSpilledBytes,
                                         whole.begin() + 2 * kSpilledBytes);
        exchanged.insert(exchanged.end(), whole.begin(), whole.begin() + kSpilledBytes);
        check_torn(kept, expected, file, 0, exchanged);
      }
      CHECK(bytes == kCount * kSpilledBytes);
      CHECK(same_bytes(kept.from(0), expected));  // all is as it was again
    }
  }
}
