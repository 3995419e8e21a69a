// Texture and panorama lookups.
#include "engine/scene/texture.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <catch2/catch.hpp>

using namespace ptc;

namespace {

// Four columns and two rows; red is the column, green the row.
Image numbered() {
  Image image{4, 2, {}};
  for (unsigned y = 0; y < 2; ++y) {
    for (unsigned x = 0; x < 4; ++x) {
      image.pixels.emplace_back(static_cast<float>(x), static_cast<float>(y), 0.25f);
    }
  }
  return image;
}

}  // namespace

TEST_CASE("texture: at a pixel's centre the value is the pixel's, and row 0 is at v = 1",
          "[scene][texture]") {
  const Image image = numbered();
  for (unsigned y = 0; y < 2; ++y) {
    for (unsigned x = 0; x < 4; ++x) {
      const glm::vec2 uv((static_cast<float>(x) + 0.5f) / 4,
                         1 - (static_cast<float>(y) + 0.5f) / 2);
      CHECK(sample_texture(image, uv) == image.at(x, y));
      CHECK(sample_texture(image, uv + glm::vec2(3, -7)) == image.at(x, y));
    }
  }
}

TEST_CASE("texture: between centres the value is their mean, across the border, too",
          "[scene][texture]") {
  const Image image = numbered();
  CHECK(sample_texture(image, {0.25f, 0.75f}).x == Approx(0.5f));
  CHECK(sample_texture(image, {0.0f, 0.75f}).x == Approx(1.5f));  // of columns 3 and 0
  CHECK(sample_texture(image, {0.125f, 0.5f}).y == Approx(0.5f));
  CHECK(sample_texture(image, {0.125f, 1.0f}).y == Approx(0.5f));  // of rows 0 and 1
}

TEST_CASE("texture: beyond its borders it repeats, ends or is mirrored, along each axis by itself",
          "[scene][texture]") {
  const Image image = numbered();
  const TextureWrap clamp{Wrap::clamp, Wrap::clamp}, mirror{Wrap::mirror, Wrap::mirror};
  CHECK(sample_texture(image, {-3.0f, 0.75f}, clamp) == image.at(0, 0));
  CHECK(sample_texture(image, {1.01f, 9.0f}, clamp) == image.at(3, 0));
  CHECK(sample_texture(image, {0.625f, -1.0f}, clamp) == image.at(2, 1));
  CHECK(sample_texture(image, {0.0f, 0.75f}, clamp).x == 0);
  CHECK(sample_texture(image, {1.125f, 0.75f}, mirror) == image.at(3, 0));
  CHECK(sample_texture(image, {-0.125f, 0.75f}, mirror) == image.at(0, 0));
  CHECK(sample_texture(image, {-0.375f, 0.75f}, mirror) == image.at(1, 0));
  CHECK(sample_texture(image, {2.375f, -0.25f}, mirror) == image.at(1, 1));
  CHECK(sample_texture(image, {1.0f, 0.75f}, mirror).x == 3);
  CHECK(sample_texture(image, {1.125f, 1.75f}, {Wrap::repeat, Wrap::mirror}) == image.at(0, 1));
}

TEST_CASE("texture: unusual coordinates and empty pictures give a finite colour",
          "[scene][texture]") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const float odd : {nan, inf, -inf, 1e30f, -1e30f, 1e-30f, -1e-30f}) {
    const glm::vec3 c = sample_texture(numbered(), {odd, odd});
    CHECK(std::isfinite(c.x + c.y + c.z));
    for (const Wrap wrap : {Wrap::clamp, Wrap::mirror}) {
      const glm::vec3 other = sample_texture(numbered(), {odd, odd}, {wrap, wrap});
      CHECK(std::isfinite(other.x + other.y + other.z));
    }
  }
  CHECK(sample_texture(Image{}, {0.5f, 0.5f}) == glm::vec3(1));
  CHECK_THROWS_AS(Texture(Image{2, 2, {}}), std::invalid_argument);
}

TEST_CASE("panorama: columns wrap around and rows end", "[scene][texture]") {
  const Image image = numbered();
  CHECK(sample_panorama(image, 2.5, 0.5) == image.at(2, 0));
  CHECK(sample_panorama(image, 0, 0.5).x == Approx(1.5f));
  CHECK(sample_panorama(image, 2.5, 0).y == 0);
  CHECK(sample_panorama(image, 2.5, 2).y == 1);
}
