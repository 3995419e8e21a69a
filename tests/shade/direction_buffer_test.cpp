#include "engine/shade/gather/direction_buffer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "format/scalar.h"

using namespace ptc;

namespace {

glm::vec3 random_direction(std::mt19937& bits) {
  std::normal_distribution<float> normal;
  return glm::normalize(glm::vec3(normal(bits), normal(bits), normal(bits)));
}

void draw_disc(const DirectionGrid& grid, DirectionBuffer& buffer, const glm::vec3& to,
               const glm::vec3& normal, float radius, std::uint32_t rgbe, Sides sides) {
  DiscQueue queue;
  queue.push(to, normal, radius, rgbe);
  buffer.draw(grid, queue, sides);
}

const DirectionGrid& fine_grid() {
  static const DirectionGrid grid(64, {});
  return grid;
}

}  // namespace

TEST_CASE("direction buffer: an empty buffer is open everywhere and sees the whole sky",
          "[shade][buffer]") {
  const DirectionGrid grid(32, [](const glm::vec3&) { return glm::vec3(1, 2, 3); });
  DirectionBuffer buffer(32);
  std::mt19937 bits(1);
  for (int i = 0; i < 100; ++i) {
    const glm::vec3 n = random_direction(bits);
    const Shading s = buffer.resolve(grid, n);
    CHECK(s.occlusion == 0);
    CHECK(s.irradiance == glm::vec3(0));
    CHECK(s.sky.g == Approx(2 * kPi).epsilon(1e-5));
    CHECK(glm::dot(s.bent_normal, n) > 0.9999F);
  }
}

TEST_CASE(
    "direction buffer: irradiance from a gradient does not depend on the turn of the receiver",
    "[shade][buffer]") {
  // Radiance 1 + cos(angle to z) gives E(n) = pi + 2 pi / 3 n.z, whatever the pixels of the cube
  // are.
  const DirectionGrid grid(32, [](const glm::vec3& d) { return glm::vec3(1 + d.z); });
  DirectionBuffer buffer(32);
  std::mt19937 bits(2);
  for (int i = 0; i < 300; ++i) {
    const glm::vec3 n = random_direction(bits);
    CHECK(buffer.resolve(grid, n).sky.r == Approx(kPi + 2 * kPi / 3 * n.z).margin(0.002 * kPi));
  }
}

TEST_CASE("direction buffer: surroundings weigh directions and distances by their formulas",
          "[shade][buffer]") {
  // A plane at the height 1 covers (1 - 1 / D)^2 of the hemisphere up to the distance D with a
  // linear falloff, and 1 - 1 / D^2 without one; a disc of a half angle of 45 degrees covers sin^2
  // 45 / sin^2 A of a cone of half angle A.
  const DirectionGrid grid(64, [](const glm::vec3&) { return glm::vec3(1, 2, 3); });
  const auto shade = [&](float radius, const glm::vec3& n, const PixelWeights& weights) {
    DirectionBuffer buffer(64);
    draw_disc(grid, buffer, {0, 0, 1}, {0, 0, -1}, radius, encode_rgbe({1, 1, 1}), Sides::both);
    return buffer.resolve(grid, n, {}, &weights);
  };
  const glm::vec3 up(0, 0, 1);
  for (const float distance : {1.5F, 2.0F, 5.0F}) {
    const float inverse = 1 / distance;
    const Shading linear = shade(1e4F, up, {.per_distance = inverse, .falloff = 1});
    CHECK(linear.occlusion == Approx((1 - inverse) * (1 - inverse)).margin(0.004));
    CHECK(linear.sky.g == Approx(2 * kPi * (1 - linear.occlusion)).epsilon(1e-4));
    CHECK(linear.irradiance.r == Approx(kPi).epsilon(0.01));  // light comes from any distance
    const Shading hard = shade(1e4F, up, {.per_distance = inverse});
    CHECK(hard.occlusion == Approx(1 - inverse * inverse).margin(0.006));
  }
  for (const float degrees : {45.0F, 60.0F, 90.0F}) {
    const float sine = std::sin(degrees * kPi / 180);
    const float cosine = std::cos(degrees * kPi / 180);
    CHECK(shade(1, up, {.cone_cos = std::max(0.0F, cosine)}).occlusion ==
          Approx(0.5F / (sine * sine)).margin(0.02));
  }
  for (const glm::vec3& n : {up, -up, glm::vec3(1, 0, 0)}) {
    CHECK(shade(1e4F, n, {.sphere = true}).occlusion == Approx(0.5).margin(0.004));
    CHECK(shade(1, n, {.sphere = true}).occlusion ==
          Approx((1 - std::sqrt(0.5F)) / 2).margin(0.002));
  }
}

TEST_CASE("direction buffer: a disc over the receiver has the analytic form factor",
          "[shade][buffer]") {
  std::mt19937 bits(4);
  for (const float radius : {0.01F, 0.1F, 0.5F, 1.0F, 3.0F, 30.0F}) {
    for (int i = 0; i < 20; ++i) {
      const glm::vec3 n = random_direction(bits);
      DirectionBuffer buffer(64);
      draw_disc(fine_grid(), buffer, n, -n, radius, encode_rgbe({1, 0.5F, 0.25F}), Sides::front);
      const float expected = radius * radius / (1 + radius * radius);
      const Shading s = buffer.resolve(fine_grid(), n);
      CHECK(s.occlusion == Approx(expected).margin(0.004));
      CHECK(s.irradiance.r == Approx(kPi * s.occlusion).epsilon(0.01));
      CHECK(s.irradiance.b == Approx(0.25F * kPi * s.occlusion).epsilon(0.01));
    }
  }
}

TEST_CASE("direction buffer: a disc close to the receiver never covers more than the hemisphere",
          "[shade][buffer]") {
  for (const float height : {1.0F, 1e-1F, 1e-3F, 1e-6F, 0.0F}) {
    DirectionBuffer buffer(64);
    draw_disc(fine_grid(), buffer, {0, 0, height}, {0, 0, -1}, 1, 1, Sides::both);
    const Shading s = buffer.resolve(fine_grid(), {0, 0, 1});
    CHECK(s.occlusion <= 1.00001F);
    if (height > 0) CHECK(s.occlusion == Approx(1 / (1 + height * height)).margin(0.004));
    CHECK(std::isfinite(s.bent_normal.x));
  }
}

TEST_CASE("direction buffer: the back of a disc is black, and transparent within two radii",
          "[shade][buffer]") {
  const std::uint32_t white = encode_rgbe({1, 1, 1});
  const auto shade = [&](float distance, Sides sides) {
    DirectionBuffer buffer(64);
    draw_disc(fine_grid(), buffer, {0, 0, distance}, {0, 0, 1}, 1, white, sides);
    return buffer.resolve(fine_grid(), {0, 0, 1});
  };
  CHECK(shade(2.5F, Sides::both).occlusion > 0.1F);
  CHECK(shade(2.5F, Sides::both).irradiance == glm::vec3(0));
  CHECK(shade(1.9F, Sides::both).occlusion == 0);
  CHECK(shade(2.5F, Sides::front).occlusion == 0);
}

TEST_CASE("direction buffer: the nearer of two walls is seen, whichever is drawn first",
          "[shade][buffer]") {
  const std::uint32_t red = encode_rgbe({1, 0, 0}), green = encode_rgbe({0, 1, 0});
  for (const bool near_first : {true, false}) {
    DirectionBuffer buffer(64);
    for (const bool near : {near_first, !near_first}) {
      draw_disc(fine_grid(), buffer, {0, 0, near ? 1.0F : 1.001F}, {0, 0, -1}, 2,
                near ? red : green, Sides::front);
    }
    const Shading s = buffer.resolve(fine_grid(), {0, 0, 1});
    CHECK(s.irradiance.r == Approx(kPi * 0.8).margin(0.02));
    CHECK(s.irradiance.g < 0.02F);
  }
}

TEST_CASE("direction buffer: coplanar overlapping discs divide half way between their centres",
          "[shade][buffer]") {
  const std::uint32_t red = encode_rgbe({1, 0, 0}), green = encode_rgbe({0, 1, 0});
  for (const bool swap : {false, true}) {
    DirectionBuffer buffer(64);
    draw_disc(fine_grid(), buffer, {swap ? 0.5F : -0.5F, 0, 1}, {0, 0, -1}, 2, swap ? green : red,
              Sides::front);
    draw_disc(fine_grid(), buffer, {swap ? -0.5F : 0.5F, 0, 1}, {0, 0, -1}, 2, swap ? red : green,
              Sides::front);
    const Shading s = buffer.resolve(fine_grid(), {0, 0, 1});
    CHECK(s.irradiance.r == Approx(s.irradiance.g).epsilon(0.03));
  }
}

TEST_CASE(
    "direction buffer: right above a plane of discs only the disc with the nearest centre is seen",
    "[shade][buffer]") {
  const std::uint32_t red = encode_rgbe({1, 0, 0}), green = encode_rgbe({0, 1, 0}),
                      blue = encode_rgbe({0, 0, 1});
  for (const float height :
       {1e-2F, 1e-3F, 1e-4F, 1e-6F}) {  // less than the bump of a disc, 0.01 e^2 / r, where it can
    DirectionBuffer buffer(64);
    draw_disc(fine_grid(), buffer, {0.6F, 0, height}, {0, 0, -1}, 1, red, Sides::both);
    draw_disc(fine_grid(), buffer, {-0.7F, 0, height}, {0, 0, -1}, 1, green, Sides::both);
    draw_disc(fine_grid(), buffer, {0, 0, 1}, {0, 0, -1}, 2, blue, Sides::both);
    const Shading s = buffer.resolve(fine_grid(), {0, 0, 1});
    CAPTURE(height);
    CHECK(s.irradiance.r == Approx(kPi).margin(0.1));
    CHECK(s.irradiance.g < 0.1F);
    CHECK(s.irradiance.b < 0.01F);
  }
}

TEST_CASE("direction buffer: discs drawn from elsewhere move with the receiver, to first order",
          "[shade][buffer]") {
  std::mt19937 bits(7);
  std::uniform_real_distribution<float> uniform;
  const DirectionGrid& grid = fine_grid();
  double unmoved = 0, moved = 0;
  for (int i = 0; i < 400; ++i) {
    const glm::vec3 n = random_direction(bits);
    const glm::vec3 to = glm::normalize(n + 0.9F * random_direction(bits));
    const glm::vec3 normal = glm::normalize(-to + 0.8F * random_direction(bits));
    const float radius = 0.1F + 0.3F * uniform(bits);
    const glm::vec3 offset = 0.03F * random_direction(bits);
    const auto occlusion = [&](const glm::vec3& from, std::span<const glm::vec3> offsets) {
      DirectionBuffer buffer(64);
      DiscQueue queue;
      queue.push(to - from, normal, radius, encode_rgbe({1, 1, 1}));
      buffer.draw(grid, queue, Sides::both, 0);
      return buffer.resolve(grid, n, offsets).occlusion;
    };
    const float there = occlusion(offset, {});
    unmoved += std::pow(occlusion({}, {}) - there, 2);
    moved += std::pow(occlusion({}, std::span(&offset, 1)) - there, 2);
    INFO(i << " " << occlusion({}, {}) << " " << occlusion({}, std::span(&offset, 1)) << " "
           << there);
    CHECK(std::abs(occlusion({}, std::span(&offset, 1)) - there) < 0.004F);
  }
  CHECK(moved < 0.1 * unmoved);
}

TEST_CASE(
    "direction buffer: a disc near the receiver covers as much as rays find, wherever it lies",
    "[shade][buffer]") {
  // Centres are 0.3 to 3 radii away: discs around the receiver, edge-on, across several faces.
  std::mt19937 bits(11);
  std::uniform_real_distribution<float> unit(0, 1);
  const DirectionGrid& grid = fine_grid();
  for (int i = 0; i < 200; ++i) {
    const glm::vec3 normal = random_direction(bits);
    glm::vec3 to = random_direction(bits) * (0.3F + 2.7F * unit(bits));
    if (glm::dot(to, normal) > 0) to = -to;  // its front
    DirectionBuffer buffer(64);
    buffer.clear();
    draw_disc(grid, buffer, to, normal, 1, 0, Sides::both);
    const glm::vec3 up = random_direction(bits);
    // Trace stratified cosine directions about `up`.
    constexpr int kSide = 128;
    const glm::vec3 x = glm::normalize(
        glm::cross(up, std::abs(up.x) > 0.6F ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0)));
    const glm::vec3 y = glm::cross(up, x);
    int hits = 0;
    for (int k = 0; k < kSide * kSide; ++k) {
      const float u = (static_cast<float>(k % kSide) + 0.5F) / kSide;
      const float a = 2 * kPi * (static_cast<float>(k / kSide) + 0.5F) / kSide;
      const glm::vec3 d =
          std::sqrt(u) * (std::cos(a) * x + std::sin(a) * y) + std::sqrt(1 - u) * up;
      const float t = glm::dot(to, normal) / glm::dot(d, normal);
      if (t > 0 && glm::length(t * d - to) < 1) ++hits;
    }
    CAPTURE(to.x, to.y, to.z, normal.x, normal.y, normal.z);
    CHECK(buffer.resolve(grid, up).occlusion == Approx(hits / double{kSide * kSide}).margin(0.002));
  }
}

TEST_CASE("direction buffer: a disc covers as much across the middle of the cube as next to it",
          "[shade][buffer]") {
  // Centres of discs in a plane through the middle of the cube, and this far next to it.
  const glm::mat3 to_world = glm::transpose(fine_grid().rotation());
  std::mt19937 bits(13);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int i = 0; i < 100; ++i) {
    const float angle = 2 * kPi * unit(bits), distance = 2.01F + unit(bits);
    const glm::vec3 normal = random_direction(bits);
    const auto covered = [&](float beside) {
      glm::vec3 to(0);
      to[i % 3] = beside;
      to[(i + 1) % 3] = distance * std::cos(angle);
      to[(i + 2) % 3] = distance * std::sin(angle);
      to = to_world * to;
      DirectionBuffer buffer(64);
      draw_disc(fine_grid(), buffer, to, normal, 1, 0, Sides::both);
      return buffer.resolve(fine_grid(), glm::normalize(to)).occlusion;
    };
    CAPTURE(i, angle, distance);
    const float expected = covered(0.06F);
    for (const float beside : {0.0F, 1e-8F, 1e-7F, 1e-6F, 1e-5F, 1e-4F, 1e-3F}) {
      CHECK(covered(beside) == Approx(expected).margin(0.03));
      CHECK(covered(-beside) == Approx(expected).margin(0.03));
    }
  }
}

TEST_CASE("direction buffer: pixels left out below a horizon change no sum above it",
          "[shade][buffer]") {
  std::mt19937 bits(12);
  std::uniform_real_distribution<float> unit(0, 1);
  const DirectionGrid grid(32, [](const glm::vec3&) { return glm::vec3(1); });
  for (int i = 0; i < 50; ++i) {
    DiscQueue queue;
    for (int k = 0; k < 300; ++k) {
      const float distance = 0.5F + 5 * unit(bits);
      queue.push(random_direction(bits) * distance, random_direction(bits),
                 0.05F + 0.6F * unit(bits), 0x88c0c0c0U);
    }
    const float sine = 0.9F * unit(bits);
    const Horizon horizon{random_direction(bits), sine};
    DirectionBuffer whole(32), part(32);
    whole.clear();
    part.clear();
    whole.draw(grid, queue, Sides::both);
    part.draw(grid, queue, Sides::both, 0, horizon);
    for (int k = 0; k < 20; ++k) {
      const glm::vec3 aside = glm::normalize(glm::cross(horizon.axis, random_direction(bits)));
      const float s = sine * unit(bits);
      const glm::vec3 normal = std::sqrt(1 - s * s) * horizon.axis + s * aside;
      const Shading a = whole.resolve(grid, normal), b = part.resolve(grid, normal);
      CHECK(a.occlusion == b.occlusion);
      CHECK(a.irradiance == b.irradiance);
      CHECK(a.sky == b.sky);
    }
  }
}

TEST_CASE("direction buffer: a resolution that the pixel loops cannot take is refused",
          "[shade][buffer]") {
  for (const unsigned resolution : {0U, 8U, 24U, 80U})
    CHECK_THROWS_AS(DirectionGrid(resolution, {}), std::invalid_argument);
  for (const unsigned resolution : {16U, 48U, 64U}) CHECK_NOTHROW(DirectionGrid(resolution, {}));
}

TEST_CASE("direction buffer: the sky is not negative where a border moves over all that is open",
          "[shade][buffer]") {
  // A slit between a disc at the distance 1 and one at 100. To the receiver, which lies aside of
  // the viewpoint, the near one covers the slit and more; what lies beside does not count.
  const DirectionGrid grid(32, [](const glm::vec3&) { return glm::vec3(1); });
  DirectionBuffer buffer(32);
  DiscQueue queue;
  queue.push({-5, 0, 1}, {0, 0, -1}, 5, 0);
  queue.push({510, 0, 100}, {0, 0, -1}, 500, 0);
  buffer.draw(grid, queue, Sides::both);
  const PixelWeights cone{.cone_cos = std::cos(0.4F)};
  CHECK(buffer.resolve(grid, {0, 0, 1}, {}, &cone).sky.g > 0);
  const std::vector<glm::vec3> offsets{{-0.2F, 0, 0}};
  const Shading moved = buffer.resolve(grid, {0, 0, 1}, offsets, &cone);
  CHECK(moved.occlusion == 1);
  CHECK(moved.sky == glm::vec3(0));
}
