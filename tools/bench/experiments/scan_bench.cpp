// From a mesh to the errors of normals:
//
//   mesh --> random points, true normals --> noise --> sorted records
//                                                       |--> complete_scan() -------> angles
//                                                       `--> file --> Open3D, PCL --> angles
//
// Open3D runs in an interpreter of its own, PCL in a program of its own, on the same points in the
// same order. They read them from a file and write their normals to another; what is timed are
// their calls.
#include "tools/bench/experiments/scan_bench.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/record.h"
#include "engine/parallel/thread_pool.h"
#include "engine/scan/scan.h"
#include "format/checksum.h"
#include "format/scalar.h"
#include "tools/bench/experiments/rival_run.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/sampled_cloud.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

/// The program that runs the rival. Arguments: points, normals and facts.
constexpr char kOpen3d[] = R"(import json, resource, sys
import numpy, open3d

def seconds():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime

points = numpy.fromfile(sys.argv[1], numpy.float64).reshape(-1, 3)
cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, seconds()
cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(30))
middle = seconds()
cloud.orient_normals_consistent_tangent_plane(15)
facts = {"normals": middle - start, "all": seconds() - start,
         "bytes": 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)}
numpy.asarray(cloud.normals).astype(numpy.float32).tofile(sys.argv[2])
json.dump(facts, open(sys.argv[3], "w"))
)";

/// Points of a mesh, sorted along the Z-curve.
struct SampledCloud {
  Frame frame;
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec3> normals;  ///< of the mesh
  std::vector<PointRecord> records;
  double area = 0;  ///< of the mesh
};

/// Samples a mesh uniformly at random.
SampledCloud sample(const RayScene& scene, std::uint64_t points, double noise) {
  // Draw points from the mesh
  SampledCloud cloud{.area = area_of(scene.mesh())};
  std::vector<Surfel> surfels;
  Bounds bounds;
  for (const SampledPoint& p : sample_at_random(scene, {.points = points, .noise = noise})) {
    bounds.add(p.position);
    surfels.push_back({.position = p.position, .normal = p.normal});
  }
  // Sort them
  cloud.frame = frame_around({bounds.low.x, bounds.low.y, bounds.low.z},
                             {bounds.high.x, bounds.high.y, bounds.high.z});
  std::vector<std::pair<MortonKey, std::uint32_t>> order;
  for (const Surfel& s : surfels) {
    order.emplace_back(to_record(s, cloud.frame).key, static_cast<std::uint32_t>(order.size()));
  }
  std::ranges::sort(order);
  for (const auto& [key, i] : order) {
    PointRecord record = to_record(surfels[i], cloud.frame);
    std::memcpy(&record.normal, &kNoScanner, sizeof kNoScanner);
    record.flags = kUnknownNormal;
    cloud.records.push_back(record);
    cloud.normals.push_back(surfels[i].normal);
    const auto p = cloud.frame.to_position(decode_morton(key));
    cloud.positions.emplace_back(p[0], p[1], p[2]);
  }
  return cloud;
}

/// Yields the records of a cloud.
class CloudStream : public PointStream {
 public:
  explicit CloudStream(const SampledCloud& cloud) : cloud_(cloud) {}
  std::size_t next(std::span<PointRecord> out) override {
    const std::size_t count = std::min(out.size(), cloud_.records.size() - at_);
    std::copy_n(cloud_.records.begin() + static_cast<std::ptrdiff_t>(at_), count, out.begin());
    at_ += count;
    return count;
  }

 private:
  const SampledCloud& cloud_;
  std::size_t at_ = 0;
};

/// Compares normals with those of the mesh.
void judge(ScanRow& row, const SampledCloud& cloud, const std::vector<glm::vec3>& normals) {
  std::vector<double> angles;
  double flipped = 0;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const double cosine = glm::dot(normals[i], cloud.normals[i]);
    flipped += cosine < 0 ? 1 : 0;
    angles.push_back(std::acos(std::min(1.0, std::abs(cosine))) * 180 / std::numbers::pi);
  }
  const auto count = static_cast<double>(angles.size());
  std::ranges::sort(angles);
  row.points = angles.size();
  row.median = angles[angles.size() / 2];
  row.percentile_95 = angles[angles.size() * 95 / 100];
  row.mean = std::reduce(angles.begin(), angles.end()) / count;
  row.flipped = flipped / count;
}

/// Completes the cloud once. @return all records
std::vector<PointRecord> complete(const SampledCloud& cloud, const ScanOptions& options,
                                  const Executor& executor, ScanReport& report) {
  CloudStream sorted(cloud);
  Progress silent;
  const auto stream = complete_scan(sorted, cloud.frame, options, executor, silent, report);
  std::vector<PointRecord> records(cloud.records.size());
  std::size_t at = 0;
  while (const std::size_t count = stream->next(std::span(records).subspan(at))) {
    at += count;
    if (at == records.size()) break;
  }
  return records;
}

ScanRow measure_ptcx(const SampledCloud& cloud, const ScanBenchOptions& options,
                     const std::filesystem::path& work, const RunOptions& run) {
  ScanRow row{.method = "ptcx"};
  ScanOptions scan{.memory_bytes = run.memory_bytes, .temp_dirs = {work}, .up = {0, 1, 0}};
  const ThreadPool executor(run.threads);
  std::vector<PointRecord> records;
  ScanReport report;
  TimedRuns runs;
  for (unsigned i = 0; i < options.repeats; ++i)
    runs.run([&] { records = complete(cloud, scan, executor, report); });
  // The result must depend on neither the cap nor the threads
  constexpr std::uint64_t kSmall = std::uint64_t{48} << 20;
  scan.memory_bytes = std::min(run.memory_bytes, kSmall);
  ScanReport other;
  const std::vector<PointRecord> again =
      complete(cloud, scan, ThreadPool(run.threads == 1 ? 2 : 1), other);
  if (std::memcmp(again.data(), records.data(), records.size() * sizeof(PointRecord)) != 0)
    throw DataError("scan: another cap and number of threads give other bytes");
  std::vector<glm::vec3> normals;
  double area = 0;
  for (const PointRecord& record : records) {
    const auto n = decode_octahedral(record.normal[0], record.normal[1]);
    normals.emplace_back(n[0], n[1], n[2]);
    area += 2.0 * record.radius * record.radius;
  }
  judge(row, cloud, normals);
  row.cpu = spread_of(runs.cpu);
  row.area = area / cloud.area;
  row.outliers = report.outliers;
  row.resident_bytes = runs.resident;
  return row;
}

void write_bytes(const std::filesystem::path& path, const void* data, std::size_t bytes) {
  std::ofstream out(path, std::ios::binary);
  out.write(static_cast<const char*>(data), static_cast<std::streamsize>(bytes));
  out.close();
  if (!out) throw std::system_error(errno, std::generic_category(), "write " + path.string());
}

/// Measures a library that runs in another program.
/// @param call  runs it once with the names of two files, the points and the normals that it
///              writes, and returns the facts that it tells
template <class Call>
ScanRow measure_rival(const std::string& method, const SampledCloud& cloud,
                      const ScanBenchOptions& options, const std::filesystem::path& work,
                      const Call& call) {
  const WorkFile points(work, "-points"), result(work, "-normals");
  write_bytes(points.path(), cloud.positions.data(), cloud.positions.size() * sizeof(glm::dvec3));
  ScanRow row{.method = method};
  std::vector<double> cpu, normals_cpu;
  for (unsigned i = 0; i < options.repeats; ++i) {
    const nlohmann::json facts = call(points.path().string(), result.path().string());
    cpu.push_back(facts.at("all").get<double>());
    normals_cpu.push_back(facts.at("normals").get<double>());
    row.resident_bytes = std::max(row.resident_bytes, facts.at("bytes").get<std::uint64_t>());
  }
  std::vector<glm::vec3> normals(cloud.records.size());
  std::ifstream in(result.path(), std::ios::binary);
  in.read(reinterpret_cast<char*>(normals.data()),
          static_cast<std::streamsize>(normals.size() * sizeof(glm::vec3)));
  if (!in) throw DataError("scan: " + method + " wrote too few normals");
  judge(row, cloud, normals);
  row.cpu = spread_of(cpu);
  row.normals_us = 1e6 * spread_of(normals_cpu).median / static_cast<double>(row.points);
  return row;
}

ScanRow measure_open3d(const SampledCloud& cloud, const ScanBenchOptions& options,
                       const std::filesystem::path& work) {
  return measure_rival(
      "Open3D, 30 neighbours", cloud, options, work,
      [&](const std::string& points, const std::string& normals) {
        return run_python(options.python, work, kOpen3d, {points, normals}, "Open3D");
      });
}

/// PCL turns normals to one point of view, which tells no side of a closed surface.
ScanRow measure_pcl(const SampledCloud& cloud, const ScanBenchOptions& options,
                    const std::filesystem::path& work) {
  ScanRow row =
      measure_rival("PCL, 30 neighbours", cloud, options, work,
                    [&](const std::string& points, const std::string& normals) {
                      return run_rival({options.pcl.string(), points, normals}, work, "PCL");
                    });
  row.flipped = kNone;
  return row;
}

}  // namespace

SceneScans measure_scans(const SceneChoice& choice, const ScanBenchOptions& options,
                         const std::filesystem::path& work, const RunOptions& run,
                         Progress& progress) {
  const Mesh mesh = mesh_of(choice, options.points, run);
  const RayScene rays(mesh);
  SceneScans scene{.name = choice.name, .triangles = mesh.triangles.size(), .rows = {}};
  progress.begin(choice.name, options.noises.size(), "clouds");
  for (const double noise : options.noises) {
    const SampledCloud cloud = sample(rays, options.points, noise);
    std::vector<ScanRow> rows{measure_ptcx(cloud, options, work, run)};
    if (!options.python.empty()) rows.push_back(measure_open3d(cloud, options, work));
    if (!options.pcl.empty()) rows.push_back(measure_pcl(cloud, options, work));
    for (ScanRow& row : rows) {
      row.scene = choice.name;
      row.noise = noise;
      scene.rows.push_back(std::move(row));
    }
    progress.advance(1);
  }
  progress.end();
  return scene;
}

}  // namespace ptc::bench
