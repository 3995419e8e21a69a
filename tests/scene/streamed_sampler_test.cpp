// Meshes that do not fit in memory are sampled as well as those that do.
#include "engine/scene/sampling/streamed_sampler.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/parallel/thread_pool.h"
#include "tests/scene/coverage.h"
#include "tests/scene/meshes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

std::vector<Surfel> stream(const std::vector<Mesh>& meshes, const SamplingOptions& options,
                           std::uint64_t memory_bytes = StreamingRoom::kLeastBytes,
                           unsigned threads = 2, bool lamps = false) {
  const test::TemporaryDirectory dir;
  MeshParts parts;
  for (const Mesh& mesh : meshes) parts.add(std::make_shared<const Mesh>(mesh));
  const SurfaceSurvey found = survey(parts, 1000, lamps);
  const ThreadPool executor(threads);
  return drain(*sample_parts(parts, found, options,
                             {.memory_bytes = memory_bytes, .temp_dirs = {dir.path()}}, executor));
}

std::vector<Surfel> in_memory(const Mesh& mesh, const SamplingOptions& options) {
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  const ThreadPool executor(2);
  return drain(*sample_mesh(light, scene, options, executor));
}

/// A square of n x n quads that waves up and down.
Mesh terrain(int n) {
  Mesh mesh = empty_mesh();
  const float step = 1 / static_cast<float>(n);
  const auto height = [](float x, float z) { return 0.05F * std::sin(20 * x) * std::cos(15 * z); };
  const auto at = [&](int i, int k) {
    const float x = step * static_cast<float>(i), z = step * static_cast<float>(k);
    return glm::vec3(x, height(x, z), z);
  };
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n; ++k) {
      add_triangle(mesh, at(i, k), at(i, k + 1), at(i + 1, k + 1));
      add_triangle(mesh, at(i, k), at(i + 1, k + 1), at(i + 1, k));
    }
  }
  return mesh;
}

Mesh box() {
  Mesh mesh = empty_mesh();
  add_box(mesh, glm::vec3(-0.5F), glm::vec3(0.5F), false);
  return mesh;
}

struct Shape {
  const char* name;
  Mesh mesh;
};

std::vector<Shape> shapes() {
  return {{"terrain", terrain(150)}, {"fine sphere", sphere(1, 150)}, {"box", box()}};
}

double mean_radius(const std::vector<Surfel>& surfels) {
  double sum = 0;
  for (const Surfel& s : surfels) sum += static_cast<double>(s.radius);
  return sum / static_cast<double>(surfels.size());
}

bool same(const Surfel& a, const Surfel& b) {
  return a.position == b.position && a.normal == b.normal && a.radius == b.radius &&
         a.albedo == b.albedo && a.emission == b.emission;
}

}  // namespace

TEST_CASE("streamed sampler: surfels are as many, as large and as even as in memory",
          "[scene][streamed]") {
  SamplingOptions options;
  options.count = 20'000;  // several patches, whose seams would show
  for (const Shape& shape : shapes()) {
    const auto streamed = stream({shape.mesh}, options), usual = in_memory(shape.mesh, options);
    const double spacing = spacing_for(shape.mesh, options.count);
    const Coverage a = measure_coverage(shape.mesh, streamed, spacing, 20'000),
                   b = measure_coverage(shape.mesh, usual, spacing, 20'000);
    INFO(shape.name << ": nearest mean " << a.nearest_mean << ' ' << b.nearest_mean << " +- "
                    << a.nearest_deviation << ' ' << b.nearest_deviation << ", hole "
                    << a.largest_hole << ' ' << b.largest_hole << ", uncovered " << a.uncovered
                    << ' ' << b.uncovered);
    CHECK(static_cast<double>(streamed.size()) ==
          Approx(static_cast<double>(options.count)).epsilon(0.02));
    CHECK(covered_area(streamed) == Approx(one_sided_area(shape.mesh)).epsilon(1e-5));
    CHECK(mean_radius(streamed) == Approx(mean_radius(usual)).epsilon(0.03));
    CHECK(a.nearest_mean == Approx(b.nearest_mean).epsilon(0.01));
    CHECK(a.nearest_deviation < 1.05 * b.nearest_deviation);
    CHECK(a.largest_hole < 1.1);
    CHECK(a.uncovered < 1.3 * b.uncovered);  // 2.3 times as much on the sphere without the halo
  }
}

TEST_CASE(
    "streamed sampler: triangles far smaller than surfels are as good, though not all are read",
    "[scene][streamed]") {
  // 16 and 160 surfels a patch; what is near one has up to ten times its triangles
  const std::uint64_t count = GENERATE(300U, 3000U);
  SamplingOptions options;
  options.count = count;
  const Mesh mesh = terrain(400);
  const auto streamed = stream({mesh}, options), usual = in_memory(mesh, options);
  const double spacing = spacing_for(mesh, count);
  const Coverage a = measure_coverage(mesh, streamed, spacing, 20'000),
                 b = measure_coverage(mesh, usual, spacing, 20'000);
  INFO("nearest mean " << a.nearest_mean << ' ' << b.nearest_mean << ", hole " << a.largest_hole
                       << ' ' << b.largest_hole << ", uncovered " << a.uncovered << ' '
                       << b.uncovered);
  CHECK(static_cast<double>(streamed.size()) == Approx(static_cast<double>(count)).epsilon(0.02));
  CHECK(covered_area(streamed) == Approx(one_sided_area(mesh)).epsilon(0.01));
  CHECK(mean_radius(streamed) == Approx(mean_radius(usual)).epsilon(0.03));
  CHECK(a.nearest_mean == Approx(b.nearest_mean).epsilon(0.03));
  CHECK(a.largest_hole < 1.2);
  CHECK(a.uncovered <
        1.5 * b.uncovered);  // 1.35 times with all triangles: small patches have seams
}

TEST_CASE("streamed sampler: surfels do not depend on memory or threads", "[scene][streamed]") {
  SamplingOptions options;
  options.count = 30'000;
  const std::vector<Mesh> meshes{terrain(120), box()};
  const auto one = stream(meshes, options, StreamingRoom::kLeastBytes, 1);
  for (const unsigned threads : {1U, 3U}) {
    const auto other = stream(meshes, options, 8 * StreamingRoom::kLeastBytes, threads);
    CHECK(std::ranges::equal(one, other, same));
  }
}

TEST_CASE("streamed sampler: surfels have the colours of the vertices, beside a mesh without any",
          "[scene][streamed]") {
  Mesh coloured = terrain(40);
  for (const glm::vec3& p : coloured.positions) coloured.colours.emplace_back(p.x, p.z, 0.25F);
  coloured.materials[0].albedo = glm::vec3(0.8F);
  Mesh plain = ground(0.5F);
  plain.origin = {4, 0, 0};
  plain.materials[0].albedo = glm::vec3(0.3F);
  SamplingOptions options;
  options.count = 4000;
  std::size_t of_coloured = 0;
  for (const Surfel& s : stream({coloured, plain}, options)) {
    const bool is_plain = s.position.x > 2;
    of_coloured += is_plain ? 0 : 1;
    const glm::dvec3 expected =
        is_plain ? glm::dvec3(0.3) : 0.8 * glm::dvec3(s.position.x, s.position.z, 0.25);
    CHECK(glm::distance(glm::dvec3(s.albedo), expected) < 0.02);
  }
  CHECK(of_coloured > 1000);
}

TEST_CASE("streamed sampler: several meshes keep their origins, materials and attributes",
          "[scene][streamed]") {
  // A red square with normals at a far place, and a lamp with two sides
  Mesh red = ground(1);
  red.origin = {1e6, 0, 0};
  red.normals.assign(red.positions.size(), glm::vec3(0, 1, 0));
  red.materials[0].albedo = {0.8F, 0.1F, 0.1F};
  Mesh lamp = ground(0.5F);
  lamp.origin = {1e6, 2, 0};
  lamp.materials[0].emission = glm::vec3(3);
  lamp.materials[0].double_sided = true;
  SamplingOptions options;
  options.count = 3000;
  double of_red = 0, of_lamp = 0;
  for (const Surfel& s : stream({red, lamp}, options)) {
    const double area = 2 * static_cast<double>(s.radius) * static_cast<double>(s.radius);
    CHECK(std::abs(s.position.x - 1e6) < 1.1);
    CHECK(std::abs(s.normal.y) == Approx(1).epsilon(1e-6));
    if (s.position.y < 1) {
      of_red += area;
      CHECK(s.albedo == glm::vec3(0.8F, 0.1F, 0.1F));
      CHECK(s.emission == glm::vec3(0));
    } else {
      of_lamp += area;
      CHECK(s.emission.x == Approx(s.normal.y > 0 ? 3 / 1.02 : 0));
    }
  }
  CHECK(of_red == Approx(4).epsilon(1e-4));
  CHECK(of_lamp == Approx(2).epsilon(1e-4));
}

TEST_CASE("streamed sampler: a closed mesh has no surfels inside, an open or lit one has",
          "[scene][streamed]") {
  Mesh closed = box();
  closed.materials[0].double_sided = true;
  Mesh open = closed;
  open.triangles.pop_back();
  open.material_of.pop_back();
  Mesh turned = closed;
  for (auto& triangle : turned.triangles) std::swap(triangle[1], triangle[2]);
  Mesh lamp = ground(0.1F);
  lamp.materials[0].emission = glm::vec3(1);
  SamplingOptions options;
  options.count = 3000;
  const auto area = [&](const std::vector<Mesh>& meshes, bool lamps) {
    return covered_area(stream(meshes, options, StreamingRoom::kLeastBytes, 2, lamps));
  };
  CHECK(area({closed}, false) == Approx(6).epsilon(1e-4));
  CHECK(area({closed, open}, false) == Approx(6 + 11).epsilon(1e-4));
  CHECK(area({turned}, false) == Approx(12).epsilon(1e-4));
  CHECK(area({closed}, true) == Approx(12).epsilon(1e-4));
  CHECK(area({closed, lamp}, false) == Approx(12 + 0.04).epsilon(1e-4));
}

TEST_CASE("streamed sampler: patches too small for a surfel keep their area", "[scene][streamed]") {
  const Mesh mesh = terrain(200);  // 80,000 triangles, which make five patches at least
  for (const std::uint64_t count : {2U, 7U}) {
    SamplingOptions options;
    options.count = count;
    const auto surfels = stream({mesh}, options);
    CHECK(surfels.size() >= count - 1);
    CHECK(surfels.size() <= count + 1);
    CHECK(covered_area(surfels) == Approx(one_sided_area(mesh)).epsilon(0.25));
  }
}
