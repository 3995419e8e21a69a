// Two passes over the inputs of a build.
//
//   read_inputs()   files --> bounds, about 2^16 sample positions, meshes in memory
//   feed_inputs()   files, meshes, city --> blocks of 2^14 surfels --> records --> sort
//
// Clouds are read twice, so that their points never have to fit in memory. The second pass counts
// them again: a file that changed in between is an error.
#include "engine/pipeline/build/build_inputs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/io/cloud/points.h"
#include "engine/io/cloud/record.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/run.h"
#include "engine/scene/procedural/city.h"

namespace ptc {
namespace {

constexpr std::size_t kBlock = 1 << 14;       // surfels read from a source at once
constexpr std::size_t kSampleKeys = 1 << 16;  // positions that the sort's splitters need

/// Drops every second position of a sample that is twice as large as the sort needs.
void thin(std::vector<glm::dvec3>& sample) {
  if (sample.size() < 2 * kSampleKeys) return;
  for (std::size_t i = 0; i < sample.size() / 2; ++i) sample[i] = sample[2 * i];
  sample.resize(sample.size() / 2);
}

/// Returns about kSampleKeys positions that are spread over a mesh by area, in scene units.
std::vector<glm::dvec3> sample_triangles(const Mesh& mesh) {
  const auto area = [&](const std::array<std::uint32_t, 3>& t) {
    const glm::vec3& a = mesh.positions[t[0]];
    return glm::length(glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a));
  };
  double total = 0;
  for (const auto& t : mesh.triangles) total += static_cast<double>(area(t));
  const double step = total / static_cast<double>(kSampleKeys);
  std::vector<glm::dvec3> sample;
  double due = 0;     // area that was passed and has no position yet
  double golden = 0;  // place in the triangle; multiples of the golden ratio spread evenly
  for (const auto& t : mesh.triangles) {
    for (due += static_cast<double>(area(t)); due > 0 && step > 0; due -= step) {
      golden = std::fmod(golden + 0.618033988749895, 1.0);
      const glm::dvec3 a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
      sample.push_back(mesh.origin + a + std::sqrt(golden) * 0.5 * ((b - a) + (c - a)));
    }
  }
  return sample;
}

/// Returns a grid of 256 x 256 positions on the ground of the city, in scene units.
std::vector<glm::dvec3> sample_ground(const Bounds& bounds) {
  const glm::dvec3 extent = bounds.high - bounds.low;
  const int up =
      extent.x < extent.y ? (extent.x < extent.z ? 0 : 2) : (extent.y < extent.z ? 1 : 2);
  std::vector<glm::dvec3> sample;
  for (int j = 0; j < 256; ++j) {
    for (int i = 0; i < 256; ++i) {
      glm::dvec3 p = bounds.low;
      p[(up + 1) % 3] += extent[(up + 1) % 3] * (i + 0.5) / 256;
      p[(up + 2) % 3] += extent[(up + 2) % 3] * (j + 0.5) / 256;
      sample.push_back(p);
    }
  }
  return sample;
}

/// Feeds all points of a source to the sort. @return the number of points
std::uint64_t feed(PointSource& source, const Frame& frame, ExternalSorter& sorter,
                   const Executor& executor, Progress& progress) {
  std::vector<Surfel> surfels(kBlock);
  std::vector<PointRecord> records(kBlock);
  std::uint64_t points = 0;
  while (const std::size_t count = source.next(surfels)) {
    executor.for_ranges(count, 1 << 11, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) records[i] = to_record(surfels[i], frame);
    });
    sorter.add(std::span(records).first(count));
    points += count;
    progress.advance(count);
  }
  return points;
}

/// A source that takes a point's colour as its radiance: a cloud with colours and without radiance
/// was photographed as it glows.
class Photographed : public PointSource {
 public:
  explicit Photographed(std::unique_ptr<PointSource> source) : source_(std::move(source)) {}
  std::size_t next(std::span<Surfel> out) override {
    const std::size_t count = source_->next(out);
    for (Surfel& s : out.first(count)) s.radiance = s.albedo;
    return count;
  }

 private:
  std::unique_ptr<PointSource> source_;
};

std::unique_ptr<PointSource> open_lit(const std::filesystem::path& path) {
  PointFile file = open_points(path);
  if (file.info.has_radiance || !file.info.has_albedo) return std::move(file.source);
  return std::make_unique<Photographed>(std::move(file.source));
}

BuildInputs lay_city(std::uint64_t points) {
  const Bounds bounds = city_bounds(points);
  return {.bounds = bounds, .sample = sample_ground(bounds), .lights = city_lights()};
}

bool has_emitters(const Mesh& mesh) {
  return std::ranges::any_of(mesh.materials,
                             [](const Material& m) { return m.emission != glm::vec3(0); });
}

BuildInputs read_files(const BuildRequest& request, Progress& progress) {
  BuildInputs inputs;
  for (const auto& input : request.inputs) {
    if (is_point_file(input)) inputs.clouds.measure(input, progress);
  }
  inputs.bounds.add(inputs.clouds.bounds);
  inputs.sample = std::move(inputs.clouds.sample);
  Mesh mesh = load_meshes(request.inputs, request.mesh.get(), request.backdrop, progress);
  if (request.lights) inputs.lights = *request.lights;
  if (mesh.triangles.empty()) return inputs;
  inputs.emitters = has_emitters(mesh);
  if (!request.lights && !inputs.emitters) inputs.lights = default_rig();
  inputs.bounds.add(mesh.bounds());
  const std::vector<glm::dvec3> on_mesh = sample_triangles(mesh);
  inputs.sample.insert(inputs.sample.end(), on_mesh.begin(), on_mesh.end());
  inputs.lit = std::make_unique<LitMesh>(std::move(mesh), inputs.lights);
  return_freed_memory();  // that reading the files and building the ray scene took
  return inputs;
}

}  // namespace

void Clouds::measure(const std::filesystem::path& path, Progress& progress) {
  PointFile file = open_points(path);
  if (!file.info.has_normals) {
    throw DataError(path.string() + ": the points have no normals (nx ny nz); estimate them first");
  }
  estimate_radii |= !file.info.has_radius;
  Cloud& cloud = files.emplace_back(Cloud{path});
  std::vector<Surfel> block(kBlock);
  while (const std::size_t count = file.source->next(block)) {
    for (std::size_t i = 0; i < count; ++i) bounds.add(block[i].position);
    emits |= std::any_of(block.begin(), block.begin() + static_cast<std::ptrdiff_t>(count),
                         [](const Surfel& s) { return s.emission != glm::vec3(0); });
    for (std::size_t i = 0; i < count; i += 64) sample.push_back(block[i].position);
    thin(sample);
    cloud.points += count;
    progress.advance(count);
  }
  points += cloud.points;
}

BuildInputs read_inputs(const BuildRequest& request, StageSeconds& seconds, Progress& progress) {
  if (request.city_points > 0) return lay_city(request.city_points);
  const Stage stage(seconds, progress, "read", 0, "points");
  return read_files(request, progress);
}

double feed_inputs(BuildInputs& inputs, const BuildRequest& request, const Frame& frame,
                   ExternalSorter& sorter, const Executor& executor, Progress& progress) {
  if (request.city_points > 0)
    feed(*make_city(request.city_points), frame, sorter, executor, progress);
  for (const auto& [path, points] : inputs.clouds.files) {
    if (feed(*open_lit(path), frame, sorter, executor, progress) == points) continue;
    throw DataError(path.string() + ": the file changed while it was read");
  }
  double spacing = 0;
  if (const LitMesh* lit = inputs.lit.get()) {
    spacing = request.sampling.spacing > 0 ? request.sampling.spacing
                                           : spacing_for(lit->mesh, request.sampling.count);
    feed(*sample_mesh(lit->light, lit->rays, request.sampling, executor), frame, sorter, executor,
         progress);
  }
  inputs.lit.reset();
  return spacing;
}

}  // namespace ptc
