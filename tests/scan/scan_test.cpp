#include "engine/scan/scan.h"

#include <cmath>
#include <cstring>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "format/scalar.h"
#include "tests/scan/clouds.h"

using namespace ptc;
using namespace ptc::test;

TEST_CASE("scan: points come in their order, with all but normal, radius and flags unchanged",
          "[scan]") {
  RawScan scan = raw_scan(sphere_cloud(40'000));
  for (std::size_t i = 0; i < scan.records.size(); ++i) {
    scan.records[i].radiance = {static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(i >> 16),
                                3};
    scan.records[i].albedo = {4, 5, static_cast<std::uint8_t>(i)};
    scan.records[i].emission = {6, static_cast<std::uint16_t>(i), 7};
  }
  const Completed completed = complete(scan);
  REQUIRE(completed.records.size() == scan.records.size());
  REQUIRE(completed.marks.size() == scan.records.size());
  for (std::size_t i = 0; i < scan.records.size(); ++i) {
    PointRecord expected = scan.records[i];
    expected.normal = completed.records[i].normal;
    expected.radius = completed.records[i].radius;
    expected.flags = 0;
    REQUIRE(std::memcmp(&expected, &completed.records[i], sizeof expected) == 0);
    REQUIRE(completed.records[i].radius > 0);
  }
  CHECK(completed.report.points == scan.records.size());
  CHECK(completed.report.normals == scan.records.size());
  CHECK(completed.report.duplicates == 0);
  CHECK(completed.report.alone == 0);
}

TEST_CASE("scan: normals are those of the surface, with noise and without", "[scan]") {
  TrueCloud cloud = sphere_cloud(40'000);  // the spacing is 0.018
  RawScan scan = raw_scan(cloud);
  CHECK(compare(cloud, scan, complete(scan).records).median < 0.3);
  add_noise(cloud, 0.5 * 0.018);
  scan = raw_scan(cloud);
  const NormalErrors noisy = compare(cloud, scan, complete(scan).records);
  CHECK(noisy.median < 6);
  CHECK(noisy.flipped < 0.005);
}

TEST_CASE("scan: normals next to an edge are those of one of the faces", "[scan]") {
  const TrueCloud cloud = box_cloud(60'000, {1, 1, 1});  // the spacing is 0.01
  const RawScan scan = raw_scan(cloud);
  const Completed completed = complete(scan);
  std::size_t near = 0, between = 0;
  for (std::size_t i = 0; i < scan.records.size(); ++i) {
    const auto& [p, n] = cloud[scan.point[i]];
    int edges = 0;
    for (int k = 0; k < 3; ++k) edges += std::min(p[k], 1 - p[k]) < 0.015;
    if (edges < 2) continue;
    ++near;
    between += std::abs(glm::dot(normal_of(completed.records[i]), n)) < std::cos(20 * M_PI / 180);
  }
  CHECK(near > 2'000);
  CHECK(static_cast<double>(between) / static_cast<double>(near) < 0.25);
}

TEST_CASE("scan: points that coincide count as one, and are marked", "[scan]") {
  const TrueCloud cloud = sphere_cloud(20'000);
  TrueCloud doubled = cloud;
  for (std::size_t i = 0; i < 1000; ++i) doubled.push_back(cloud[i * 7]);
  for (std::size_t i = 0; i < 5000; ++i) doubled.push_back(cloud[42]);
  const RawScan once = raw_scan(cloud), twice = raw_scan(doubled);
  const Completed a = complete(once), b = complete(twice, {}, 1, 300);
  CHECK(b.report.duplicates == 6000);
  std::size_t from = 0, marked = 0;
  for (std::size_t i = 0; i < twice.records.size(); ++i) {
    const bool again = i > 0 && twice.records[i].key == twice.records[i - 1].key;
    REQUIRE(((b.marks[i] & kDuplicate) != 0) == again);
    if (again) ++marked;
    if (i > 0 && !again) ++from;
    REQUIRE(b.records[i].normal == a.records[from].normal);
    REQUIRE(b.records[i].radius == a.records[from].radius);
  }
  CHECK(marked == 6000);
}

TEST_CASE("scan: clouds of few points are completed", "[scan]") {
  for (const std::size_t count : {0U, 1U, 2U, 3U, 4U, 5U, 16U, 17U, 18U}) {
    const RawScan scan = raw_scan(sphere_cloud(count));
    ScanOptions options;
    options.up = {0, 1, 0};
    const Completed completed = complete(scan, options);
    REQUIRE(completed.records.size() == count);
    CHECK(completed.report.alone == (count < 2 ? count : 0));
    for (const PointRecord& record : completed.records) {
      CHECK(record.flags == 0);
      CHECK(std::isfinite(record.radius));
      CHECK((record.radius > 0) == (count > 1));
      if (count < 4) CHECK(std::abs(normal_of(record).y - 1) < 1e-3);
    }
  }
}

TEST_CASE("scan: a cloud in one place has no radii, and does not hang", "[scan]") {
  TrueCloud cloud(50'000, sphere_cloud(1)[0]);
  const RawScan scan = raw_scan(cloud);
  const Completed completed = complete(scan);
  CHECK(completed.report.duplicates == 49'999);
  CHECK(completed.report.alone == 50'000);
  for (const PointRecord& record : completed.records) REQUIRE(record.radius == 0);
}

TEST_CASE("scan: points on a line get finite normals across it", "[scan]") {
  TrueCloud cloud;
  for (int i = 0; i < 3000; ++i) cloud.push_back({{i * 0.1, i * 0.2, 0}, {0, 0, 1}});
  const RawScan scan = raw_scan(cloud);
  const glm::dvec3 along(0.4472135955, 0.894427191, 0);
  for (const PointRecord& record : complete(scan).records) {
    REQUIRE(std::abs(glm::dot(normal_of(record), along)) < 0.05);
    REQUIRE(std::isfinite(record.radius));
  }
}
