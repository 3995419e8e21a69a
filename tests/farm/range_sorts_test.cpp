// Points that are sorted range by range: all of them come in order, and an error stays one.
#include "engine/pipeline/farm/range_sorts.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Returns points in the order of the curve.
std::vector<PointRecord> sorted_points(std::size_t count) {
  return sort_scene(random_surfels(count, 8)).records;
}

}  // namespace

TEST_CASE("range sorts: points of ranges of any size come in order, whatever fits in memory",
          "[farm][range_sorts]") {
  const std::vector<PointRecord> points = sorted_points(30'000);
  const auto threads = GENERATE(1U, 2U);
  const auto cap = GENERATE(as<std::uint64_t>{}, 256 << 10, 64 << 20);
  const TemporaryDirectory directory;
  const ThreadPool executor(threads);
  const std::vector<std::size_t> ends = {9'000, 9'001, 9'001, 21'000, 30'000};
  std::size_t range = 0, begin = 0;
  const auto read = [&](ExternalSorter& sorter) {
    if (range == ends.size()) return false;
    std::vector<PointRecord> own(points.begin() + static_cast<std::ptrdiff_t>(begin),
                                 points.begin() + static_cast<std::ptrdiff_t>(ends[range]));
    std::ranges::reverse(own);
    sorter.restart(own.size(), {});
    sorter.add(own);
    begin = ends[range++];
    return true;
  };
  RangeSorts sorts({cap, {directory.path()}, 12'000}, read, executor);
  std::vector<PointRecord> found(points.size() + 1);
  std::size_t count = 0;
  while (const std::size_t more = sorts.next(
             std::span(found).subspan(count, std::min<std::size_t>(777, found.size() - count))))
    count += more;
  REQUIRE(count == points.size());
  CHECK(std::memcmp(found.data(), points.data(), count * sizeof(PointRecord)) == 0);
  CHECK(sorts.next(found) == 0);
}

TEST_CASE("range sorts: a range that cannot be read is an error in all later calls, too",
          "[farm][range_sorts]") {
  const std::vector<PointRecord> points = sorted_points(300);
  const TemporaryDirectory directory;
  const ThreadPool executor(GENERATE(1U, 2U));
  std::size_t range = 0;
  const auto read = [&](ExternalSorter& sorter) {
    if (range++ == 2) throw std::runtime_error("the route is gone");
    sorter.restart(100, {});
    sorter.add(std::span(points).subspan((range - 1) * 100, 100));
    return true;
  };
  RangeSorts sorts({1 << 20, {directory.path()}, 100}, read, executor);
  std::vector<PointRecord> found(1'000);
  std::size_t count = 0;
  const auto take_all = [&] {
    while (const std::size_t more = sorts.next(found)) count += more;
  };
  CHECK_THROWS_WITH(take_all(), "the route is gone");
  CHECK(count == 200);
  CHECK_THROWS_WITH(take_all(), "the route is gone");
}
