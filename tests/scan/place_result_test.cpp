#include "engine/scan/place_result.h"

#include <algorithm>
#include <cmath>
#include <ranges>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "format/scalar.h"
#include "tests/scan/clouds.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Share of the points of a surface that a disc covers, of those given.
double covered_share(const std::vector<glm::dvec3>& surface, const TrueCloud& cloud,
                     const RawScan& scan, const std::vector<PointRecord>& records) {
  std::size_t covered = 0;
  for (const glm::dvec3& p : surface) {
    const bool hit =
        std::ranges::any_of(std::views::iota(std::size_t{0}, records.size()), [&](std::size_t i) {
          const glm::dvec3 d = cloud[scan.point[i]].position - p;
          return glm::dot(d, d) <= double{records[i].radius} * records[i].radius;
        });
    if (hit) ++covered;
  }
  return static_cast<double>(covered) / static_cast<double>(surface.size());
}

/// Sum of 2 r^2.
double area_of(const std::vector<PointRecord>& records) {
  double area = 0;
  for (const PointRecord& record : records) area += 2.0 * record.radius * record.radius;
  return area;
}

std::vector<glm::dvec3> places_between(const glm::dvec3& low, const glm::dvec3& high,
                                       std::size_t count) {
  Random random(21);
  std::vector<glm::dvec3> places;
  while (places.size() < count) {
    const glm::dvec3 share(random.uniform(), random.uniform(), random.uniform());
    places.push_back(low + share * (high - low));
  }
  return places;
}

}  // namespace

TEST_CASE("octahedral: flipping gives the opposite direction, and twice the same numbers",
          "[scan][result]") {
  Random random(22);
  for (int i = 0; i < 20'000; ++i) {
    const auto n = encode_octahedral({static_cast<float>(i % 7 == 0 ? 0 : random.normal()),
                                      static_cast<float>(i % 5 == 0 ? 0 : random.normal()),
                                      static_cast<float>(i % 3 == 0 ? 0 : random.normal())});
    const auto opposite = flip_octahedral(n);
    const auto a = decode_octahedral_f64(n[0], n[1]);
    const auto b = decode_octahedral_f64(opposite[0], opposite[1]);
    for (std::size_t k = 0; k < 3; ++k) REQUIRE(a[k] == Approx(-b[k]).margin(1e-12));
    const auto again =
        decode_octahedral_f64(flip_octahedral(opposite)[0], flip_octahedral(opposite)[1]);
    REQUIRE(again == a);
  }
}

TEST_CASE("radius: discs of an even grid circumscribe its cells", "[scan][radius]") {
  const TrueCloud cloud = grid_cloud(200, 200, 1, 1);
  const RawScan scan = raw_scan(cloud);
  const Completed completed = complete(scan);
  std::size_t inner = 0;
  for (std::size_t i = 0; i < scan.records.size(); ++i) {
    const glm::dvec3& p = cloud[scan.point[i]].position;
    const float radius = completed.records[i].radius;
    const bool inside = p.x > 3 && p.x < 196 && p.y > 3 && p.y < 196;
    if (inside) REQUIRE(std::abs(radius - 0.7071F) < 0.03F);
    REQUIRE(radius > 0.6F);
    REQUIRE(radius < 1.2F);
    if (inside) ++inner;
  }
  CHECK(inner > 30'000);
}

TEST_CASE("radius: the cells of random points add up to the surface", "[scan][radius]") {
  const RawScan scan = raw_scan(sphere_cloud(50'000));
  CHECK(area_of(complete(scan).records) == Approx(4 * M_PI).epsilon(0.06));
}

TEST_CASE("radius: discs on scan lines reach the next line and cover the surface",
          "[scan][radius]") {
  for (const double ratio : {1.5, 2.0, 3.0, 5.0, 10.0}) {
    const TrueCloud cloud = grid_cloud(static_cast<int>(40 * ratio), 40, 1 / ratio, 1);
    const RawScan scan = raw_scan(cloud);
    const Completed completed = complete(scan);
    CAPTURE(ratio);
    CHECK(covered_share(places_between({5, 5, 0}, {34, 34, 0}, 3000), cloud, scan,
                        completed.records) > 0.99);
  }
}

TEST_CASE("radius: no hole opens where the spacing changes", "[scan][radius]") {
  TrueCloud cloud = grid_cloud(40, 40, 0.5, 0.5);
  for (SurfacePointTruth point : grid_cloud(10, 10, 2, 2)) {
    point.position.x += 21;
    cloud.push_back(point);
  }
  const RawScan scan = raw_scan(cloud);
  CHECK(covered_share(places_between({1, 1, 0}, {38, 17, 0}, 3000), cloud, scan,
                      complete(scan).records) > 0.98);
}

TEST_CASE("radius: given radii stay, and all stay when none are wanted", "[scan][radius]") {
  RawScan scan = raw_scan(sphere_cloud(5'000));
  scan.records[77].radius = 9;
  Completed completed = complete(scan);
  CHECK(completed.records[77].radius == 9);
  CHECK(completed.report.radii == 4'999);
  ScanOptions options;
  options.radii = false;
  completed = complete(scan, options);
  CHECK(completed.report.radii == 0);
  for (std::size_t i = 0; i < scan.records.size(); ++i)
    REQUIRE(completed.records[i].radius == scan.records[i].radius);
}

TEST_CASE("outliers: points off a surface are marked, and points of it are not",
          "[scan][outliers]") {
  for (const double noise : {0.0, 0.5}) {
    // 40,000 points on a sphere: the spacing is 0.018.
    TrueCloud cloud = sphere_cloud(40'000);
    add_noise(cloud, noise * 0.018);
    Random random(23);
    for (int i = 0; i < 40; ++i) {  // 8 to 30 spacings above or below
      const glm::dvec3 n = sphere_cloud(1, static_cast<std::uint64_t>(i) + 100)[0].normal;
      const double off = (0.15 + 0.4 * random.uniform()) * (i % 2 == 0 ? 1 : -1);
      cloud.push_back({n * (1 + off), n});
    }
    const RawScan scan = raw_scan(cloud);
    const Completed completed = complete(scan);
    std::size_t found = 0, wrong = 0;
    for (std::size_t i = 0; i < scan.records.size(); ++i) {
      if ((completed.marks[i] & kOutlier) == 0) continue;
      ++(scan.point[i] >= 40'000 ? found : wrong);
    }
    CAPTURE(noise);
    CHECK(found >= 36);  // some are close to another one
    CHECK(wrong <= 2);
    CHECK(completed.report.outliers == found + wrong);
  }
}

TEST_CASE("outliers: sparse points in the space around a surface are marked", "[scan][outliers]") {
  TrueCloud cloud = sphere_cloud(40'000);
  Random random(24);
  for (int i = 0; i < 200; ++i) {
    const glm::dvec3 p(random.uniform() * 8 - 4, random.uniform() * 8 - 4,
                       random.uniform() * 8 - 4);
    if (std::abs(glm::length(p) - 1) > 0.2) cloud.push_back({p, p});
  }
  const RawScan scan = raw_scan(cloud);
  const Completed completed = complete(scan);
  std::size_t found = 0, wrong = 0;
  for (std::size_t i = 0; i < scan.records.size(); ++i) {
    if ((completed.marks[i] & kOutlier) == 0) continue;
    ++(scan.point[i] >= 40'000 ? found : wrong);
  }
  CHECK(found > (cloud.size() - 40'000) * 8 / 10);
  CHECK(wrong <= 2);
}
