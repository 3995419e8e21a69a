// Sorts whose files outlive them.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <filesystem>

#include "engine/base/error.h"
#include "tests/sort/records.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::uint64_t kCap = 1 << 18;

struct Kept {
  TemporaryDirectory directory;
  SortOptions options{.memory_bytes = kCap, .temp_dirs = {directory.path()}, .kept_files = {directory / "a", directory / "b"}};
  std::vector<std::byte> state;

  Kept(std::span<const PointRecord> input, std::span<const MortonKey> sample) {
    const Executor two(2);
    ExternalSorter sorter(options, two, sample);
    if (!input.empty()) sorter.add(input);
    StateWriter writer;
    sorter.keep(writer);
    state = writer.take();
  }

  /// The sorted records from `first` on, by another sorter.
  std::vector<PointRecord> from(std::uint64_t first, std::uint64_t cap = kCap) const {
    SortOptions other = options;
    other.memory_bytes = cap;
    StateReader reader(state, "state");
    const Executor one(1);
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

}  // namespace

TEST_CASE("kept sort: another sorter goes on from any record under any cap", "[sort][kept]") {
  for (const Keys keys : kAllKeys) {
    const std::vector<PointRecord> input = make_records(keys, 20000);
    const std::vector<PointRecord> expected = stable_sorted(input);
    for (const bool fair : {true, false}) {  // else buckets are partitioned again
      const Kept kept(input, fair ? sample_of(input, 2000) : std::vector<MortonKey>(100, input.front().key));
      for (const std::uint64_t first : {0u, 1u, 400u, 7777u, 19999u, 20000u}) {
        for (const std::uint64_t cap : {kCap, std::uint64_t{8} << 20}) {
          CHECK(same_bytes(kept.from(first, cap), std::span(expected).subspan(first)));
        }
      }
    }
  }
}

TEST_CASE("kept sort: what memory would hold is on the disk, too, and so is nothing", "[sort][kept]") {
  const std::vector<PointRecord> input = make_records(Keys::surface, 10);
  CHECK(same_bytes(Kept(input, {}).from(0, 1 << 20), stable_sorted(input)));
  CHECK(Kept({}, {}).from(0).empty());
}

TEST_CASE("kept sort: records stay on the disk until they are given back", "[sort][kept]") {
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
  CHECK(all >= input.size() * sizeof(PointRecord));
  CHECK(kept.from(0).size() == input.size());
  CHECK(blocks() == all);
  StateReader reader(kept.state, "state");
  const Executor one(1);
  ExternalSorter sorter(kept.options, one, reader);
  std::uint64_t before = all;
  for (const std::uint64_t record : {0u, 100'000u, 100'000u, 150'000u}) {
    sorter.discard_before(record);
    CHECK(blocks() <= before);
    CHECK(blocks() >= all - record * sizeof(PointRecord) - (1 << 16));
    before = blocks();
    CHECK(same_bytes(kept.from(record), std::span(expected).subspan(record)));
  }
  CHECK(blocks() < all / 2);
}

TEST_CASE("kept sort: files and tables that are not what they were are refused", "[sort][kept]") {
  const std::vector<PointRecord> input = make_records(Keys::surface, 3000);
  const Kept kept(input, sample_of(input, 300));
  const auto open = [&](std::span<const std::byte> state) {
    StateReader reader(state, "state");
    const Executor one(1);
    const ExternalSorter sorter(kept.options, one, reader);
    reader.end();
  };
  CHECK_NOTHROW(open(kept.state));
  for (std::size_t n = 0; n < kept.state.size(); ++n) CHECK_THROWS_AS(open(std::span(kept.state).first(n)), std::exception);
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
  CHECK_THROWS_WITH(open(kept.state), Catch::Contains("another length"));
  std::filesystem::remove(kept.options.kept_files[0]);
  CHECK_THROWS_WITH(open(kept.state), Catch::Contains(kept.options.kept_files[0].string()));
}
