// LDR-FLIP, compared with formulas for plain colours, a second implementation, and expectations.
#include "tools/bench/chart/flip.h"

#include <cmath>
#include <random>
#include <stdexcept>

#include <catch2/catch.hpp>
#include <glm/vec3.hpp>

#include "tests/bench/chart/flip_oracle.h"

using namespace ptc;

namespace {

Image plain(glm::vec3 colour, unsigned width = 9, unsigned height = 7) {
  return {width, height, std::vector<glm::vec3>(std::size_t{width} * height, colour)};
}

Image noise(unsigned width, unsigned height, unsigned seed) {
  std::mt19937 bits(seed);
  const auto next = [&] { return static_cast<float>(bits() >> 8) / 16777216.0F; };
  Image image = plain({}, width, height);
  for (glm::vec3& pixel : image.pixels) {
    pixel.x = next();
    pixel.y = next();
    pixel.z = next();
  }
  return image;
}

Image checkerboard(unsigned side) {
  Image image = plain({}, side, side);
  for (unsigned i = 0; i < side * side; ++i) {
    image.pixels[i] = glm::vec3((i % side + i / side) % 2 == 0 ? 1.0F : 0.0F);
  }
  return image;
}

// Returns the error of two plain colours, from L* a* b* in tables of sRGB colours.
double error_of_lab(glm::dvec3 a, glm::dvec3 b) {
  const auto distance = [](glm::dvec3 p, glm::dvec3 q) {
    return std::abs(p.x - q.x) +
           std::hypot(p.x / 100 * p.y - q.x / 100 * q.y, p.x / 100 * p.z - q.x / 100 * q.z);
  };
  const glm::dvec3 green(87.7347, -86.1827, 83.1793);
  const glm::dvec3 blue(32.2970, 79.1875, -107.8602);
  const double most = std::pow(distance(green, blue), 0.7);
  const double share = std::pow(distance(a, b), 0.7) / most;
  return share < 0.4 ? share * 0.95 / 0.4 : 0.95 + 0.05 * (share - 0.4) / 0.6;
}

// Checks that every pixel has this error.
void check_error(const Image& test, const Image& reference, double expected) {
  for (const float error : flip(test, reference)) {
    REQUIRE(static_cast<double>(error) == Approx(expected).margin(2e-5));
  }
}

}  // namespace

TEST_CASE("flip: equal pictures have an error of exactly 0", "[chart][flip]") {
  const Image image = noise(23, 11, 1);
  for (const float error : flip(image, image)) REQUIRE(error == 0);
  CHECK(mean_flip(plain(glm::vec3(0.3F)), plain(glm::vec3(0.3F))) == 0);
}

TEST_CASE("flip: the order of the two pictures does not matter", "[chart][flip]") {
  const Image a = noise(23, 11, 1);
  const Image b = noise(23, 11, 2);
  CHECK(flip(a, b) == flip(b, a));
  CHECK(mean_flip(a, b) == mean_flip(b, a));
}

TEST_CASE("flip: plain colours have the error that follows from tables of L* a* b*",
          "[chart][flip]") {
  const glm::dvec3 black(0);
  const glm::dvec3 white(100, 0, 0);
  const glm::dvec3 red(53.2408, 80.0925, 67.2032);
  const glm::dvec3 yellow(97.1393, -21.5537, 94.4780);
  check_error(plain({0, 1, 0}), plain({0, 0, 1}), 1);
  check_error(plain({0, 0, 0}), plain({1, 1, 1}), error_of_lab(black, white));
  check_error(plain({1, 0, 0}), plain({1, 1, 0}), error_of_lab(red, yellow));
  check_error(plain({1, 0, 0}), plain({0, 0, 0}), error_of_lab(red, black));
  // Below the bend: L* of 0.2 is 116 * 0.2^(1/3) - 16 = 51.8372, of 0.21 52.9498.
  const double grey = error_of_lab({51.8372, 0, 0}, {52.9498, 0, 0});
  CHECK(grey == Approx(0.0620).margin(1e-4));
  check_error(plain(glm::vec3(0.2F)), plain(glm::vec3(0.21F)), grey);
}

TEST_CASE("flip: black against white is 0.967, green against blue exactly 1", "[chart][flip]") {
  CHECK(mean_flip(plain({0, 0, 0}), plain({1, 1, 1})) == Approx(0.96738).margin(1e-5));
  CHECK(mean_flip(plain({0, 1, 0}), plain({0, 0, 1})) == 1);
}

TEST_CASE("flip: the error of noise equals direct sums over all neighbours", "[chart][flip]") {
  for (const float pixels_per_degree : {10.0F, 31.5F, 67.0F}) {
    const Image a = noise(17, 12, 3);
    Image b = a;
    for (std::size_t i = 60; i < 90; ++i) b.pixels[i] = {0.1F, 0.8F, 0.4F};
    const std::vector<float> ours = flip(a, b, pixels_per_degree);
    const std::vector<double> oracle = flip_oracle(a, b, static_cast<double>(pixels_per_degree));
    REQUIRE(ours.size() == oracle.size());
    for (std::size_t i = 0; i < ours.size(); ++i) {
      REQUIRE(static_cast<double>(ours[i]) == Approx(oracle[i]).margin(1e-4));
    }
  }
}

TEST_CASE("flip: from farther away a checkerboard looks more like grey", "[chart][flip]") {
  double before = 1;
  for (const float pixels_per_degree : {5.0F, 10.0F, 20.0F, 40.0F, 80.0F}) {
    const double error =
        mean_flip(checkerboard(48), plain(glm::vec3(0.5F), 48, 48), pixels_per_degree);
    CHECK(error < before);
    before = error;
  }
  CHECK(before < 0.3);
}

TEST_CASE("flip: a thin line counts as a feature beyond its colour", "[chart][flip]") {
  const Image grey = plain(glm::vec3(0.4F), 41, 41);
  Image line = grey;
  for (unsigned y = 0; y < 41; ++y) line.pixels[41 * y + 20] = glm::vec3(0.5F);
  const std::size_t middle = std::size_t{41} * 20 + 20;
  const double error = static_cast<double>(flip(line, grey)[middle]);
  // The blur of the achromatic channel leaves the weight of its middle from the step.
  double sum = 0;
  for (int i = -10; i <= 10; ++i) sum += std::exp(-9.8696 * i * i / (67 * 67 * 0.0047));
  const auto left = static_cast<float>(0.4 + 0.1 / sum);
  const double colour = mean_flip(plain(glm::vec3(left)), plain(glm::vec3(0.4F)));
  CHECK(error > 1.3 * colour);
  CHECK(error < 1.5 * colour);
  CHECK(flip(line, grey)[middle - 20] == 0);
}

TEST_CASE("flip: values outside [0, 1] are clamped, and NaN is black", "[chart][flip]") {
  CHECK(mean_flip(plain({-1, 2, NAN}), plain({0, 1, 0})) == 0);
  CHECK(mean_flip(plain({INFINITY, -INFINITY, 1}), plain({1, 0, 1})) == 0);
}

TEST_CASE("flip: pictures smaller than the filters are compared", "[chart][flip]") {
  check_error(plain({0, 1, 0}, 1, 1), plain({0, 0, 1}, 1, 1), 1);
  CHECK(flip(noise(1, 30, 1), noise(1, 30, 2)).size() == 30);
  CHECK(flip(noise(30, 1, 1), noise(30, 1, 2), 1000).size() == 30);
}

TEST_CASE("flip: different sizes, empty pictures and impossible pixels per degree are refused",
          "[chart][flip]") {
  const Image image = plain({}, 4, 3);
  CHECK_THROWS_AS(flip(image, plain({}, 3, 4)), std::invalid_argument);
  CHECK_THROWS_AS(flip(image, plain({}, 4, 2)), std::invalid_argument);
  CHECK_THROWS_AS(flip(image, {4, 3, {}}), std::invalid_argument);
  CHECK_THROWS_AS(flip({4, 3, {}}, image), std::invalid_argument);
  CHECK_THROWS_AS(flip({}, {}), std::invalid_argument);
  const std::vector<glm::vec3> twelve(12);
  CHECK_THROWS_AS(flip(image, {3, 3, twelve}), std::invalid_argument);
  CHECK_THROWS_AS(flip(image, {4, 2, twelve}), std::invalid_argument);
  for (const float eyes : {0.0F, 0.9F, 1001.0F, -67.0F, NAN, INFINITY}) {
    CHECK_THROWS_AS(flip(image, image, eyes), std::invalid_argument);
  }
}

TEST_CASE("hdr flip: equal pictures have an error of exactly 0, even black ones", "[chart][flip]") {
  const Image image = noise(40, 30, 3);
  for (const float error : hdr_flip(image, image)) REQUIRE(error == 0);
  for (const float error : hdr_flip(plain({}), plain({}))) REQUIRE(error == 0);
}

TEST_CASE("hdr flip: twice the light in both pictures changes nothing", "[chart][flip]") {
  const auto scaled = [](Image image, float factor) {
    for (glm::vec3& pixel : image.pixels) pixel *= factor;
    return image;
  };
  const Image a = noise(40, 30, 3), b = noise(40, 30, 4);
  CHECK(mean_of(hdr_flip(scaled(a, 1024), scaled(b, 1024))) ==
        Approx(mean_of(hdr_flip(a, b))).epsilon(1e-3));
}

TEST_CASE("hdr flip: what is brighter or darker than a screen shows still counts",
          "[chart][flip]") {
  // A lamp of 100 beside a wall of 1: an error of either is seen at one of the exposures
  Image reference = plain(glm::vec3(1), 40, 30);
  for (std::size_t i = 0; i < 400; ++i) reference.pixels[i] = glm::vec3(100);
  Image lamp = reference, wall = reference;
  for (std::size_t i = 0; i < 400; ++i) lamp.pixels[i] = glm::vec3(50);
  for (std::size_t i = 400; i < 1200; ++i) wall.pixels[i] = glm::vec3(0.5F);
  CHECK(mean_flip(lamp, reference) == 0);
  CHECK(hdr_flip(lamp, reference).front() > 0.1F);
  CHECK(hdr_flip(wall, reference).back() > 0.1F);
  CHECK(hdr_flip(wall, reference).front() < 0.1F);
  CHECK_THROWS_AS(hdr_flip(lamp, plain(glm::vec3(1), 30, 40)), std::invalid_argument);
}
