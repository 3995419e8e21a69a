// Cuts that a sample gives are ends of leaves in the tree over all points.
#include "engine/pipeline/farm/cuts.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Returns every n-th of some keys, sorted.
std::vector<MortonKey> sample_of(const std::vector<PointRecord>& points, std::size_t n) {
  std::vector<MortonKey> keys;
  for (std::size_t i = 0; i < points.size(); i += n) keys.push_back(points[i].key);
  return keys;
}

/// Checks a cut against all points: the smallest cell around the points next to it is split.
void check_cut(const std::vector<PointRecord>& points, const MortonKey& cut,
               std::uint32_t leaf_points) {
  const auto behind = std::ranges::lower_bound(points, cut, {}, &PointRecord::key);
  REQUIRE(behind != points.begin());
  REQUIRE(behind != points.end());
  const MortonKey a = (behind - 1)->key, b = behind->key;
  REQUIRE(a < b);
  const int level = common_level(a, b);
  const auto inside = std::ranges::count_if(
      points, [&](const PointRecord& point) { return common_level(point.key, a) >= level; });
  CHECK(inside > static_cast<std::ptrdiff_t>(leaf_points));
}

}  // namespace

TEST_CASE("cuts: no leaf of the tree over all points goes across a cut", "[farm][cuts]") {
  std::vector<Surfel> surfels = random_surfels(8'000, 4);
  for (std::size_t i = 0; i < surfels.size(); i += 3)
    surfels[i].position = surfels[i / 90].position;
  const SortedScene scene = sort_scene(surfels);
  for (const std::uint32_t leaf_points : {1U, 16U, 300U}) {
    for (const std::size_t every : {1U, 7U, 50U}) {
      for (const std::size_t parts : {2U, 9U, 1'000U}) {
        CAPTURE(leaf_points, every, parts);
        const std::vector<MortonKey> cuts =
            choose_cuts(sample_of(scene.records, every), parts, leaf_points);
        CHECK(cuts.size() < parts);
        CHECK(std::ranges::is_sorted(cuts));
        CHECK(std::ranges::adjacent_find(cuts) == cuts.end());
        for (const MortonKey& cut : cuts) check_cut(scene.records, cut, leaf_points);
      }
    }
  }
}

TEST_CASE("cuts: parts have about equally many points", "[farm][cuts]") {
  const SortedScene scene = sort_scene(random_surfels(40'000, 6));
  const std::vector<MortonKey> cuts = choose_cuts(sample_of(scene.records, 4), 8, 16);
  REQUIRE(cuts.size() == 7);
  auto begin = scene.records.begin();
  for (const MortonKey& cut : cuts) {
    const auto end = std::ranges::lower_bound(scene.records, cut, {}, &PointRecord::key);
    CHECK(end - begin == Approx(5'000).margin(500));
    begin = end;
  }
}

TEST_CASE("cuts: points of one position and samples of few points are not cut", "[farm][cuts]") {
  const std::vector<MortonKey> same(1'000, MortonKey{5, 6});
  CHECK(choose_cuts(same, 4, 1).empty());
  CHECK(choose_cuts({}, 4, 16).empty());
  const SortedScene scene = sort_scene(random_surfels(16, 6));
  CHECK(choose_cuts(sample_of(scene.records, 1), 4, 16).empty());
  CHECK_FALSE(choose_cuts(sample_of(scene.records, 1), 2, 15).empty());
}

TEST_CASE("cuts: the ranges of parts are about equally large and begin where parts do",
          "[farm][cuts]") {
  const SortedScene scene = sort_scene(random_surfels(40'000, 6));
  const std::vector<MortonKey> sample = sample_of(scene.records, 4);
  const std::vector<MortonKey> cuts = choose_cuts(sample, 3, 16);
  REQUIRE(cuts.size() == 2);
  const std::vector<MortonKey> borders = choose_borders(sample, cuts, 5);
  CHECK(borders.size() == 14);
  CHECK(std::ranges::includes(borders, cuts));
  std::size_t before = 0;
  for (std::size_t i = 0; i <= borders.size(); ++i) {
    const auto behind = i < borders.size() ? std::ranges::lower_bound(scene.records, borders[i], {},
                                                                      &PointRecord::key)
                                           : scene.records.end();
    const auto end = static_cast<std::size_t>(behind - scene.records.begin());
    CHECK(end - before > 40'000 / 15 * 8 / 10);
    CHECK(end - before < 40'000 / 15 * 12 / 10);
    before = end;
  }
}

TEST_CASE("cuts: where the sample has few keys, parts have fewer ranges", "[farm][cuts]") {
  const std::vector<MortonKey> keys = {{0, 1}, {0, 5}, {0, 5}, {0, 5}, {0, 9}};
  using Keys = std::vector<MortonKey>;
  CHECK(choose_borders(keys, {}, 1).empty());
  CHECK(choose_borders(keys, {}, 100) == Keys{{0, 1}, {0, 5}, {0, 9}});
  CHECK(choose_borders(keys, Keys{{0, 5}, {0, 7}, {0, 8}}, 2) ==
        Keys{{0, 1}, {0, 5}, {0, 7}, {0, 8}, {0, 9}});
  CHECK(choose_borders({}, Keys{{0, 5}}, 4) == Keys{{0, 5}});
}
