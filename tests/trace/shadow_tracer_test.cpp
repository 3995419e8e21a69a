// Shadow rays through the octree of a container, compared with a test of every disc in double.
#include "engine/trace/shadow_tracer.h"

#include <cmath>
#include <random>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/shade/reference/brute_force.h"
#include "tests/shade/gather_scene.h"
#include "tests/trace/wild_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// A ray in scene units.
struct Segment {
  glm::dvec3 origin, direction;
  double length;
};

/// Says whether a disc lies before the end of a ray; nothing when rounding decides.
std::optional<bool> is_hidden(const std::vector<Surfel>& surfels, const Segment& ray, Sides sides) {
  bool close = false;
  for (const Surfel& s : surfels) {
    const glm::dvec3 normal = glm::normalize(glm::dvec3(s.normal)), to = s.position - ray.origin;
    const double radius = static_cast<double>(s.radius), rim = 1.2 * radius;
    const double height = glm::dot(to, normal), slope = glm::dot(ray.direction, normal);
    if (height >= 0 && (sides == Sides::front || glm::dot(to, to) < 4 * radius * radius)) {
      close |= glm::dot(to, to) > 3.999 * radius * radius && sides == Sides::both;
      continue;
    }
    const double t = height / slope;
    const glm::dvec3 off = ray.direction * t - to;
    const double e = glm::length(off), depth = t + 0.01 * e * e / radius;
    const double slack = 1e-4 * radius + 1e-5 * std::abs(t);
    if (t < -slack || e > rim + slack / std::max(1e-3, std::abs(slope)) ||
        depth > ray.length + slack) {
      continue;
    }
    if (t > slack && e < rim - slack / std::max(1e-3, std::abs(slope)) &&
        depth < ray.length - slack && std::abs(height) > slack) {
      return true;
    }
    close = true;
  }
  if (close) return std::nullopt;
  return false;
}

/// Tests rays from around a place, and compares every answer with that of all discs.
void check_rays(const Scene& scene, const std::vector<Segment>& rays, Sides sides) {
  const std::vector<Surfel> surfels =
      load_surfels(*scene.container, scene.container->superblock().points);
  const SceneView view(*scene.container);
  PageCache cache(*scene.container, {.memory_bytes = 64U << 20});
  ShadowTracer tracer(view, cache, sides);
  glm::dvec3 middle(0);
  for (const Segment& ray : rays) middle += ray.origin / static_cast<double>(rays.size());
  std::vector<ShadowRay> shadows;
  for (const Segment& ray : rays) {
    shadows.push_back({.origin = view.scale().way(middle, ray.origin),
                       .direction = glm::vec3(ray.direction),
                       .length = static_cast<float>(view.scale().length(ray.length))});
  }
  std::vector<std::uint8_t> hidden(rays.size());
  tracer.begin(middle);
  tracer.test(shadows, hidden);
  std::size_t wrong = 0, known = 0, dark = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const std::optional<bool> truth = is_hidden(surfels, rays[i], sides);
    if (!truth) continue;
    ++known;
    dark += *truth ? 1U : 0U;
    wrong += *truth != (hidden[i] != 0) ? 1U : 0U;
  }
  CAPTURE(rays.size(), known, dark);
  CHECK(wrong == 0);
  CHECK(known > rays.size() / 2);
  CHECK(dark > known / 50);
  CHECK(dark < known - known / 50);
}

/// Rays from above every `step`-th surfel.
std::vector<Segment> rays_from(const std::vector<Surfel>& surfels, std::size_t step, unsigned seed,
                               const std::function<glm::dvec3(std::mt19937&)>& direction,
                               double length) {
  std::mt19937 bits(seed);
  std::vector<Segment> rays;
  for (std::size_t i = 0; i < surfels.size(); i += step) {
    const Surfel& s = surfels[i];
    const glm::dvec3 up(s.normal), d = glm::normalize(direction(bits));
    if (glm::dot(d, up) < 0.05) continue;
    rays.push_back({s.position + 0.15 * static_cast<double>(s.radius) * up, d, length});
  }
  return rays;
}

constexpr double kFar = std::numeric_limits<double>::infinity();

glm::dvec3 anywhere(std::mt19937& bits) {
  std::normal_distribution<double> normal;
  const double x = normal(bits), y = normal(bits);
  return {x, y, normal(bits)};
}

/// A sun of a few degrees, from above or from the side.
glm::dvec3 about(const glm::dvec3& to_sun, std::mt19937& bits) {
  return to_sun + 0.03 * anywhere(bits);
}

}  // namespace

TEST_CASE("shadows: rays to a sun are hidden where any disc hides them", "[trace][shadows]") {
  const std::vector<Surfel> surfels = small_scene(0.05);
  const Scene scene(surfels);
  for (const glm::dvec3 to_sun : {glm::dvec3(0, 0, 1), glm::dvec3(1, 0.3, 0.5),
                                  glm::dvec3(-0.2, 1, 0.1), glm::dvec3(0, 1, 0)}) {
    const auto along = [&](std::mt19937& bits) { return about(to_sun, bits); };
    const std::vector<Segment> rays = rays_from(surfels, 3, 1, along, kFar);
    if (rays.size() < 200) continue;
    check_rays(scene, rays, Sides::both);
    check_rays(scene, rays, Sides::front);
  }
}

TEST_CASE("shadows: so they are among discs of all sizes, in all directions, near and far",
          "[trace][shadows]") {
  const std::vector<Surfel> surfels = wild_scene();
  for (const std::uint32_t leaf_points : {1U, 16U, 100U}) {
    BuildOptions options;
    options.leaf_points = leaf_points;
    const Scene scene(surfels, options);
    for (const double length : {kFar, 0.6, 0.1}) {
      check_rays(scene, rays_from(surfels, 7, 2, anywhere, length), Sides::both);
      check_rays(scene, rays_from(surfels, 7, 3, anywhere, length), Sides::front);
    }
    const auto along = [&](std::mt19937& bits) { return about({1, 2, 3}, bits); };
    check_rays(scene, rays_from(surfels, 3, 4, along, kFar), Sides::both);
  }
}

TEST_CASE("shadows: so they are where rays from one place spread", "[trace][shadows]") {
  const Scene scene(wild_scene());
  std::mt19937 bits(6);
  for (const glm::dvec3 place : {glm::dvec3(0.3, -0.2, -0.9), glm::dvec3(-1.2, -1.1, -1.3)}) {
    std::vector<Segment> rays;
    for (int i = 0; i < 3000; ++i) {
      const glm::dvec3 d =
          glm::normalize(glm::normalize(glm::dvec3(1, 1, 2)) + 0.15 * anywhere(bits));
      rays.push_back({place + 0.01 * anywhere(bits), d, 0.3});
    }
    check_rays(scene, rays, Sides::both);
  }
}

TEST_CASE("shadows: so they are far from the origin of the coordinates", "[trace][shadows]") {
  std::vector<Surfel> surfels = wild_scene();
  for (Surfel& s : surfels) s.position += glm::dvec3(1 << 20, -(1 << 21), 1 << 19);
  const Scene scene(surfels);
  const auto along = [&](std::mt19937& bits) { return about({1, 2, 3}, bits); };
  check_rays(scene, rays_from(surfels, 3, 4, along, kFar), Sides::both);
}

TEST_CASE("shadows: an empty scene hides nothing", "[trace][shadows]") {
  const Scene scene({});
  const SceneView view(*scene.container);
  PageCache cache(*scene.container, {.memory_bytes = 64U << 20});
  ShadowTracer tracer(view, cache, Sides::both);
  tracer.begin({0, 0, 0});
  const std::vector<ShadowRay> rays(20, {.direction = {0, 0, 1}});
  std::vector<std::uint8_t> hidden(rays.size(), 7);
  tracer.test(rays, hidden);
  for (const std::uint8_t h : hidden) CHECK(h == 0);
}
