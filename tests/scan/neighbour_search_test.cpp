#include "engine/scan/neighbour_search.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <catch2/catch.hpp>
#include <hwy/targets.h>

#include "tests/scan/clouds.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// All places of a scan, in blocks.
struct Blocked {
  explicit Blocked(const ScanSpool& spool) : places(static_cast<std::size_t>(spool.places())) {
    spool.read_places(0, places);
    for (const Place& place : places) positions.push_back(position_of(place.key));
    split_blocks(places, blocks);
  }
  std::vector<Place> places;
  std::vector<LatticePosition> positions;
  std::vector<PlaceBlock> blocks;
};

/// Returns the neighbours of a place of a block by their definition: every place against every
/// other.
std::vector<std::uint64_t> plain_neighbours(const Blocked& scan, const PlaceBlock& block,
                                            std::size_t query, std::size_t wanted) {
  LatticeBox box;
  for (std::size_t i = block.begin; i < block.end; ++i) box.add(scan.positions[i]);
  const LatticePosition centre = box.centre();
  std::vector<std::pair<float, std::uint64_t>> all;
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    float squared = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const float d = static_cast<float>(scan.positions[i][k] - centre[k]) -
                      static_cast<float>(scan.positions[query][k] - centre[k]);
      squared += d * d;
    }
    all.emplace_back(squared, i);
  }
  wanted = std::min(wanted, all.size());
  std::ranges::partial_sort(all, all.begin() + static_cast<std::ptrdiff_t>(wanted));
  std::vector<std::uint64_t> nearest;
  for (std::size_t i = 0; i < wanted; ++i) nearest.push_back(all[i].second);
  std::ranges::sort(nearest);
  return nearest;
}

/// Checks the neighbours of every stride-th place.
void check_all(const TrueCloud& cloud, std::size_t wanted, std::size_t slots,
               std::size_t stride = 1) {
  const RawScan raw = raw_scan(cloud);
  const ScanSpool spool = spool_of(raw);
  const Blocked scan(spool);
  NeighbourSearch search(spool, slots);
  double reach = 0;
  std::size_t found = 0, wrong = 0, expected = 0;
  for (const PlaceBlock& block : scan.blocks) {
    std::vector<std::uint32_t> queries;
    for (std::uint32_t i = block.begin; i < block.end; ++i) {
      if (i % stride == 0) queries.push_back(i - block.begin);
    }
    expected += queries.size();
    if (queries.empty()) continue;
    const auto positions = std::span(scan.positions).subspan(block.begin, block.end - block.begin);
    search.search(positions, queries, wanted, reach,
                  [&](std::uint32_t query, const Neighbours& neighbours) {
                    std::vector<std::uint64_t> got;
                    for (const std::uint32_t i : neighbours.found)
                      got.push_back(neighbours.place(i));
                    ++found;
                    wrong += got != plain_neighbours(scan, block, block.begin + query, wanted);
                  });
  }
  CHECK(found == expected);
  CHECK(wrong == 0);
}

}  // namespace

TEST_CASE("neighbour search: blocks are short, adjacent and cover all places",
          "[scan][neighbours]") {
  for (const std::size_t count : {1U, 31U, 32U, 33U, 5000U}) {
    const ScanSpool spool = spool_of(raw_scan(sphere_cloud(count)));
    const Blocked scan(spool);
    std::uint32_t at = 0;
    for (const PlaceBlock& block : scan.blocks) {
      REQUIRE(block.begin == at);
      REQUIRE(block.end > block.begin);
      REQUIRE(block.end - block.begin <= kBlockPlaces);
      at = block.end;
    }
    REQUIRE(at == scan.places.size());
    CHECK(scan.blocks.size() <= 1 + scan.places.size() / 8);
  }
}

TEST_CASE("neighbour search: neighbours equal their definition on a surface",
          "[scan][neighbours]") {
  check_all(sphere_cloud(20'000), 17, 64, 7);
  check_all(sphere_cloud(20'000), 49, 64, 31);
  check_all(sphere_cloud(3'000), 17, 1);  // one page at a time: nothing but the far search
}

TEST_CASE("neighbour search: of places at the same distance the first ones count as nearer",
          "[scan][neighbours]") {
  check_all(grid_cloud(60, 60, 1, 1), 17, 64);
  check_all(grid_cloud(60, 60, 1, 1), 8, 64);
}

TEST_CASE("neighbour search: sparse places beside a dense cluster find their neighbours",
          "[scan][neighbours]") {
  TrueCloud cloud = sphere_cloud(8'000);
  Random random(9);
  for (int i = 0; i < 60; ++i) {  // far away, and one close above the dense sphere
    const double far = i == 0 ? 1.2 : 1000;
    cloud.push_back({{far * (1 + random.uniform()), random.uniform(), random.uniform()}, {}});
  }
  for (SurfacePointTruth& point : cloud) point.position *= point.normal == glm::dvec3(0) ? 1 : 1e-3;
  check_all(cloud, 17, 64, 5);
}

TEST_CASE("neighbour search: a cloud with fewer places than wanted gives them all",
          "[scan][neighbours]") {
  for (const std::size_t count : {1U, 2U, 3U, 16U, 17U, 18U}) check_all(sphere_cloud(count), 17, 4);
}

TEST_CASE("neighbour search: all instruction sets find the same", "[scan][neighbours]") {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().DeInit();
    CAPTURE(hwy::TargetName(target));
    check_all(sphere_cloud(2'000), 17, 64);
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().DeInit();
}
