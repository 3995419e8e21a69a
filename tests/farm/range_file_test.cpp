// Files of points by range: what goes in comes out in order, and damage is found.
#include "engine/pipeline/farm/range_file.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <utility>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/sort/record_values.h"
#include "format/bytes.h"
#include "format/checksum.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::uint64_t kPlan = 77;
const RangeRow kRow{.group_bytes = {3, 24}};

struct Points {
  std::vector<PointRecord> records;
  std::vector<std::vector<PointRecord>> values;
};

Points some_points(std::size_t count) {
  Points points{sort_scene(random_surfels(count, 8)).records, {}};
  std::ranges::stable_sort(points.records, {}, [](const PointRecord& p) { return p.radius; });
  for (const std::size_t bytes : kRow.group_bytes) {
    std::vector<PointRecord>& values = points.values.emplace_back(points.records);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t k = 0; k < bytes; ++k)
        values_of(values[i])[k] = static_cast<std::byte>(i * 7 + k * 31 + bytes);
    }
  }
  return points;
}

/// @param block  points of a block
void write(const std::filesystem::path& path, const Points& points,
           const std::vector<MortonKey>& cuts, std::uint64_t block = 64) {
  RangeWriter writer(path, kPlan, cuts, kRow, (cuts.size() + 4) * block * kRow.bytes());
  for (std::size_t at = 0; at < points.records.size(); at += 100) {
    const std::size_t count = std::min<std::size_t>(100, points.records.size() - at);
    std::vector<std::vector<PointRecord>> values;
    for (const auto& all : points.values) {
      const auto begin = all.begin() + static_cast<std::ptrdiff_t>(at);
      values.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(count));
    }
    writer.add(std::span(points.records).subspan(at, count), values);
  }
  writer.finish();
}

/// The blocks of some ranges of a file, and their reader.
struct Ranges {
  RangeBlocks ranges;
  RangeReader reader;
  Ranges(const std::filesystem::path& path, std::size_t first, std::size_t end)
      : ranges(read_ranges(path, kPlan, kRow, first, end)), reader(path, kRow, ranges.blocks) {}
  Ranges(const std::filesystem::path& path, std::size_t range) : Ranges(path, range, range + 1) {}
};

std::vector<MortonKey> cuts_of(const Points& points, std::size_t parts) {
  std::vector<MortonKey> keys, cuts;
  for (const PointRecord& point : points.records) keys.push_back(point.key);
  std::ranges::sort(keys);
  for (std::size_t i = 1; i < parts; ++i) cuts.push_back(keys[i * keys.size() / parts]);
  return cuts;
}

}  // namespace

TEST_CASE("range file: the points of each range come in the order of the input",
          "[farm][range_file]") {
  const TemporaryDirectory dir;
  const Points points = some_points(5'000);
  const std::vector<MortonKey> cuts = cuts_of(points, 5);
  write(dir / "route", points, cuts);
  std::size_t all = 0;
  for (std::uint32_t range = 0; range < 5; ++range) {
    std::vector<std::size_t> wanted;
    for (std::size_t i = 0; i < points.records.size(); ++i) {
      if (std::ranges::upper_bound(cuts, points.records[i].key) - cuts.begin() == range)
        wanted.push_back(i);
    }
    Ranges ranges(dir / "route", range);
    RangeReader& reader = ranges.reader;
    std::size_t at = 0;
    std::vector<PointRecord> values;
    while (reader.next()) {
      const auto block = reader.block();
      for (std::size_t i = 0; i < block.size(); ++i)
        REQUIRE(std::memcmp(&block[i], &points.records[wanted.at(at + i)], sizeof block[i]) == 0);
      for (std::size_t group = 0; group < kRow.group_bytes.size(); ++group) {
        reader.values(group, values);
        for (std::size_t i = 0; i < block.size(); ++i) {
          PointRecord expected = points.values[group][wanted.at(at + i)];
          REQUIRE(values[i].key == expected.key);
          REQUIRE(std::memcmp(values_of(values[i]), values_of(expected), kRow.group_bytes[group]) ==
                  0);
        }
      }
      at += block.size();
    }
    CHECK(at == wanted.size());
    all += at;
  }
  CHECK(all == points.records.size());
}

TEST_CASE("range file: keys of a range are sampled evenly over its files", "[farm][range_file]") {
  const TemporaryDirectory dir;
  const Points points = some_points(5'000);
  const std::vector<MortonKey> cuts = cuts_of(points, 3);
  const std::uint64_t block = GENERATE(64U, 1000U), every = GENERATE(1U, 7U, 64U, 1000U, 20000U);
  write(dir / "a", points, cuts, block);
  write(dir / "b", points, cuts, block);
  std::vector<MortonKey> wanted;
  for (const PointRecord& point : points.records) {
    if (std::ranges::upper_bound(cuts, point.key) - cuts.begin() == 1) wanted.push_back(point.key);
  }
  // A piece has 96 points, or what is left of its block; each twelfth key of it is taken
  std::vector<MortonKey> expected;
  std::uint64_t at = 0;
  for (unsigned file = 0; file < 2; ++file) {
    for (; at < wanted.size(); at += every) {
      const std::uint64_t end =
          std::min<std::uint64_t>({at + 96, at / block * block + block, wanted.size()});
      for (std::uint64_t i = at; i < end; i += 12) expected.push_back(wanted[i]);
    }
    at -= wanted.size();
  }
  std::vector<MortonKey> keys;
  const std::uint64_t ahead = Ranges(dir / "a", 1).reader.sample_keys(0, every, keys);
  CHECK(Ranges(dir / "b", 1).reader.sample_keys(ahead, every, keys) == at);
  CHECK(keys == expected);
}

TEST_CASE("range file: a flipped byte of a point, a cut or another plan is refused by name",
          "[farm][range_file]") {
  const TemporaryDirectory dir;
  const Points points = some_points(700);
  write(dir / "route", points, cuts_of(points, 2));
  const std::vector<char> whole = bytes_of(dir / "route");
  const auto read = [&] {
    std::size_t count = 0;
    for (std::uint32_t range = 0; range < 2; ++range) {
      Ranges ranges(dir / "route", range);
      RangeReader& reader = ranges.reader;
      while (reader.next()) count += reader.block().size();
    }
    return count;
  };
  const auto change = [&](const std::vector<char>& bytes) {
    std::ofstream(dir / "route", std::ios::binary).write(bytes.data(), std::ssize(bytes));
  };
  REQUIRE(read() == 700);
  std::size_t refused = 0;
  for (std::size_t at = 0; at < whole.size(); at += 61) {
    std::vector<char> bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 4);
    change(bytes);
    try {
      const std::size_t count = read();  // a byte between blocks
      REQUIRE(count == 700);
    } catch (const DataError& error) {
      REQUIRE_THAT(error.what(), Catch::Contains((dir / "route").string()));
      ++refused;
    }
  }
  CHECK(refused > 700 * kRow.bytes() / 61);
  for (std::size_t length = 0; length < whole.size(); length += 997) {
    change({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)});
    CHECK_THROWS_AS(read(), DataError);
  }
  change(whole);
  CHECK_THROWS_WITH(read_ranges(dir / "route", kPlan + 1, kRow, 0, 1),
                    Catch::Contains("of another plan"));
}

TEST_CASE("range file: a point that no container can hold is refused by name",
          "[farm][range_file]") {
  const TemporaryDirectory dir;
  const auto refused = [&](auto change) {
    Points points = some_points(50);
    change(points.records[20]);
    write(dir / "route", points, {});
    Ranges ranges(dir / "route", 0);
    RangeReader& reader = ranges.reader;
    CHECK_THROWS_WITH(reader.next(), Catch::Contains((dir / "route").string()) &&
                                         Catch::Contains("point 20: radius, radiance"));
  };
  refused([](PointRecord& point) { point.radius = std::numeric_limits<float>::infinity(); });
  refused([](PointRecord& point) { point.radius = std::numeric_limits<float>::quiet_NaN(); });
  refused([](PointRecord& point) { point.radius = -1; });
  refused([](PointRecord& point) { point.radiance[1] = 0x7c00; });
  refused([](PointRecord& point) { point.emission[2] = 0xbc00; });
  refused([](PointRecord& point) { point.key.low = std::uint64_t{1} << 63; });
  refused([](PointRecord& point) { point.flags = 1; });
}

TEST_CASE("range file: a writer that does not finish leaves nothing", "[farm][range_file]") {
  const TemporaryDirectory dir;
  {
    RangeWriter writer(dir / "route", kPlan, {}, kRow, 1 << 20);
    const Points points = some_points(50);
    writer.add(points.records, points.values);
  }
  CHECK(std::filesystem::is_empty(dir.path()));
}

TEST_CASE("range file: blocks behind the end, with checksums that fit, are refused",
          "[farm][range_file]") {
  const TemporaryDirectory dir;
  const auto path = dir / "ranges";
  const Points points = some_points(300);
  write(path, points, cuts_of(points, 3));
  const std::vector<char> whole = bytes_of(path);
  // The end has the plan, the places of rows and index, the ranges and the checksum of these; a row
  // has offset, points and checksum of a block; an entry has first row, checksum and three digests
  const auto bytes = std::as_bytes(std::span(whole));
  const std::size_t end = bytes.size() - 40;
  const auto rows = load<std::uint64_t>(bytes.data(), end + 8),
             index = load<std::uint64_t>(bytes.data(), end + 16),
             count = load<std::uint64_t>(bytes.data(), index + 64);
  const auto refused = [&](std::size_t field, std::uint64_t value, const std::string& why) {
    CAPTURE(field, value);
    std::vector<std::byte> changed(bytes.begin(), bytes.end());
    store(changed.data(), field, value);
    const auto all = std::span(std::as_const(changed));
    const std::array<std::uint64_t, 3> whose{kPlan, 0, 0};
    Xxh3 own(0);
    own.add(std::as_bytes(std::span(whose)));
    own.add(all.subspan(index + 16, 48));
    own.add(all.subspan(rows, count * 24));
    store(changed.data(), index + 8, own.value());
    store(changed.data(), end + 32, xxh3_64(all.subspan(end, 32)));
    OutputFile file(path);
    file.append(changed);
    file.publish();
    CHECK_THROWS_WITH(read_ranges(path, kPlan, kRow, 0, 1), Catch::Contains(why));
  };
  for (const std::uint64_t value : {rows + 1, rows, ~std::uint64_t{0}}) {
    refused(rows, value, "out of range");      // offset of a block
    refused(rows + 8, value, "out of range");  // its points
  }
  refused(index, count + 1, "the index of the file is damaged");
  refused(index, 1000, "out of range");
  refused(index + 64, count - 1, "the table of the file is damaged");
  for (const std::uint64_t value : {index + 1, ~std::uint64_t{0}}) {
    refused(end + 8, value, "the end of the file is damaged");   // place of the rows
    refused(end + 24, value, "the end of the file is damaged");  // number of ranges
  }
  refused(end + 16, 0, "the end of the file is damaged");  // place of the index
  refused(end + 16, ~std::uint64_t{0}, "the end of the file is damaged");
  refused(end + 24, 0, "the file has fewer ranges");
}
