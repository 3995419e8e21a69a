// The sky map: where its pixels lie, and the light that they give.
#include <algorithm>
#include <cmath>
#include <memory>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/light/sky_map.h"
#include "engine/scene/sampling/directions.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

Image black(unsigned width, unsigned height) {
  return {width, height, std::vector<glm::vec3>(std::size_t{width} * height, glm::vec3(0))};
}

std::shared_ptr<const Texture> map_of(const Image& image) {
  return std::make_shared<const Texture>(image);
}

void set(Image& image, unsigned x, unsigned y, const glm::vec3& value) {
  image.pixels[std::size_t{y} * image.width + x] = value;
}

// Returns the solid angle of a pixel.
double pixel_sr(const Image& image, unsigned y) {
  const double top = std::cos(kPiDouble * y / image.height);
  const double bottom = std::cos(kPiDouble * (y + 1) / image.height);
  return (top - bottom) * 2 * kPiDouble / image.width;
}

Image noise(unsigned width, unsigned height, Random& random) {
  Image image{width, height, {}};
  for (std::size_t i = 0; i < std::size_t{width} * height; ++i) {
    const auto level = static_cast<float>(std::exp(random.between(-3, 4)));
    image.pixels.push_back(glm::vec3(level, 0.5f * level, 1));
  }
  return image;
}

// Returns the integral of radiance times cosine over the hemisphere around a normal, by a fine
// grid.
glm::dvec3 integral(const Sky& sky, const glm::vec3& normal) {
  glm::dvec3 sum(0);
  const int rows = 800;
  for (int i = 0; i < rows; ++i) {
    const double y = 1 - 2 * (i + 0.5) / rows;
    const double flat = std::sqrt(1 - y * y);
    for (int j = 0; j < 2 * rows; ++j) {
      const double turn = kPiDouble * (j + 0.5) / rows;
      const glm::vec3 d(glm::dvec3(flat * std::sin(turn), y, flat * std::cos(turn)));
      const double cosine = static_cast<double>(glm::dot(d, normal));
      if (cosine > 0) sum += cosine * glm::dvec3(sky.at(d));
    }
  }
  return sum * (4 * kPiDouble / (2.0 * rows * rows));
}

}  // namespace

TEST_CASE("sky map: with +y up, columns face -z, +x, +z, -x and the top row the zenith",
          "[scene][sky]") {
  Sky sky;
  sky.radiance = glm::vec3(1);
  // Light two pixels, so that the border between them, at column x, is brightest.
  const auto brightest = [&](unsigned x, unsigned y) {
    Image map = black(8, 4);
    set(map, x, y, glm::vec3(1));
    set(map, (x + 7) % 8, y, glm::vec3(1));
    sky.map = map_of(map);
  };
  brightest(0, 1);
  CHECK(sky.at(glm::normalize(glm::vec3(0, 0.4f, -1))).x > 0.9f);
  CHECK(sky.at(glm::normalize(glm::vec3(0, 0.4f, 1))).x == 0);
  brightest(2, 1);
  CHECK(sky.at(glm::normalize(glm::vec3(1, 0.4f, 0))).x > 0.9f);
  brightest(4, 2);
  CHECK(sky.at(glm::normalize(glm::vec3(0, -0.4f, 1))).x > 0.9f);
  brightest(6, 2);
  CHECK(sky.at(glm::normalize(glm::vec3(-1, -0.4f, 0))).x > 0.9f);
  Image map = black(8, 4);
  for (unsigned x = 0; x < 8; ++x) set(map, x, 0, glm::vec3(x == 0 ? 2.0f : 1.0f));
  sky.map = map_of(map);
  CHECK(sky.at({0, 1, 0}).x >= 1);
  CHECK(sky.at({0, -1, 0}).x == 0);
}

TEST_CASE("sky map: another up direction turns the map by the smallest rotation", "[scene][sky]") {
  Image map = black(64, 32);
  set(map, 32, 16, glm::vec3(1));
  set(map, 31, 16, glm::vec3(1));
  set(map, 32, 15, glm::vec3(1));
  set(map, 31, 15, glm::vec3(1));  // the middle: looks along +z with +y up
  Sky sky;
  sky.radiance = glm::vec3(2);
  sky.map = map_of(map);
  sky.up = {0, 1, 0};
  CHECK(sky.at({0, 0, 1}).x == Approx(2));
  sky.up = {0, 0, 1};  // a turn about x: +z goes to -y
  CHECK(sky.at({0, -1, 0}).x == Approx(2));
  sky.up = {1, 0, 0};  // a turn about z
  CHECK(sky.at({0, 0, 1}).x == Approx(2));
  sky.up = {0, -1, 0};  // half a turn about x
  CHECK(sky.at({0, 0, -1}).x == Approx(2));
}

TEST_CASE("sky map: place and direction are inverse to each other", "[scene][sky]") {
  Random random(1);
  for (int i = 0; i < 500; ++i) {
    glm::vec3 up = random.direction();
    if (i == 0) up = {0, -1, 0};
    if (i == 1) up = {0, 1, 0};
    if (i == 2) up = glm::normalize(glm::vec3(1e-4f, -1, 0));
    const SkyOrientation orientation(up);
    const glm::vec3 direction = random.direction();
    const glm::dvec2 place = orientation.place_of(direction);
    CHECK((place.x >= 0 && place.x < 1 && place.y >= 0 && place.y <= 1));
    CHECK(glm::distance(orientation.direction_at(place), direction) < 1e-5f);
    CHECK(std::cos(kPiDouble * place.y) ==
          Approx(static_cast<double>(glm::dot(up, direction))).margin(1e-6));
  }
}

TEST_CASE("sky map: without a map the radiance is the same everywhere", "[scene][sky]") {
  Sky sky;
  sky.radiance = {1, 2, 3};
  CHECK(sky.at({0, -1, 0}) == glm::vec3(1, 2, 3));
}

TEST_CASE("sky map: one bright pixel gives its radiance times solid angle times cosine",
          "[scene][sky]") {
  const Mesh mesh = ground(100);
  const RayScene scene(mesh);
  for (const unsigned row : {2u, 10u, 24u, 30u}) {
    Image map = black(128, 64);
    set(map, 77, row, glm::vec3(1000, 100, 0));
    LightRig rig;
    rig.sky.radiance = glm::vec3(1, 2, 3);
    rig.sky.map = map_of(map);
    const DirectLight light(scene, rig);
    const double cosine = std::cos(kPiDouble * (row + 0.5) / 64);
    const double expected = 1000 * pixel_sr(map, row) * cosine;
    double mean = 0;
    double squares = 0;
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      const auto result = light.irradiance({0, 0, 0}, {0, 1, 0}, {}, seed);
      mean += static_cast<double>(result.sky.x) / 100;
      squares += static_cast<double>(result.sky.x * result.sky.x) / 100;
      CHECK(result.sky.y == Approx(0.2f * result.sky.x).epsilon(1e-4));
      CHECK(result.sky.z == 0);
    }
    CHECK(mean == Approx(expected).epsilon(0.02));
    CHECK(squares - mean * mean < 1e-3 * expected * expected);  // importance sampling finds it
  }
}

TEST_CASE("sky map: a bright pixel below the horizon gives no light", "[scene][sky]") {
  const Mesh mesh = ground(1000);
  const RayScene scene(mesh);
  Image map = black(64, 32);
  set(map, 10, 20, glm::vec3(1000));
  LightRig rig;
  rig.sky.radiance = glm::vec3(1);
  rig.sky.map = map_of(map);
  CHECK(DirectLight(scene, rig).irradiance({0, 0, 0}, {0, 1, 0}, {}, 1).sky == glm::vec3(0));
}

TEST_CASE("sky map: any map and any tilt give the integral of radiance times cosine",
          "[scene][sky]") {
  Random random(2);
  const Mesh mesh = empty_mesh();
  const RayScene scene(mesh);
  for (int i = 0; i < 6; ++i) {
    LightRig rig;
    rig.sky.radiance = {1, 0.5f, 2};
    rig.sky.map = map_of(noise(i < 4 ? 16 : 1, i % 2 == 0 ? 8 : 1, random));
    rig.sky.up = random.direction();
    const DirectLight light(scene, rig);
    const glm::vec3 normal = random.direction();
    const glm::dvec3 expected = integral(rig.sky, normal);
    glm::dvec3 mean(0);
    for (std::uint64_t seed = 0; seed < 500; ++seed) {
      mean += glm::dvec3(light.irradiance({0, 0, 0}, normal, {}, seed).sky) / 500.0;
    }
    for (int k = 0; k < 3; ++k) CHECK(mean[k] == Approx(expected[k]).epsilon(0.02));
  }
}

TEST_CASE("sky density: it integrates to 1, and samples follow the density that they report",
          "[scene][sky]") {
  Random random(3);
  Sky sky;
  sky.radiance = glm::vec3(1);
  sky.map = map_of(noise(12, 7, random));
  sky.up = random.direction();
  const SkyDensity density(sky);
  const int count = 200000;
  double integral_of_one = 0;
  for (int i = 0; i < count; ++i) {
    integral_of_one +=
        static_cast<double>(density.density(random.direction())) * 4 * kPiDouble / count;
  }
  CHECK(integral_of_one == Approx(1).epsilon(0.02));
  for (int i = 0; i < 2000; ++i) {
    const auto sample = density.sample(glm::vec2(random.in_box(0, 0.9999999)));
    CHECK(glm::length(sample.direction) == Approx(1).epsilon(1e-5));
    CHECK(sample.density > 0);
  }
}

TEST_CASE("sky density: on a large map, pixels of one block are drawn by their own brightness",
          "[scene][sky]") {
  Image map = black(4096, 1024);
  set(map, 1001, 512, glm::vec3(1));
  set(map, 1003, 512, glm::vec3(3));
  Sky sky;
  sky.radiance = glm::vec3(1);
  sky.map = map_of(map);
  CHECK(SkyDensity::bytes(sky) == 1024 * (1024 * 4 + 16));  // blocks of four pixels
  const SkyDensity density(sky);
  const SkyOrientation orientation(sky.up);
  Random random(5);
  int first = 0, second = 0;
  const int count = 20'000;
  for (int i = 0; i < count; ++i) {
    const auto sample = density.sample(glm::vec2(random.in_box(0, 0.9999999)));
    const double column = orientation.place_of(sample.direction).x * 4096 - 0.5;
    if (std::abs(column - 1001) < 0.999) ++first;
    if (std::abs(column - 1003) < 0.999) ++second;
  }
  CHECK(first + second > 0.99 * count);
  CHECK(first == Approx(0.25 * count).epsilon(0.05));
}

TEST_CASE("sky density: a black map gives no light and no division by zero", "[scene][sky]") {
  const Mesh mesh = ground(1);
  const RayScene scene(mesh);
  LightRig rig;
  rig.sky.radiance = glm::vec3(1);
  rig.sky.map = map_of(black(16, 8));
  CHECK(DirectLight(scene, rig).irradiance({0, 0, 0}, {0, 1, 0}, {}, 1).sky == glm::vec3(0));
}

TEST_CASE("sky: a smooth sky has the light of its map, and its places", "[scene][sky]") {
  Random random(7);
  const auto flux = [](const Texture& map) {
    glm::dvec3 sum(0), moment(0);
    const Image shape{map.width(), map.height(), {}};
    const SkyOrientation orientation({0, 1, 0});
    for (unsigned y = 0; y < map.height(); ++y) {
      for (unsigned x = 0; x < map.width(); ++x) {
        const glm::dvec3 light = glm::dvec3(map.at(x, y)) * pixel_sr(shape, y);
        const glm::dvec2 place((x + 0.5) / map.width(), (y + 0.5) / map.height());
        sum += light;
        moment += light.x * glm::dvec3(orientation.direction_at(place));
      }
    }
    return std::pair(sum, moment / sum.x);
  };
  // Sizes that are no multiples of one another, and a sun of one pixel
  for (const auto& [width, height] : {std::pair(500U, 250U), std::pair(333U, 200U),
                                      std::pair(100U, 1000U), std::pair(700U, 40U)}) {
    Image image = noise(width, height, random);
    set(image, width / 3, height / 4, glm::vec3(1e6F));
    const Sky sharp{.radiance = glm::vec3(2), .map = map_of(image)};
    const Sky smooth = smooth_sky(sharp);
    REQUIRE(smooth.map->width() == std::min(width, 128U));
    REQUIRE(smooth.map->height() == std::min(height, 64U));
    const auto [all, middle] = flux(*sharp.map);
    const auto [kept, kept_middle] = flux(*smooth.map);
    for (int c = 0; c < 3; ++c) CHECK(kept[c] == Approx(all[c]).epsilon(1e-5));
    CHECK(glm::distance(middle, kept_middle) < 0.03);
    CHECK(smooth.radiance == sharp.radiance);
  }
  // What is no wider stays
  const Sky small{.radiance = glm::vec3(1), .map = map_of(noise(64, 32, random))};
  CHECK(smooth_sky(small, 64).map == small.map);
  CHECK(smooth_sky({.radiance = glm::vec3(1)}, 64).map == nullptr);
  const Sky even{.radiance = glm::vec3(1),
                 .map = map_of({300, 150, std::vector<glm::vec3>(300 * 150, glm::vec3(0.7F))})};
  const Sky evened = smooth_sky(even);
  for (unsigned y = 0; y < 64; ++y) {
    for (unsigned x = 0; x < 128; x += 9) CHECK(evened.map->at(x, y).g == Approx(0.7));
  }
}
