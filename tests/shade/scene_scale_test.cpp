// Shading in other units of length, and with extreme radii (engine/shade/scene_scale.h).
#include "engine/shade/scene_scale.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/shade/reference/brute_force.h"
#include "tests/shade/gather_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

std::vector<Surfel> scaled(std::vector<Surfel> surfels, int exponent) {
  for (Surfel& s : surfels) {
    s.position *= std::ldexp(1.0, exponent);
    s.radius = std::ldexp(s.radius, exponent);
  }
  return surfels;
}

std::vector<Receiver> scaled(std::vector<Receiver> receivers, int exponent) {
  for (Receiver& r : receivers) r.position *= std::ldexp(1.0, exponent);
  return receivers;
}

bool is_same(const Shading& a, const Shading& b) {
  const auto bits = [](const Shading& s) {
    return std::bit_cast<std::array<std::uint32_t, sizeof(Shading) / 4>>(s);
  };
  return bits(a) == bits(b);
}

std::size_t differing(std::span<const Shading> a, std::span<const Shading> b) {
  REQUIRE(a.size() == b.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) count += is_same(a[i], b[i]) ? 0U : 1U;
  return count;
}

bool is_sane(const Shading& s) {
  const glm::vec3 light = s.irradiance + s.sky;
  const float length = glm::length(s.bent_normal);
  return s.occlusion >= 0 && s.occlusion <= 1 && std::isfinite(light.x + light.y + light.z) &&
         std::abs(length - 1) < 1e-3F;
}

/// Balls and a wall on a ground that is one disc of this radius.
std::vector<Surfel> on_ground(float radius) {
  std::vector<Surfel> surfels;
  add_sphere(surfels, {0, 0.5, 0}, 0.4, 0.08, glm::vec3(1, 0.5F, 0.2F));
  add_rectangle(surfels, {-1, 0, -1}, {2, 0, 0}, {0, 1, 0}, 0.08, glm::vec3(0.3F));
  surfels.push_back({.normal = {0, 1, 0}, .radius = radius, .radiance = glm::vec3(0.5F)});
  return surfels;
}

std::vector<Receiver> around(std::span<const Surfel> surfels) {
  std::vector<Receiver> receivers;
  for (std::size_t i = 0; i < surfels.size(); i += 7) {
    const Surfel& s = surfels[i];
    if (s.radius < 1)
      receivers.push_back({s.position + glm::dvec3(s.normal * (0.15F * s.radius)), s.normal});
  }
  for (int x = -8; x <= 8; ++x) receivers.push_back({{0.1 * x, 0.01, 0.6}, {0, 1, 0}});
  return receivers;
}

}  // namespace

TEST_CASE("scene scale: the shading does not depend on the unit of length, bit for bit",
          "[shade][scale]") {
  Scene scene(small_scene(0.05));
  add_floor_receivers(scene.receivers, 0.05);
  const std::vector<Shading> whole = scene.shade();
  ShadeOptions surfels_alone;
  surfels_alone.gather.solid_angle = 1e-6F;
  const std::vector<Shading> exact = scene.shade(surfels_alone);
  for (const int exponent : {-50, -20, -1, 7, 18, 34, 55}) {
    CAPTURE(exponent);
    Scene other(scaled(small_scene(0.05), exponent));
    other.receivers = scaled(scene.receivers, exponent);
    CHECK(differing(other.shade(), whole) == 0);
  }
  // The areas of clusters no longer fit their field.
  for (const int exponent : {-110, 110}) {
    CAPTURE(exponent);
    Scene other(scaled(small_scene(0.05), exponent));
    other.receivers = scaled(scene.receivers, exponent);
    CHECK(differing(other.shade(surfels_alone), exact) == 0);
  }
}

TEST_CASE("scene scale: the discs that rays meet do not depend on the unit of length",
          "[shade][scale]") {
  const std::vector<Surfel> surfels = small_scene(0.05);
  std::vector<Receiver> receivers;
  add_floor_receivers(receivers, 0.05);
  receivers.resize(40);
  const auto trace = [&](int exponent) {
    const std::vector<Surfel> others = scaled(surfels, exponent);
    const DiscRays rays(others, Sides::both, {});
    std::vector<Shading> traced;
    for (const Receiver& r : scaled(receivers, exponent)) traced.push_back(rays.trace(r, 256, 3));
    return traced;
  };
  const std::vector<Shading> traced = trace(0);
  CHECK(std::ranges::any_of(traced, [](const Shading& s) { return s.occlusion > 0.1F; }));
  for (const int exponent : {-110, -40, 13, 40, 62, 110}) {
    CAPTURE(exponent);
    CHECK(differing(trace(exponent), traced) == 0);
  }
}

TEST_CASE("scene scale: a disc of any large radius is a plane to receivers on it",
          "[shade][scale]") {
  const std::vector<Receiver> receivers = around(on_ground(1000));
  const auto shade = [&](float radius) {
    Scene scene(on_ground(radius));
    scene.receivers = receivers;
    return scene.shade();
  };
  const auto trace = [&](float radius) {
    const std::vector<Surfel> surfels = on_ground(radius);
    const DiscRays rays(surfels, Sides::both, {});
    std::vector<Shading> traced;
    for (std::size_t i = 0; i < receivers.size(); ++i)
      traced.push_back(rays.trace(receivers[i], 1024, i));
    return traced;
  };
  const Errors usual = compare(shade(1000), trace(1000));
  CHECK(usual.occlusion_rms < 0.02);
  for (const float radius : {1e6F, 1e12F, 1e18F, 1e19F, 1e20F, 1e30F, 3e38F}) {
    CAPTURE(radius);
    const std::vector<Shading> ours = shade(radius), traced = trace(radius);
    CHECK(std::ranges::all_of(ours, is_sane));
    CHECK(std::ranges::all_of(traced, is_sane));
    const Errors errors = compare(ours, traced);
    CHECK(errors.occlusion_rms < 0.02);
    CHECK(errors.irradiance_rms < 0.05);
    CHECK(compare(ours, shade(1000)).occlusion_rms < 0.005);
    CHECK(compare(traced, trace(1000)).occlusion_rms < 0.005);
  }
}

TEST_CASE("scene scale: receivers extremely far away see nothing", "[shade][scale]") {
  Scene scene(small_scene(0.1));
  for (const double far : {1e12, 1e20, 1e39, 1e200, 1.7e308}) {
    for (const glm::vec3& normal : {glm::vec3(1, 0, 0), glm::vec3(-1, 0, 0), glm::vec3(0, 1, 0)})
      scene.receivers.push_back({{far, -far, 0.5 * far}, normal});
  }
  const std::vector<Surfel> surfels = load_surfels(*scene.container, 1'000'000);
  const DiscRays rays(surfels, Sides::both, {});
  const std::vector<Shading> shaded = scene.shade();
  for (std::size_t i = 0; i < shaded.size(); ++i) {
    for (const Shading& s : {shaded[i], rays.trace(scene.receivers[i], 256, i)}) {
      CHECK(is_sane(s));
      CHECK(s.occlusion == 0);
    }
  }
}

TEST_CASE("scene scale: lengths are exact, radii and distances bounded", "[shade][scale]") {
  for (const int exponent : {-960, -300, -130, -5, 0, 9, 125, 400, 1010}) {
    Frame frame;
    frame.edge = std::ldexp(1.0, exponent);
    const SceneScale scale(frame);
    CAPTURE(exponent);
    CHECK(scale.length(frame.edge * 0.75) == 0.75);
    CHECK(scale.scene_units(0.75) == frame.edge * 0.75);
    CHECK(scale.way({0, 0, 0}, {frame.edge * 3, -frame.edge, 0}) == glm::vec3(3, -1, 0));
    CHECK(scale.way({0, 0, 0}, {1.7e308, -1.7e308, 0}).z == 0);
    CHECK(scale.way({0, 0, 0}, {frame.edge * 0x1p40, 0, 0}).x == 0x1p36F);
    CHECK(scale.radius(0) == 0);
    for (const float radius : {1e-44F, 1e-38F, 1e-20F, 1.0F, 1e19F, 3.4e38F}) {
      const double edges = static_cast<double>(radius) / frame.edge;
      const auto expected = static_cast<float>(std::min(edges, 0x1p28));
      CHECK(std::abs(scale.radius(radius) - expected) <= 0x1p-100F);  // less is no length
    }
  }
}
