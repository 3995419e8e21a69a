#include <algorithm>
#include <cmath>
#include <cstring>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/scan/scan.h"
#include "tests/scan/clouds.h"

using namespace ptc;
using namespace ptc::test;

namespace {

bool same(const Completed& a, const Completed& b) {
  return a.records.size() == b.records.size() && a.marks == b.marks &&
         std::memcmp(a.records.data(), b.records.data(), a.records.size() * sizeof(PointRecord)) ==
             0;
}

/// A sphere with noise, a wall, lines, coincident and stray points.
TrueCloud mixed_cloud() {
  TrueCloud cloud = sphere_cloud(120'000);
  add_noise(cloud, 0.002);
  for (SurfacePointTruth point : box_cloud(60'000, {1, 1, 0.02})) {
    point.position += glm::dvec3(1.5, 0, 0);
    cloud.push_back(point);
  }
  for (SurfacePointTruth point : grid_cloud(400, 40, 0.005, 0.05)) {
    point.position += glm::dvec3(-4, 0, 0);
    cloud.push_back(point);
  }
  Random random(31);
  for (int i = 0; i < 500; ++i)
    cloud.push_back({{random.uniform() * 90, random.uniform() * 90, random.uniform() * 90}, {}});
  for (std::size_t i = 0; i < 2000; ++i) cloud.push_back(cloud[i * 11]);
  return cloud;
}

}  // namespace

TEST_CASE("scan: memory, threads and blocks change no byte", "[scan][caps]") {
  const RawScan scan = raw_scan(mixed_cloud());
  ScanOptions options;
  const Completed first = complete(scan, options);
  for (const unsigned threads : {1U, 2U, 5U}) {
    for (const std::uint64_t mebibytes : {29U, 40U, 200U}) {
      options.memory_bytes = mebibytes << 20;
      CAPTURE(threads, mebibytes);
      CHECK(same(complete(scan, options, threads, 1 + 700 * threads), first));
    }
  }
}

TEST_CASE("scan: a cap that is too small is refused with the smallest that works", "[scan][caps]") {
  const RawScan scan = raw_scan(sphere_cloud(5'000));
  ScanOptions options;
  options.memory_bytes = 1 << 20;
  CHECK_THROWS_AS(complete(scan, options), LimitError);
}

TEST_CASE("scan: the place and the unit of a cloud do not change its normals", "[scan][caps]") {
  TrueCloud cloud = sphere_cloud(20'000);
  for (SurfacePointTruth& point : cloud) {  // onto a coarse lattice, which both frames hold
    for (int k = 0; k < 3; ++k) point.position[k] = std::rint(point.position[k] * 0x1p20) * 0x1p-20;
  }
  const RawScan here = raw_scan(cloud);
  for (SurfacePointTruth& point : cloud)
    point.position = (point.position + glm::dvec3(4096)) * 1024.0;
  const RawScan there = raw_scan(cloud);
  const Completed a = complete(here), b = complete(there);
  std::vector<std::array<std::int16_t, 2>> normals(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) normals[here.point[i]] = a.records[i].normal;
  std::size_t differ = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const auto& other = normals[there.point[i]];
    differ += std::abs(other[0] - b.records[i].normal[0]) > 3 ||
              std::abs(other[1] - b.records[i].normal[1]) > 3;
  }
  CHECK(differ < 20);  // only where the fold of the octahedron or a block's border lies between
}
