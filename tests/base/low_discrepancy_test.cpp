// Low-discrepancy sample points.
#include "engine/base/low_discrepancy.h"

#include <cmath>
#include <set>
#include <utility>

#include <catch2/catch.hpp>

using namespace ptc;

TEST_CASE("square points: of 2^k points, one falls into each elementary box of every shape",
          "[base][sampling]") {
  for (const std::uint64_t seed : {0u, 1u, 12345u}) {
    const SquarePoints points(seed);
    for (unsigned k = 0; k <= 6; ++k) {
      const unsigned count = 1u << k;
      for (const unsigned block : {0u, 1u, 5u}) {
        for (unsigned a = 0; a <= k; ++a) {
          std::set<std::pair<int, int>> boxes;
          for (unsigned i = 0; i < count; ++i) {
            const glm::vec2 p = points.square(block * count + i);
            REQUIRE((p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1));
            boxes.insert({static_cast<int>(std::ldexp(p.x, static_cast<int>(a))),
                          static_cast<int>(std::ldexp(p.y, static_cast<int>(k - a)))});
          }
          CHECK(boxes.size() == count);
        }
      }
    }
  }
}

TEST_CASE("square points: the third coordinate is stratified and follows neither of the others",
          "[base][sampling]") {
  const SquarePoints points(7);
  for (unsigned k = 0; k <= 8; ++k) {
    std::set<int> boxes;
    for (unsigned i = 0; i < 1u << k; ++i) {
      boxes.insert(static_cast<int>(std::ldexp(points.line(i), static_cast<int>(k))));
    }
    CHECK(boxes.size() == std::size_t{1} << k);
  }
  double with_x = 0;
  double with_y = 0;
  for (unsigned i = 0; i < 1024; ++i) {
    with_x += (points.line(i) - 0.5) * (static_cast<double>(points.square(i).x) - 0.5) / 1024;
    with_y += (points.line(i) - 0.5) * (static_cast<double>(points.square(i).y) - 0.5) / 1024;
  }
  CHECK(std::abs(with_x) < 0.01);  // 1/12 if they were equal
  CHECK(std::abs(with_y) < 0.01);
}

TEST_CASE("square points: neighbouring seeds give unrelated points", "[base][sampling]") {
  double distance = 0;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    const glm::vec2 a = SquarePoints(seed).square(0);
    const glm::vec2 b = SquarePoints(seed + 1).square(0);
    distance += static_cast<double>(std::abs(a.x - b.x)) / 500;
  }
  CHECK(distance == Approx(1.0 / 3).margin(0.05));
}
