// From a mesh to the errors of occlusion:
//
//   mesh --> points --> .ply without normals --> build --> shade --> occlusion of each point
//     `----> where each point was drawn ------> rays -------------> true occlusion
#include "tools/bench/experiments/specks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/convert/container_source.h"
#include "engine/pipeline/render/primary.h"
#include "engine/scene/mesh_reference.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/sampled_cloud.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

constexpr double kSpeck = 0.3;  // difference of occlusion that an eye takes for a fault

/// A kind of cloud.
struct Kind {
  const char* name;
  SampleOptions options;
};

std::vector<Kind> kinds(std::uint64_t points) {
  return {{"clean", {.points = points}},
          {"noise of half a spacing", {.points = points, .noise = 0.5}},
          {"density 10 to 1", {.points = points, .ratio = 10}},
          {"200 holes", {.points = points, .holes = 200}}};
}

void write_cloud(const std::vector<SampledPoint>& points, const std::filesystem::path& path) {
  PointWriteInfo info{.count = points.size()};
  std::vector<Surfel> surfels;
  for (const SampledPoint& point : points) {
    info.bounds.add(point.position);
    surfels.push_back({.position = point.position});
  }
  const auto writer = create_points(path, OutputFormat::ply, info);
  writer->write(surfels, {});
  writer->finish();
}

RowPlace place_of(std::span<const Channel> channels, const char* name) {
  if (const auto found = find_in_row(channels, name)) return *found;
  throw DataError(std::string("specks: the shaded points have no channel ") + name);
}

/// Returns the occlusion of all points, in the order in which they were drawn.
std::vector<float> occlusions(const std::filesystem::path& shaded) {
  const ContainerReader container(shaded);
  ContainerSource points(container);
  const RowPlace index = place_of(points.channels(), kOriginalIndex);
  const RowPlace occlusion = place_of(points.channels(), "occlusion");
  std::vector<float> found(container.superblock().points);
  std::vector<Surfel> block(1 << 13);
  while (const std::size_t count = points.next(block)) {
    const std::span<const std::byte> rows = points.attributes();
    const std::size_t bytes = rows.size() / count;
    for (std::size_t i = 0; i < count; ++i) {
      const std::byte* const row = rows.data() + i * bytes;
      found[static_cast<std::size_t>(load_integer(index.channel->type, row + index.offset))] =
          static_cast<float>(load_number(row + occlusion.offset, occlusion.channel->type));
    }
  }
  return found;
}

/// The pixels of two pictures of the same place: of the points, and of the mesh.
class PicturePair {
 public:
  PicturePair(const ContainerReader& scene, const RayScene& mesh, const Camera& camera, float lift,
              const Executor& executor)
      : width_(camera.width), height_(camera.height), no_light_(mesh, {}) {
    Progress silent;
    const auto points = view_surfels(scene, camera, {.lift = lift}, executor, silent);
    const auto truth = view_mesh(mesh, no_light_, {0, 0, 0}, camera, 1, 0);
    for (unsigned y = 0; y < height_; ++y) {
      for (unsigned x = 0; x < width_; ++x) {
        points_.push_back(points->at(x, y));
        truth_.push_back(truth->at(x, y));
      }
    }
  }

  /// Returns the share of pixels inside the silhouette that see past the surface.
  /// @param slack  distance behind the mesh from which on it is another surface
  [[nodiscard]] double holes(const glm::dvec3& eye, double slack) const {
    std::size_t inside = 0, holes = 0;
    for (unsigned y = 1; y + 1 < height_; ++y) {
      for (unsigned x = 1; x + 1 < width_; ++x) {
        if (!is_inside(x, y)) continue;
        ++inside;
        const std::size_t at = std::size_t{y} * width_ + x;
        const bool past = !points_[at] || glm::distance(eye, points_[at]->position) >
                                              glm::distance(eye, truth_[at]->position) + slack;
        if (past) ++holes;
      }
    }
    return inside == 0 ? 0 : static_cast<double>(holes) / static_cast<double>(inside);
  }

  /// Returns the RMS difference of occlusion between both, at up to `most` pixels.
  [[nodiscard]] double rms(const ContainerReader& scene, const RayScene& mesh, std::size_t most,
                           unsigned rays, const GatherOptions& gather,
                           const Executor& executor) const {
    std::vector<std::size_t> pixels;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (points_[i] && truth_[i]) pixels.push_back(i);
    }
    if (pixels.empty()) return 0;
    const std::size_t step = pixels.size() / most + 1;
    std::vector<Receiver> receivers;
    std::vector<std::size_t> chosen;
    for (std::size_t k = 0; k < pixels.size(); k += step) {
      const PrimaryHit& hit = *points_[pixels[k]];
      receivers.push_back({hit.position + glm::dvec3(hit.offset_normal * hit.lift), hit.normal});
      chosen.push_back(pixels[k]);
    }
    std::vector<Shading> found(receivers.size());
    ShadeOptions options;
    options.gather = gather;
    Progress silent;
    Shader(scene, options, executor).shade(receivers, found, silent);
    std::vector<double> squares(chosen.size());
    executor.for_each(chosen.size(), [&](std::size_t i, unsigned) {
      const PrimaryHit& truth = *truth_[chosen[i]];
      const RayTraced traced =
          trace_mesh(mesh, no_light_, truth.position, truth.offset_normal, rays, {.bounces = 0}, i);
      const double off =
          static_cast<double>(found[i].occlusion) - static_cast<double>(traced.occlusion);
      squares[i] = off * off;
    });
    return std::sqrt(std::reduce(squares.begin(), squares.end()) /
                     static_cast<double>(squares.size()));
  }

 private:
  /// Says whether the mesh covers a pixel and all that touch it.
  [[nodiscard]] bool is_inside(unsigned x, unsigned y) const {
    for (unsigned v = y - 1; v <= y + 1; ++v) {
      for (unsigned u = x - 1; u <= x + 1; ++u) {
        if (!truth_[std::size_t{v} * width_ + u]) return false;
      }
    }
    return true;
  }

  unsigned width_, height_;
  DirectLight no_light_;
  std::vector<std::optional<PrimaryHit>> points_, truth_;
};

/// Compares pictures of a built cloud with pictures of its mesh.
void judge_pictures(const ContainerReader& scene, const RayScene& mesh, double spacing,
                    const SpecksOptions& options, const Executor& executor, SpecksRow& row) {
  constexpr unsigned kWidth = 480, kHeight = 270;
  for (const float zoom : {1.0F, 4.0F}) {
    Camera camera = default_camera(scene, {}, {}, std::array{kWidth, kHeight});
    camera.vertical_fov /= zoom;
    const PicturePair pair(scene, mesh, camera, options.lift, executor);
    row.holes = std::max(row.holes, pair.holes(camera.position, 4 * spacing));
    row.picture_rms = std::max(
        row.picture_rms,
        pair.rms(scene, mesh, options.checked, options.rays / 4, options.gather, executor));
  }
}

/// Builds and shades a cloud, and compares pictures of it. @return the occlusion of all points
std::vector<float> shade(const std::vector<SampledPoint>& points, const SpecksOptions& options,
                         const std::filesystem::path& work, const RunOptions& run,
                         const RayScene& rays, const Executor& executor, SpecksRow& row) {
  const WorkFile cloud(work, ".ply"), built(work, "-built.ptcx"), lit(work, "-lit.ptcx");
  write_cloud(points, cloud.path());
  Progress silent;
  BuildRequest build{.inputs = {cloud.path()}, .original_order = true, .run = run};
  const double per_point = 1e6 / static_cast<double>(points.size());
  row.build_us = per_point * timed([&] { build_container(build, built.path(), silent); }).wall;
  ShadeRequest request;
  request.scene = built.path();
  request.gather = options.gather;
  request.lift = options.lift;
  request.run = run;
  row.shade_us = per_point * timed([&] { shade_container(request, lit.path(), silent); }).wall;
  const double spacing = std::sqrt(area_of(rays.mesh()) / static_cast<double>(points.size()));
  judge_pictures(ContainerReader(built.path()), rays, spacing, options, executor, row);
  return occlusions(lit.path());
}

/// Compares a sample of the points with rays at the mesh.
void judge(const std::vector<SampledPoint>& points, const std::vector<float>& found,
           const RayScene& rays, const SpecksOptions& options, const Executor& executor,
           SpecksRow& row) {
  const DirectLight no_light(rays, {});
  row.points = points.size();
  row.checked = std::min<std::uint64_t>(options.checked, points.size());
  std::vector<double> differences(row.checked);
  executor.for_each(row.checked, [&](std::size_t i, unsigned) {
    const std::size_t k = i * points.size() / row.checked;
    const RayTraced truth = trace_mesh(rays, no_light, points[k].origin, points[k].normal,
                                       options.rays, {.bounces = 0}, i);
    differences[i] = static_cast<double>(found[k]) - static_cast<double>(truth.occlusion);
  });
  double squares = 0;
  std::uint64_t specks = 0;
  for (const double difference : differences) {
    squares += difference * difference;
    if (std::abs(difference) > kSpeck) ++specks;
  }
  const auto count = static_cast<double>(row.checked);
  row.rms = std::sqrt(squares / count);
  row.mean = std::reduce(differences.begin(), differences.end()) / count;
  row.specks = static_cast<double>(specks) / count;
}

}  // namespace

std::vector<SpecksRow> measure_specks(const SceneChoice& choice, const SpecksOptions& options,
                                      const std::filesystem::path& work, const RunOptions& run,
                                      Progress& progress) {
  const Mesh mesh = mesh_of(choice, options.points, run);
  const RayScene rays(mesh);
  const ThreadPool executor(run.threads);
  std::vector<SpecksRow> rows;
  const std::vector<Kind> clouds = kinds(options.points);
  progress.begin(choice.name, clouds.size(), "clouds");
  for (const Kind& kind : clouds) {
    SpecksRow& row = rows.emplace_back();
    row.scene = choice.name;
    row.cloud = kind.name;
    const std::vector<SampledPoint> points = sample_at_random(rays, kind.options);
    judge(points, shade(points, options, work, run, rays, executor, row), rays, options, executor,
          row);
    progress.advance(1);
  }
  progress.end();
  return rows;
}

}  // namespace ptc::bench
