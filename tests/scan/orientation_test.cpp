#include "engine/scan/orientation.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/surfel.h"
#include "engine/scan/signed_graph.h"
#include "format/scalar.h"
#include "tests/scan/clouds.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Returns the vote of two places without noise.
std::int64_t vote(const std::array<float, 3>& a, const std::array<float, 3>& b,
                  const std::array<float, 3>& link) {
  return vote_of({a, 0}, {b, 0}, link);
}

/// Returns random points of the surface of several solid boxes, one for each unit of area.
TrueCloud solids_cloud(const std::vector<Bounds>& solids, std::uint64_t seed) {
  constexpr double kTouch = 1e-9;
  TrueCloud cloud;
  for (const Bounds& solid : solids) {
    const glm::dvec3 size = solid.high - solid.low;
    const double area = 2 * (size.x * size.y + size.y * size.z + size.z * size.x);
    for (SurfacePointTruth point : box_cloud(static_cast<std::size_t>(area), size, ++seed)) {
      point.position += solid.low;
      const auto covers = [&](const Bounds& other) {
        return &other != &solid &&
               Bounds{other.low - kTouch, other.high + kTouch}.contains(point.position);
      };
      if (std::ranges::none_of(solids, covers)) cloud.push_back(point);
    }
  }
  return cloud;
}

/// Returns a niche under a roof, 80 units wide, 24 deep and 100 high. Boards, 5 thick, run along
/// its back wall, and pilasters as deep as the boards cross them.
std::vector<Bounds> niche_with_boards() {
  constexpr double kWide = 80, kDeep = 24, kHigh = 100, kWall = 8, kBoard = 5;
  std::vector<Bounds> solids{
      {{0, -kDeep, -kWall}, {kWide, kDeep + kWall, 0}},                         // ground
      {{0, kDeep, 0}, {kWide, kDeep + kWall, kHigh + kWall}},                   // back wall
      {{0, 0, kHigh}, {kWide, kDeep, kHigh + kWall}},                           // roof
      {{-kWall, -kDeep, -kWall}, {0, kDeep + kWall, kHigh + kWall}},            // left wall
      {{kWide, -kDeep, -kWall}, {kWide + kWall, kDeep + kWall, kHigh + kWall}}  // right wall
  };
  for (int x = 12; x < kWide; x += 24)
    solids.push_back({{x, kDeep - kBoard, 0}, {x + 6, kDeep, kHigh}});
  for (int z = 10; z < kHigh - 10; z += 10)
    solids.push_back({{0, kDeep - kBoard, z}, {kWide, kDeep, z + kBoard}});
  return solids;
}

}  // namespace

TEST_CASE("vote: places of one plane agree, or one of them is to be flipped",
          "[scan][orientation]") {
  CHECK(vote({0, 0, 1}, {0, 0, 1}, {3, 1, 0}) == kFullVote);
  CHECK(vote({0, 0, 1}, {0, 0, -1}, {3, 1, 0}) == -kFullVote);
  CHECK(vote({0, 0, 1}, {0, 0, 1}, {0, 0, 0}) == 0);
}

TEST_CASE("vote: places across an edge agree when both normals point outwards",
          "[scan][orientation]") {
  CHECK(vote({0, 0, 1}, {1, 0, 0}, {1, 0, -1}) == kFullVote);
  CHECK(vote({0, 0, 1}, {-1, 0, 0}, {1, 0, -1}) == -kFullVote);
  CHECK(vote({0, 0, 1}, {-1, 0, 0}, {1, 0, 1}) == kFullVote);  // an inner edge
}

TEST_CASE("vote: places on both sides of a wall say nothing", "[scan][orientation]") {
  CHECK(vote({0, 0, 1}, {0, 0, 1}, {0, 0, -1}) == 0);
  CHECK(vote({0, 0, 1}, {0, 0, -1}, {0.5F, 0, -1}) == 0);
  CHECK(vote({0, 0, 1}, {0, 0, -1}, {1, 0, -0.6F}) == 0);
}

TEST_CASE("vote: noise explains a link that is not along the surface", "[scan][orientation]") {
  CHECK(vote_of({{0, 0, 1}, 0.6F}, {{0, 0, 1}, 0.6F}, {1, 0, 1.2F}) == kFullVote);
}

TEST_CASE("signed graph: many weak votes outweigh a single wrong one", "[scan][orientation]") {
  SignedGraph graph(4);
  graph.add(0, 1, 9);
  graph.add(1, 2, -1);  // wrong
  graph.add(0, 2, 3);
  graph.add(3, 2, -5);
  graph.contract(1);
  const auto root = graph.find(0);
  for (const std::uint32_t node : {1U, 2U, 3U}) {
    CHECK(graph.find(node).root == root.root);
    CHECK((graph.find(node).flipped != root.flipped) == (node == 3));
  }
  CHECK(graph.edges().empty());
}

TEST_CASE("signed graph: edges below the least vote are left, with the sum of their votes",
          "[scan][orientation]") {
  SignedGraph graph(4);
  graph.add(0, 1, -10);
  graph.add(2, 3, 10);
  graph.add(0, 2, 1);
  graph.add(1, 2, -1);
  graph.add(1, 3, -1);
  graph.contract(5);
  const auto edges = graph.edges();
  REQUIRE(edges.size() == 1);
  const auto a = graph.find(0), b = graph.find(2);
  CHECK(a.root != b.root);
  const std::int64_t agree = a.flipped == b.flipped ? 1 : -1;
  CHECK(edges[0].vote * agree == 3);
  graph.contract(1);
  CHECK(graph.find(0).root == graph.find(2).root);
  CHECK(graph.find(0).flipped == graph.find(2).flipped);
}

TEST_CASE("signed graph: signs that agree with all votes are found, whatever the order",
          "[scan][orientation]") {
  std::mt19937_64 bits(8);
  constexpr std::uint32_t kNodes = 500;
  std::vector<bool> sign(kNodes);
  for (std::size_t i = 0; i < kNodes; ++i) sign[i] = bits() % 2 == 0;
  std::vector<SignedGraph::Edge> edges;
  for (std::uint32_t i = 1; i < kNodes; ++i) {
    for (int k = 0; k < 4; ++k) {
      const auto j = static_cast<std::uint32_t>(bits() % i);
      const auto strength = static_cast<std::int64_t>(bits() % 9 + 1);
      edges.push_back({i, j, sign[i] == sign[j] ? strength : -strength});
    }
  }
  for (int round = 0; round < 5; ++round) {
    SignedGraph graph(kNodes);
    for (const SignedGraph::Edge& edge : edges) graph.add(edge.a, edge.b, edge.vote);
    if (round > 0) graph.contract(round);
    graph.contract(1);
    for (std::uint32_t i = 1; i < kNodes; ++i) {
      REQUIRE(graph.find(i).root == graph.find(0).root);
      REQUIRE((graph.find(i).flipped == graph.find(0).flipped) == (sign[i] == sign[0]));
    }
    std::ranges::shuffle(edges, bits);
  }
}

TEST_CASE("orientation: closed surfaces turn outwards", "[scan][orientation]") {
  for (const std::size_t count : {500U, 20'000U, 150'000U}) {
    const TrueCloud sphere = sphere_cloud(count), box = box_cloud(count, {1, 2, 0.5});
    for (const TrueCloud& cloud : {sphere, box}) {
      const RawScan scan = raw_scan(cloud);
      const Completed completed = complete(scan);
      CAPTURE(count, &cloud == &sphere);
      CHECK(completed.report.islands <= 2);  // points at a corner may stand apart
      // A cloud of 500 points has up to three at its edges that take the face beyond
      CHECK(compare(cloud, scan, completed.records).flipped < (count == 500 ? 0.007 : 0.003));
    }
  }
}

TEST_CASE("orientation: both faces of a thin wall turn outwards", "[scan][orientation]") {
  // 40,000 points on 2 square units: the spacing is 0.007, the wall 0.03
  const TrueCloud wall = box_cloud(40'000, {1, 1, 0.03});
  const RawScan scan = raw_scan(wall);
  CHECK(compare(wall, scan, complete(scan).records).flipped < 0.003);
}

TEST_CASE("orientation: separate surfaces turn outwards each", "[scan][orientation]") {
  TrueCloud cloud = sphere_cloud(30'000, 1);
  for (SurfacePointTruth point : sphere_cloud(20'000, 2)) {
    point.position = point.position * 0.5 + glm::dvec3(4, 0, 1);
    cloud.push_back(point);
  }
  const RawScan scan = raw_scan(cloud);
  const Completed completed = complete(scan);
  CHECK(completed.report.islands == 0);  // both have a top that sees the sky
  CHECK(compare(cloud, scan, completed.records).flipped == 0);
}

TEST_CASE("orientation: faces of boards keep their sides where noise blurs their edges",
          "[scan][orientation]") {
  // A few points at edges take the face beyond. Votes by sharp normals flip whole faces, too
  constexpr std::uint64_t kClouds = 4;
  double flipped = 0;
  for (std::uint64_t i = 0; i < kClouds; ++i) {
    TrueCloud cloud = solids_cloud(niche_with_boards(), 100 * i);
    add_noise(cloud, 0.05, 100 * i);
    const RawScan scan = raw_scan(cloud);
    flipped += compare(cloud, scan, complete(scan).records).flipped / kClouds;
  }
  CHECK(flipped < 0.0045);
}

TEST_CASE("orientation: normals turn to their scanner", "[scan][orientation]") {
  TrueCloud cloud = sphere_cloud(50'000);
  for (SurfacePointTruth& point : cloud) point.normal = -point.normal;
  const RawScan inside = raw_scan(cloud, 1);
  ScanOptions options;
  options.scanners = {{9, 9, 9}, {0, 0, 0.1}};
  const Completed completed = complete(inside, options);
  CHECK(completed.report.islands == 0);
  CHECK(compare(cloud, inside, completed.records).flipped == 0);
}

TEST_CASE("orientation: normals that the scanner sees at a grazing angle follow their neighbours",
          "[scan][orientation]") {
  // A scanner just above a plane sees most of it at less than the angle that decides.
  TrueCloud cloud;
  Random random(11);
  for (int i = 0; i < 40'000; ++i)
    cloud.push_back({{random.uniform() - 0.5, random.uniform() - 0.5, 0}, {0, 0, -1}});
  const RawScan scan = raw_scan(cloud, 0);
  ScanOptions options;
  options.scanners = {{0, 0, -0.01}};
  CHECK(compare(cloud, scan, complete(scan, options).records).flipped == 0);
}

TEST_CASE("orientation: normals of an aerial scan and of an open sheet turn upwards",
          "[scan][orientation]") {
  TrueCloud cloud;
  Random random(12);
  for (int i = 0; i < 60'000; ++i) {
    const double x = 6 * random.uniform(), y = 6 * random.uniform();
    const glm::dvec3 n(-std::cos(x) * 0.5, 0.5 * std::sin(y), 1);
    cloud.push_back({{x, y, 0.5 * std::sin(x) + 0.5 * std::cos(y)}, glm::normalize(n)});
  }
  const RawScan scan = raw_scan(cloud);
  ScanOptions options;
  for (const bool aerial : {true, false}) {
    options.aerial = aerial;
    options.up = {0, 0, 2};
    CHECK(compare(cloud, scan, complete(scan, options).records).flipped == 0);
    options.up = {0, 0, -2};
    CHECK(compare(cloud, scan, complete(scan, options).records).flipped == 1);
  }
}

TEST_CASE("orientation: known normals stay and lead the others", "[scan][orientation]") {
  TrueCloud cloud = sphere_cloud(30'000);
  for (SurfacePointTruth& point : cloud) point.normal = -point.normal;
  RawScan scan = raw_scan(cloud);
  std::array<std::int16_t, 2> given{};
  for (std::size_t i = 0; i < scan.records.size(); i += 100) {
    const glm::dvec3& n = cloud[scan.point[i]].normal;
    given = encode_octahedral(
        {static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)});
    scan.records[i].normal = given;
    scan.records[i].flags = 0;
  }
  const Completed completed = complete(scan);
  CHECK(compare(cloud, scan, completed.records).flipped == 0);
  for (std::size_t i = 0; i < scan.records.size(); i += 100)
    REQUIRE(completed.records[i].normal == scan.records[i].normal);
}
