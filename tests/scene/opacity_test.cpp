// Materials that light passes through: rays, surfels, lamps and the sky seen through them.
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/emitters.h"
#include "engine/scene/ray_scene.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/scene/sampling/solids.h"
#include "engine/scene/sampling/streamed_sampler.h"
#include "tests/scene/coverage.h"
#include "tests/scene/meshes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

// A square from (0, 0) to (1, 1) in x and z at y = 0 that faces up, with a texture of opacity that
// is 0 for x below 1/2 and 1 beyond.
Mesh half_clear() {
  Mesh mesh = empty_mesh();
  add_quad(mesh, {0, 0, 0}, {0, 0, 1}, {1, 0, 0});
  for (const glm::vec3& p : mesh.positions) mesh.uvs.emplace_back(p.x, p.z);
  Image image{64, 1, std::vector<glm::vec3>(64, glm::vec3(0))};
  for (std::size_t i = 32; i < 64; ++i) image.pixels[i] = glm::vec3(1);
  mesh.materials[0].opacity_texture = std::make_shared<const Texture>(std::move(image));
  mesh.materials[0].wrap = {Wrap::clamp, Wrap::clamp};
  return mesh;
}

// A large square at y = 1 that stops a share of the light.
Mesh pane(float opacity) {
  Mesh mesh = empty_mesh();
  mesh.materials[0].opacity = opacity;
  add_quad(mesh, {-50, 1, -50}, {0, 0, 100}, {100, 0, 0});
  return mesh;
}

std::vector<Surfel> in_memory(const Mesh& mesh, std::uint64_t count) {
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  const ThreadPool executor(2);
  SamplingOptions options;
  options.count = count;
  return drain(*sample_mesh(light, scene, options, executor));
}

std::vector<Surfel> streamed(const Mesh& mesh, std::uint64_t count) {
  const test::TemporaryDirectory dir;
  MeshParts parts;
  parts.add(std::make_shared<const Mesh>(mesh));
  const SurfaceSurvey found = survey(parts, 1000, false);
  const ThreadPool executor(2);
  SamplingOptions options;
  options.count = count;
  const StreamingRoom room{.memory_bytes = StreamingRoom::kLeastBytes, .temp_dirs = {dir.path()}};
  return drain(*sample_parts(parts, found, options, room, executor));
}

}  // namespace

TEST_CASE("opacity: rays meet a texture where it is opaque, or where it reaches the cutoff",
          "[scene][opacity]") {
  Mesh mesh = half_clear();
  for (const float cutoff : {0.0F, 0.25F, 0.75F}) {
    mesh.materials[0].opacity_cutoff = cutoff;
    const RayScene scene(mesh);
    CHECK_FALSE(scene.is_plain(0));
    Random random(1);
    for (int i = 0; i < 2000; ++i) {
      const glm::dvec3 from(random.unit(), 1, random.unit());
      // Between the last clear texel and the first opaque one, opacity rises from 0 to 1
      const double rise = 64 * (from.x - 0.5) + 0.5;
      if (std::abs(rise - (cutoff > 0 ? double{cutoff} : 0.5)) < (cutoff > 0 ? 1e-3 : 0.5))
        continue;
      const bool meets = cutoff > 0 ? rise > double{cutoff} : rise > 0.5;
      REQUIRE(scene.occluded(from, {0, -1, 0}, 0, kFar) == meets);
      REQUIRE(scene.closest(from, {0, -1, 0}, 0, kFar).has_value() == meets);
    }
    CHECK(scene.surface(0, 0.999F, 0).opacity == scene.surface(1, 0.001F, 0).opacity);
  }
  // A ray goes on to what lies behind
  add_quad(mesh, {-9, -1, -9}, {0, 0, 18}, {18, 0, 0});
  mesh.uvs.resize(mesh.positions.size(), glm::vec2(1));
  const RayScene scene(mesh);
  const auto hit = scene.closest({0.25, 1, 0.5}, {0, -1, 0}, 0, kFar);
  REQUIRE(hit);
  CHECK(hit->distance == Approx(2));
  CHECK(scene.closest({0.75, 1, 0.5}, {0, -1, 0}, 0, kFar)->distance == Approx(1));
}

TEST_CASE("opacity: its share of rays is stopped, each ray alike at every time",
          "[scene][opacity]") {
  for (const float opacity : {0.0F, 0.25F, 0.8F, 1.0F}) {
    Mesh mesh = pane(opacity);
    add_quad(mesh, {-50, 2, -50}, {0, 0, 100}, {100, 0, 0});
    const RayScene scene(mesh);
    Random random(2);
    int near = 0, far = 0;
    constexpr int kRays = 16'000;
    for (int i = 0; i < kRays / 16; ++i) {
      const glm::dvec3 from = 0.5 * random.in_box(-1, 1);
      std::vector<glm::vec3> directions;
      for (int k = 0; k < 16; ++k)
        directions.push_back(glm::normalize(random.direction() + glm::vec3(0, 1.5F, 0)));
      const std::uint32_t hidden = scene.occluded(from, directions, 0, kFar);
      for (std::size_t k = 0; k < 16; ++k) {
        const auto hit = scene.closest(from, directions[k], 0, kFar);
        const bool stops = (hidden >> k & 1) != 0;
        REQUIRE(stops == hit.has_value());
        REQUIRE(stops == scene.occluded(from, directions[k], 0, kFar));
        if (hit && directions[k].y > 0) (hit->position.y < 1.5 ? near : far) += 1;
      }
    }
    // The directions reach both panes but for about one in 10,000
    const double a = static_cast<double>(opacity);
    CHECK(near / double{kRays} == Approx(a).margin(0.015));
    CHECK(far / double{kRays} == Approx(a * (1 - a)).margin(0.015));
  }
}

TEST_CASE("opacity: surfels lie where the surface is, and have its area", "[scene][opacity]") {
  for (const bool spilled : {false, true}) {
    const auto sample = [&](const Mesh& mesh, std::uint64_t count) {
      return spilled ? streamed(mesh, count) : in_memory(mesh, count);
    };
    Mesh mesh = half_clear();
    for (const bool both : {false, true}) {
      mesh.materials[0].double_sided = both;
      const auto surfels = sample(mesh, 4000);
      CHECK(static_cast<double>(surfels.size()) == Approx(4000).epsilon(0.03));
      CHECK(covered_area(surfels) == Approx(both ? 1 : 0.5).epsilon(0.02));
      for (const Surfel& s : surfels) REQUIRE(s.position.x > 0.48);
    }
    mesh = pane(0.25F);
    const auto surfels = sample(mesh, 4000);
    CHECK(static_cast<double>(surfels.size()) == Approx(4000).epsilon(0.03));
    CHECK(covered_area(surfels) == Approx(0.625 * 2500).epsilon(0.01));
    CHECK(sample(pane(0), 4000).empty());
  }
}

TEST_CASE("opacity: what light passes through is no solid", "[scene][opacity]") {
  Mesh mesh = empty_mesh();
  mesh.materials[0].double_sided = true;
  add_box(mesh, glm::vec3(-1), glm::vec3(1), false);
  CHECK(find_solids(mesh).count == 1);
  mesh.materials[0].opacity = 0.5F;
  CHECK(find_solids(mesh).count == 0);
  // Inside and outside have surfels, also when the mesh streams
  for (const auto& surfels : {in_memory(mesh, 3000), streamed(mesh, 3000)}) {
    CHECK(covered_area(surfels) == Approx(0.626 * 24).epsilon(0.02));
    CHECK(static_cast<double>(surfels.size()) == Approx(3000).epsilon(0.03));
  }
}

TEST_CASE("opacity: a pane lets its share of the sky through", "[scene][opacity]") {
  LightRig rig;
  rig.sky.radiance = glm::vec3(1);
  for (const float opacity : {0.0F, 0.3F, 1.0F}) {
    const Mesh mesh = pane(opacity);
    const RayScene scene(mesh);
    const DirectLight light(scene, rig);
    double mean = 0;
    for (std::uint64_t seed = 0; seed < 200; ++seed)
      mean += static_cast<double>(light.irradiance({0, 0, 0}, {0, 1, 0}, {}, seed).sky.x) / 200;
    CHECK(mean / kPiDouble == Approx(1 - static_cast<double>(opacity)).margin(0.02));
  }
}

TEST_CASE("opacity: a lamp emits where it is opaque", "[scene][opacity]") {
  const auto power = [](const Mesh& mesh) {
    glm::dvec3 sum(0);
    for (const Emitter& e : emitters_of(mesh)) {
      const auto& [a, b, c] = e.corner;
      sum += 0.5 * glm::length(glm::cross(glm::dvec3(b - a), glm::dvec3(c - a))) *
             glm::dvec3(e.radiance);
    }
    return sum;
  };
  Mesh mesh = half_clear();
  mesh.materials[0].emission = {4, 2, 1};
  CHECK(power(mesh).x == Approx(2).epsilon(0.01));
  CHECK(power(mesh).z == Approx(0.5).epsilon(0.01));
  mesh.materials[0].opacity = 0.5F;
  CHECK(power(mesh).x == Approx(1).epsilon(0.01));
  mesh.materials[0].opacity_texture = nullptr;
  CHECK(power(mesh).x == Approx(2).epsilon(1e-5));
  // Its surfels are smaller than that, because they overlap less (spec/notes/surfels.md)
  double sum = 0;
  for (const Surfel& s : in_memory(mesh, 500))
    sum += 2 * static_cast<double>(s.radius * s.radius * s.emission.x);
  CHECK(sum == Approx(0.625 * 2).epsilon(0.01));
}
