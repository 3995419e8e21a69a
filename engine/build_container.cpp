// Scene to container (engine/pipeline.h).
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/build/radius.h"
#include "engine/io/record.h"
#include "engine/pipeline.h"
#include "engine/scene/city.h"
#include "engine/stages.h"
#include "engine/store/writer.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr std::size_t kBlock = 1 << 14;           // surfels between source and sort
constexpr std::size_t kSampleKeys = 1 << 16;      // for the sort's splitters

std::array<double, 3> to_array(const glm::dvec3& p) { return {p.x, p.y, p.z}; }

/// The clouds of a request, checked and measured in a first pass.
struct Clouds {
  struct Cloud {
    std::filesystem::path path;
    std::uint64_t points = 0;
  };
  std::vector<Cloud> files;
  Bounds bounds;
  std::vector<glm::dvec3> sample;
  std::uint64_t points = 0;
  bool estimate_radii = false;

  void measure(const std::filesystem::path& path, Progress& progress) {
    PointFile file = open_points(path);
    if (!file.info.has_normals) {
      throw DataError(path.string() + ": the points have no normals (nx ny nz); estimate them first");
    }
    estimate_radii |= !file.info.has_radius;
    Cloud& cloud = files.emplace_back(Cloud{path});
    std::vector<Surfel> block(kBlock);
    while (const std::size_t count = file.source->next(block)) {
      for (std::size_t i = 0; i < count; ++i) bounds.add(block[i].position);
      for (std::size_t i = 0; i < count; i += 64) sample.push_back(block[i].position);
      thin(sample);
      cloud.points += count;
      progress.advance(count);
    }
    points += cloud.points;
  }

  /// Keeps an even share of the sample while it is larger than the sort needs.
  static void thin(std::vector<glm::dvec3>& sample) {
    if (sample.size() < 2 * kSampleKeys) return;
    for (std::size_t i = 0; i < sample.size() / 2; ++i) sample[i] = sample[2 * i];
    sample.resize(sample.size() / 2);
  }
};

/// Points spread over a mesh by area, for splitters.
std::vector<glm::dvec3> sample_triangles(const Mesh& mesh) {
  const auto area = [&](const std::array<std::uint32_t, 3>& t) {
    const glm::vec3& a = mesh.positions[t[0]];
    return glm::length(glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a));
  };
  double total = 0;
  for (const auto& t : mesh.triangles) total += static_cast<double>(area(t));
  const double step = total / static_cast<double>(kSampleKeys);
  std::vector<glm::dvec3> sample;
  double due = 0;
  double golden = 0;  // where in the triangle: the golden ratio spreads them
  for (const auto& t : mesh.triangles) {
    for (due += static_cast<double>(area(t)); due > 0 && step > 0; due -= step) {
      golden = std::fmod(golden + 0.618033988749895, 1.0);
      const glm::dvec3 a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
      sample.push_back(mesh.origin + a + std::sqrt(golden) * 0.5 * ((b - a) + (c - a)));
    }
  }
  return sample;
}

/// Points spread over the ground of the city.
std::vector<glm::dvec3> sample_ground(const Bounds& bounds) {
  const glm::dvec3 extent = bounds.high - bounds.low;
  const int up = extent.x < extent.y ? (extent.x < extent.z ? 0 : 2) : (extent.y < extent.z ? 1 : 2);
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

/// Moves everything a source gives into the sort. @return how many points
std::uint64_t feed(PointSource& source, const Frame& frame, ExternalSorter& sorter, const Executor& executor,
          Progress& progress) {
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

/// Coloured clouds without radiance glow as they were photographed.
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

/// The meshes of a request under rays and light; gone before the sort needs its memory.
struct LitMesh {
  LitMesh(Mesh m, const LightRig& lights) : mesh(std::move(m)), rays(mesh), light(rays, lights) {}

  Mesh mesh;
  RayScene rays;
  DirectLight light;
};

/// What a build is made from, and what the sort must know of it beforehand.
struct Inputs {
  Bounds bounds;
  std::vector<glm::dvec3> sample;  // places, for splitters
  Clouds clouds;
  LightRig lights;
  bool emitters = false;         // among the triangles
  std::unique_ptr<LitMesh> lit;  // null without triangles
};

Inputs lay_city(std::uint64_t points) {
  const Bounds bounds = city_bounds(points);
  return {.bounds = bounds, .sample = sample_ground(bounds), .lights = city_lights()};
}

bool has_emitters(const Mesh& mesh) {
  return std::ranges::any_of(mesh.materials, [](const Material& m) { return m.emission != glm::vec3(0); });
}

Inputs read_inputs(const BuildRequest& request, Progress& progress) {
  Inputs inputs;
  for (const auto& input : request.inputs) {
    if (is_point_file(input)) inputs.clouds.measure(input, progress);
  }
  inputs.bounds.add(inputs.clouds.bounds);
  inputs.sample = std::move(inputs.clouds.sample);
  Mesh mesh = load_meshes(request.inputs, request.mesh.get(), request.backdrop);
  if (request.lights) inputs.lights = *request.lights;
  if (mesh.triangles.empty()) return inputs;
  inputs.emitters = has_emitters(mesh);
  if (!request.lights && !inputs.emitters) inputs.lights = default_rig();
  inputs.bounds.add(mesh.bounds());
  const std::vector<glm::dvec3> on_mesh = sample_triangles(mesh);
  inputs.sample.insert(inputs.sample.end(), on_mesh.begin(), on_mesh.end());
  inputs.lit = std::make_unique<LitMesh>(std::move(mesh), inputs.lights);
  return_freed_memory();  // what reading the file and building the tree took
  return inputs;
}

std::vector<MortonKey> keys_of(const std::vector<glm::dvec3>& places, const Frame& frame) {
  std::vector<MortonKey> keys;
  keys.reserve(places.size());
  for (const glm::dvec3& p : places) keys.push_back(encode_morton(frame.to_lattice(to_array(p))));
  return keys;
}

Meta make_meta(const BuildRequest& request, const Inputs& inputs, double spacing) {
  Meta meta;
  std::string names;
  for (const auto& input : request.inputs) {
    if (!names.empty()) names += ' ';
    names += input.filename().string();
  }
  if (request.city_points > 0) names = "city " + std::to_string(request.city_points);
  meta.text[kInputsKey] = names;
  meta.text[kLightsKey] = to_json(inputs.lights);
  if (inputs.emitters && request.sampling.lights.area_rays > 0) meta.text[kEmittersKey] = "baked";
  if (is_rounded(request.profile)) meta.text[kRoundingKey] = kRounding;
  if (spacing > 0) meta.text[kSpacingKey] = fmt::format("{}", spacing);
  if (request.sampling.camera) meta.text[kCameraKey] = to_json(*request.sampling.camera);
  return meta;
}

/// Equal points, settings and record give an equal file, so its name in the world is made of them.
Uuid content_uuid(const ExternalSorter& sorter, const Frame& frame, const BuildRequest& request, const Meta& meta) {
  std::string text = fmt::format("{:x} {:x} {} {} {} {} {} {} {} {}", sorter.digest()[0], sorter.digest()[1],
                                 frame.origin[0], frame.origin[1], frame.origin[2], frame.edge,
                                 request.tree.leaf_points, request.tree.levels_per_stream, request.page_shift,
                                 static_cast<int>(request.profile));
  for (const auto& [key, value] : meta.text) text.append("\n").append(key).append("=").append(value);
  const std::array<std::uint64_t, 2> hash = xxh3_128(std::as_bytes(std::span(text)));
  Uuid uuid;
  std::memcpy(uuid.data(), hash.data(), uuid.size());
  return uuid;
}

}  // namespace

BuildReport build_container(const BuildRequest& request, const std::filesystem::path& target, Progress& progress) {
  BuildReport report;
  const Executor executor(request.run.threads);
  Inputs inputs;
  if (request.city_points > 0) {
    inputs = lay_city(request.city_points);
  } else {
    const Stage stage(report.seconds, progress, "read", 0, "points");
    inputs = read_inputs(request, progress);
  }
  if (inputs.bounds.empty()) throw DataError("the input has no points and no triangles");
  const Frame frame = frame_around(to_array(inputs.bounds.low), to_array(inputs.bounds.high));

  std::uint64_t taken = kBufferBytes;
  if (request.mesh) taken += mesh_bytes(*request.mesh, nullptr);
  if (const LitMesh* lit = inputs.lit.get()) {
    taken += mesh_bytes(lit->mesh, &lit->rays) +
             sampling_bytes(lit->mesh.triangles.size(), request.sampling.count, executor.threads());
  }
  const std::uint64_t sort_bytes = memory_left(request.run, taken, kLeastSort, "this scene's build");
  const std::uint64_t known = request.city_points + inputs.clouds.points;
  // A given spacing does not say how many points it makes of a mesh.
  const bool by_spacing = inputs.lit && request.sampling.spacing > 0;
  const std::uint64_t expected = by_spacing ? 0 : known + (inputs.lit ? request.sampling.count : 0);
  ExternalSorter sorter({.memory_bytes = sort_bytes, .temp_dirs = temp_dirs(request.run, target), .expected = expected},
                        executor, keys_of(inputs.sample, frame));
  report.space = require_build_space(expected, sorter.expected_spill(), request.profile, temp_dirs(request.run, target), target);
  if (sorter.expected_spill() > 0) progress.note(space_text(report.space, temp_dirs(request.run, target), target));
  double spacing = 0;
  {
    const Stage stage(report.seconds, progress, inputs.lit ? "sample and light" : "partition", known, "points");
    if (request.city_points > 0) feed(*make_city(request.city_points), frame, sorter, executor, progress);
    for (const auto& [path, points] : inputs.clouds.files) {
      if (feed(*open_lit(path), frame, sorter, executor, progress) == points) continue;
      throw DataError(path.string() + ": the file changed while it was read");
    }
    if (const LitMesh* lit = inputs.lit.get()) {
      spacing = request.sampling.spacing > 0 ? request.sampling.spacing
                                             : spacing_for(lit->mesh, request.sampling.count);
      feed(*sample_mesh(lit->light, lit->rays, request.sampling, executor), frame, sorter, executor, progress);
    }
    inputs.lit.reset();
  }

  const Stage stage(report.seconds, progress, "sort and build", sorter.statistics().points, "points");
  const Meta meta = make_meta(request, inputs, spacing);
  ContainerWriter writer(target, {.page_shift = request.page_shift,
                                  .codec = codec_of(request.profile),
                                  .uuid = content_uuid(sorter, frame, request, meta),
                                  .frame = frame});
  std::unique_ptr<PointStream> sorted = sorter.finish();
  std::unique_ptr<PointStream> with_radii, rounded;
  PointStream* points = sorted.get();
  if (inputs.clouds.estimate_radii) {
    with_radii = estimate_radii(*points, frame.unit());
    points = with_radii.get();
  }
  if (is_rounded(request.profile)) {
    rounded = round_points(*points, frame.unit(), executor);
    points = rounded.get();
  }
  const Superblock superblock = build_pages(*points, writer, request.tree, executor, progress);
  report.superblock = writer.finish(meta, superblock);
  report.sort = sorter.statistics();
  return report;
}

}  // namespace ptc
