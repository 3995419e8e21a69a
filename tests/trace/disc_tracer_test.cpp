// Rays through the octree of a container, compared with Embree's rays at the same discs.
#include "engine/trace/disc_tracer.h"

#include <cmath>
#include <random>

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/shade/reference/cosine_rays.h"
#include "engine/trace/ray_shader.h"
#include "tests/shade/gather_scene.h"
#include "tests/trace/wild_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Shades receivers by rays through the container.
std::vector<Shading> trace(const Scene& scene, std::span<const Receiver> receivers, unsigned rays,
                           const RayOptions& options, unsigned threads = 1) {
  std::vector<Shading> results(receivers.size());
  Progress silent;
  const ThreadPool executor(threads);
  RayShader(*scene.container, options, executor).trace(receivers, rays, 7, results, silent);
  return results;
}

/// Checks that rays through the container and Embree's rays find the same.
/// @param most  of the rays, the share that may end at another disc or none, by rounding
void check_against_embree(const Scene& scene, std::span<const Receiver> receivers, Sides sides,
                          double most) {
  const auto sky = [](const glm::vec3& d) { return glm::vec3(1 + d.z); };
  const std::vector<Shading> ours = trace(scene, receivers, 400, {.sides = sides, .sky = sky});
  const std::vector<Surfel> surfels =
      load_surfels(*scene.container, scene.container->superblock().points);
  const DiscRays rays(surfels, sides, sky);
  double covered = 0, occlusion = 0, irradiance = 0, light = 0;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    const Shading theirs = rays.trace(receivers[i], 400, 7 + i);
    covered += static_cast<double>(theirs.occlusion);
    light += static_cast<double>(theirs.irradiance.g);
    occlusion += std::abs(static_cast<double>(ours[i].occlusion - theirs.occlusion));
    irradiance += std::abs(static_cast<double>(ours[i].irradiance.g - theirs.irradiance.g));
    CHECK(ours[i].sky.g == Approx(theirs.sky.g).margin(0.1));
  }
  const auto n = static_cast<double>(receivers.size());
  CAPTURE(covered / n, occlusion / n, irradiance / light);
  CHECK(covered / n > 0.05);
  CHECK(occlusion / n <= most);
  CHECK(irradiance <= 4 * most * light);
}

/// A scene with receivers above its surfels: every `step`-th, lifted.
struct SceneOnItself : Scene {
  SceneOnItself(const std::vector<Surfel>& surfels, std::size_t step,
                const BuildOptions& options = {})
      : Scene(surfels, options) {
    for (std::size_t i = 0; i < surfels.size(); i += step) {
      const Surfel& s = surfels[i];
      receivers.push_back(
          {s.position + glm::dvec3(s.normal) * (0.15 * static_cast<double>(s.radius)), s.normal});
    }
  }
};

}  // namespace

TEST_CASE("trace: rays through the tree meet what Embree's rays meet", "[trace]") {
  Scene scene(small_scene(0.02));
  add_floor_receivers(scene.receivers, 0.02);
  check_against_embree(scene, std::span(scene.receivers).first(300), Sides::both, 1e-4);
  check_against_embree(scene, std::span(scene.receivers).first(300), Sides::front, 1e-4);
}

TEST_CASE("trace: so they do in a cloud of discs of all sizes, whatever a leaf holds", "[trace]") {
  for (const std::uint32_t leaf_points : {1U, 16U, 100U}) {
    BuildOptions options;
    options.leaf_points = leaf_points;
    const SceneOnItself scene(wild_scene(), 40, options);
    check_against_embree(scene, scene.receivers, Sides::both, 2e-4);
  }
}

TEST_CASE("trace: so they do where the root is a leaf", "[trace]") {
  // A few discs far apart, seen from above: its one child has the whole cell, not an octant
  std::vector<Surfel> surfels;
  for (const double x : {0.0, 0.1, 0.2, 0.9}) {
    Surfel s;
    s.position = {x, 0.3 * x, 0.1 * x};
    s.normal = {0, 0, 1};
    s.radius = 0.05F;
    s.radiance = glm::vec3(1);
    surfels.push_back(s);
  }
  Scene scene(surfels);
  for (const Surfel& s : surfels)
    scene.receivers.push_back({s.position + glm::dvec3(0.01, 0, 0.04), {0, 0, -1}});
  check_against_embree(scene, scene.receivers, Sides::both, 1e-4);
}

TEST_CASE("trace: so they do along ground that is hardly tilted", "[trace]") {
  // Rays at an angle of 0.001 to the ground, from far away: boxes are as thin as its tilt makes
  // them
  std::vector<Surfel> surfels;
  const double tilt = 2.3e-4;
  for (int j = 0; j < 200; ++j) {
    for (int i = 0; i < 200; ++i) {
      Surfel s;
      s.position = {i * 0.01, j * 0.01, tilt * i * 0.01};
      s.normal = glm::normalize(glm::vec3(-tilt, 0, 1));
      s.radius = 0.008F;
      surfels.push_back(s);
    }
  }
  const Scene scene(surfels);
  const SceneView view(*scene.container);
  PageCache cache(*scene.container, {.memory_bytes = 64U << 20});
  DiscTracer tracer(view, cache, Sides::both);
  std::mt19937 bits(3);
  std::uniform_real_distribution<double> uniform(0.1, 1.9);
  int missed = 0;
  for (int i = 0; i < 20'000; ++i) {
    const glm::dvec3 target(uniform(bits), uniform(bits), 0);
    const double turn = 3 * uniform(bits);
    const glm::dvec3 back(std::cos(turn), std::sin(turn), 0.001);
    glm::dvec3 origin = target + 2.5 * back;
    origin.z += tilt * target.x;
    const glm::vec3 along(-glm::normalize(back));
    RayHit hit;
    tracer.begin(origin, along);
    tracer.meet({&along, 1}, RaysFor::nearest, {&hit, 1});
    if (!hit.met()) ++missed;
  }
  CHECK(missed == 0);
}

TEST_CASE("trace: far from the origin of its coordinates a scene has the same occlusion",
          "[trace]") {
  std::vector<Surfel> surfels = small_scene(0.05);
  const SceneOnItself here(surfels, 50);
  for (Surfel& s : surfels) s.position += glm::dvec3(1 << 23, -(1 << 22), 1 << 20);
  const SceneOnItself there(surfels, 50);
  const std::vector<Shading> a = trace(here, here.receivers, 256, {}),
                             b = trace(there, there.receivers, 256, {});
  double difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    difference += std::abs(static_cast<double>(a[i].occlusion - b[i].occlusion));
  CHECK(difference / static_cast<double>(a.size()) < 2e-3);
}

TEST_CASE("trace: threads and caps change no bit", "[trace]") {
  const SceneOnItself scene(small_scene(0.01), 400);
  const std::vector<Shading> one = trace(scene, scene.receivers, 100, {});
  const auto check_same = [&](const RayOptions& options, unsigned threads) {
    const std::vector<Shading> other = trace(scene, scene.receivers, 100, options, threads);
    for (std::size_t i = 0; i < one.size(); ++i) {
      CHECK(other[i].occlusion == one[i].occlusion);
      CHECK(other[i].irradiance == one[i].irradiance);
      CHECK(other[i].bent_normal == one[i].bent_normal);
    }
  };
  REQUIRE(one.size() > 100);
  check_same({}, 3);
  check_same({.memory_bytes = 0}, 1);
  check_same({.memory_bytes = 0}, 4);
}

TEST_CASE("trace: rays that look for any disc cover what rays for the nearest do", "[trace]") {
  const SceneOnItself scene(wild_scene(), 40);
  const std::vector<Shading> nearest = trace(scene, scene.receivers, 256, {}),
                             any = trace(scene, scene.receivers, 256, {.bleeding = false});
  for (std::size_t i = 0; i < any.size(); ++i) {
    CHECK(any[i].occlusion == nearest[i].occlusion);
    CHECK(any[i].irradiance == glm::vec3(0));
  }
}

TEST_CASE("trace: what a ray meets does not depend on the rays beside it", "[trace]") {
  // Of discs at the same place the first counts, in whichever order a tile meets them
  std::vector<Surfel> surfels = wild_scene();
  for (std::size_t i = 0; i < 4000; i += 3) surfels.push_back(surfels[i]);
  const SceneOnItself scene(surfels, 100);
  const std::vector<Surfel> stored = load_surfels(*scene.container, 1'000'000);
  const SceneView view(*scene.container);
  PageCache cache(*scene.container, {.memory_bytes = 64U << 20});
  DiscTracer tracer(view, cache, Sides::both);
  std::vector<glm::vec3> directions;
  std::size_t met = 0, doubled = 0;
  for (const Receiver& receiver : scene.receivers) {
    cosine_directions(receiver.normal, 64, 3, directions);
    std::vector<RayHit> together(directions.size()), alone(directions.size());
    tracer.begin(receiver.position, receiver.normal);
    tracer.meet(directions, RaysFor::nearest, together);
    for (std::size_t i = 0; i < directions.size(); ++i) {
      tracer.meet(std::span(directions).subspan(i, 1), RaysFor::nearest,
                  std::span(alone).subspan(i, 1));
      REQUIRE(alone[i].depth == together[i].depth);
      REQUIRE(alone[i].point == together[i].point);
      if (!alone[i].met()) continue;
      ++met;
      const auto same = [&](std::size_t a, std::size_t b) {
        return stored[a].position == stored[b].position && stored[a].normal == stored[b].normal &&
               stored[a].radius == stored[b].radius;
      };
      const std::size_t point = alone[i].point;
      if (point > 0) CHECK_FALSE(same(point - 1, point));
      if (point + 1 < stored.size() && same(point, point + 1)) ++doubled;
    }
  }
  CHECK(met > 1000);
  CHECK(doubled > 100);
}

TEST_CASE("trace: directions that follow one another lie close together", "[trace]") {
  // On the disc below the hemisphere, where each has the same share
  std::vector<glm::vec3> directions;
  for (const std::size_t count : {100U, 1024U, 1088U}) {
    cosine_directions({0, 0, 1}, count, 5, directions);
    REQUIRE(directions.size() == count);
    double sum = 0;
    for (std::size_t i = 1; i < count; ++i) {
      const glm::vec3 way = directions[i] - directions[i - 1];
      sum += std::hypot(static_cast<double>(way.x), static_cast<double>(way.y));
    }
    const double share = std::sqrt(3.14159265 / static_cast<double>(count));
    CHECK(sum / static_cast<double>(count) < 1.6 * share);
  }
}

TEST_CASE("trace: an empty scene covers nothing", "[trace]") {
  Scene scene({});
  scene.receivers = {{{0, 0, 0}, {0, 0, 1}}};
  const Shading seen =
      trace(scene, scene.receivers, 64, {.sky = [](const glm::vec3&) { return glm::vec3(1); }})[0];
  CHECK(seen.occlusion == 0);
  CHECK(seen.sky.x == Approx(3.14159265F));
}
