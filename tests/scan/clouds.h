// Point clouds with known surfaces for the tests of the scan.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/scan/scan.h"
#include "engine/scan/scan_spool.h"
#include "format/point_record.h"

namespace ptc::test {

/// A point of a cloud, and the normal of the surface on which it lies.
struct SurfacePointTruth {
  glm::dvec3 position;
  glm::dvec3 normal;
};
using TrueCloud = std::vector<SurfacePointTruth>;

/// Random numbers that are the same on every machine.
class Random {
 public:
  explicit Random(std::uint64_t seed) : bits_(seed) {}
  /// Returns a number in [0, 1).
  double uniform() { return static_cast<double>(bits_() >> 11) * 0x1p-53; }
  /// Returns a number of the normal distribution with variance 1.
  double normal();

 private:
  std::mt19937_64 bits_;
};

/// Returns random points of a sphere of radius 1 around the origin.
[[nodiscard]] TrueCloud sphere_cloud(std::size_t count, std::uint64_t seed = 1);
/// Returns random points of a box with a corner in the origin.
[[nodiscard]] TrueCloud box_cloud(std::size_t count, const glm::dvec3& size,
                                  std::uint64_t seed = 1);
/// Returns a grid of points on the plane z = 0, columns x rows, `step` apart.
[[nodiscard]] TrueCloud grid_cloud(int columns, int rows, double step_x, double step_y);
/// Moves every point by Gaussian noise along each axis.
void add_noise(TrueCloud& cloud, double deviation, std::uint64_t seed = 2);

/// A cloud as sorted records without normals and radii, and which point each record is.
struct RawScan {
  Frame frame;
  std::vector<PointRecord> records;
  std::vector<std::size_t> point;  ///< by record
};
[[nodiscard]] RawScan raw_scan(const TrueCloud& cloud, std::uint32_t scanner = kNoScanner);
/// Returns a spool with the records of a scan, in the directory of temporary files.
[[nodiscard]] ScanSpool spool_of(const RawScan& scan, std::uint64_t index_bytes = 1 << 20);

/// A completed scan.
struct Completed {
  std::vector<PointRecord> records;
  std::vector<std::uint8_t> marks;
  ScanReport report;
};
/// Completes a scan; options.temp_dirs is replaced.
/// @param block  records that are asked for at once
[[nodiscard]] Completed complete(const RawScan& scan, ScanOptions options = {},
                                 unsigned threads = 1, std::size_t block = 1000);

/// How far normals are from the truth.
struct NormalErrors {
  double median = 0;   ///< of the angle to the line along the true normal, degrees
  double flipped = 0;  ///< share that points to the wrong side
};
[[nodiscard]] NormalErrors compare(const TrueCloud& cloud, const RawScan& scan,
                                   const std::vector<PointRecord>& records);

/// Returns the normal of a record.
[[nodiscard]] glm::dvec3 normal_of(const PointRecord& record);

}  // namespace ptc::test
