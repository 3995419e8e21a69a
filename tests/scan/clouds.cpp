#include "tests/scan/clouds.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>

#include "engine/io/cloud/record.h"
#include "engine/parallel/thread_pool.h"
#include "format/scalar.h"
#include "tests/support/scenes.h"

namespace ptc::test {

double Random::normal() {
  const double radius = std::sqrt(-2 * std::log(1 - uniform()));
  return radius * std::cos(2 * std::numbers::pi * uniform());
}

TrueCloud sphere_cloud(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  TrueCloud cloud;
  while (cloud.size() < count) {
    const double z = 2 * random.uniform() - 1, turn = 2 * std::numbers::pi * random.uniform();
    const double ring = std::sqrt(1 - z * z);
    const glm::dvec3 p(ring * std::cos(turn), ring * std::sin(turn), z);
    cloud.push_back({p, p});
  }
  return cloud;
}

TrueCloud box_cloud(std::size_t count, const glm::dvec3& size, std::uint64_t seed) {
  Random random(seed);
  const double area[3] = {size.y * size.z, size.z * size.x, size.x * size.y};
  TrueCloud cloud;
  while (cloud.size() < count) {
    double choice = random.uniform() * (area[0] + area[1] + area[2]);
    int axis = 0;
    for (; axis < 2 && choice >= area[axis]; ++axis) choice -= area[axis];
    glm::dvec3 p(random.uniform() * size.x, random.uniform() * size.y, random.uniform() * size.z);
    glm::dvec3 n(0);
    const bool far = random.uniform() < 0.5;
    p[axis] = far ? size[axis] : 0;
    n[axis] = far ? 1 : -1;
    cloud.push_back({p, n});
  }
  return cloud;
}

TrueCloud grid_cloud(int columns, int rows, double step_x, double step_y) {
  TrueCloud cloud;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) cloud.push_back({{x * step_x, y * step_y, 0}, {0, 0, 1}});
  }
  return cloud;
}

void add_noise(TrueCloud& cloud, double deviation, std::uint64_t seed) {
  Random random(seed);
  for (SurfacePointTruth& point : cloud) {
    for (int k = 0; k < 3; ++k) point.position[k] += deviation * random.normal();
  }
}

RawScan raw_scan(const TrueCloud& cloud, std::uint32_t scanner) {
  std::vector<Surfel> surfels;
  for (const SurfacePointTruth& point : cloud) surfels.push_back({.position = point.position});
  RawScan scan;
  scan.frame = sort_scene(surfels).frame;
  std::vector<PointRecord> records;
  for (const Surfel& surfel : surfels) {
    records.push_back(to_record(surfel, scan.frame));
    std::memcpy(&records.back().normal, &scanner, sizeof scanner);
    records.back().flags = kUnknownNormal;
  }
  scan.point.resize(cloud.size());
  std::iota(scan.point.begin(), scan.point.end(), 0);
  std::ranges::stable_sort(scan.point, {}, [&](std::size_t i) { return records[i].key; });
  for (const std::size_t i : scan.point) scan.records.push_back(records[i]);
  return scan;
}

ScanSpool spool_of(const RawScan& scan, std::uint64_t index_bytes) {
  ScanSpool spool({std::filesystem::temp_directory_path()}, index_bytes);
  spool.add_records(scan.records);
  spool.add_places(scan.records);
  spool.finish();
  return spool;
}

Completed complete(const RawScan& scan, ScanOptions options, unsigned threads, std::size_t block) {
  options.temp_dirs = {std::filesystem::temp_directory_path()};
  VectorStream sorted(scan.records, 777);
  Progress silent;
  Completed completed;
  const auto stream =
      complete_scan(sorted, scan.frame, options, ThreadPool(threads), silent, completed.report);
  std::vector<PointRecord> records(block);
  while (const std::size_t count = stream->next(records)) {
    completed.records.insert(completed.records.end(), records.begin(),
                             records.begin() + static_cast<std::ptrdiff_t>(count));
    const auto marks = stream->marks();
    completed.marks.insert(completed.marks.end(), marks.begin(), marks.end());
  }
  return completed;
}

glm::dvec3 normal_of(const PointRecord& record) {
  const auto n = decode_octahedral_f64(record.normal[0], record.normal[1]);
  return {n[0], n[1], n[2]};
}

NormalErrors compare(const TrueCloud& cloud, const RawScan& scan,
                     const std::vector<PointRecord>& records) {
  std::vector<double> angles;
  double flipped = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const double cosine = glm::dot(normal_of(records[i]), cloud[scan.point[i]].normal);
    flipped += cosine < 0 ? 1 : 0;
    angles.push_back(std::acos(std::min(1.0, std::abs(cosine))) * 180 / std::numbers::pi);
  }
  const auto middle = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2);
  std::ranges::nth_element(angles, middle);
  return {*middle, flipped / static_cast<double>(records.size())};
}

}  // namespace ptc::test
