// Polygons to triangles: same area, same winding, nothing outside.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/mesh/mesh_soup.h"

using namespace ptc;

namespace {

using Polygon = std::vector<glm::dvec3>;
using Triangles = std::vector<std::array<std::uint32_t, 3>>;

glm::dvec3 area_vector(const Polygon& p) {
  glm::dvec3 sum(0);
  for (std::size_t i = 0; i < p.size(); ++i) sum += glm::cross(p[i], p[(i + 1) % p.size()]);
  return sum / 2.0;
}

// The triangles cover the polygon once: the oriented areas and the sizes have the same sum.
void check_cover(const Polygon& polygon) {
  Triangles triangles;
  triangulate(polygon, triangles);
  CHECK(triangles.size() == polygon.size() - 2);
  glm::dvec3 oriented(0);
  double size = 0;
  for (const auto& [a, b, c] : triangles) {
    const glm::dvec3 area = area_vector({polygon[a], polygon[b], polygon[c]});
    oriented += area;
    size += glm::length(area);
  }
  const glm::dvec3 expected = area_vector(polygon);
  CHECK(glm::length(oriented - expected) < 1e-9 * glm::length(expected));
  CHECK(size == Approx(glm::length(expected)).epsilon(1e-9));
}

Polygon turned(const Polygon& polygon, int how) {
  Polygon other = polygon;
  for (glm::dvec3& p : other) {
    if (how % 3 == 1) p = {p.y, p.z, p.x};
    if (how % 3 == 2) p = {p.z, p.x, p.y};
  }
  if (how >= 3) std::ranges::reverse(other);
  return other;
}

}  // namespace

TEST_CASE(
    "triangulate: concave polygons are covered once, in every orientation and from every corner",
    "[io][triangulate]") {
  const std::vector<Polygon> polygons = {
      {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}},
      {{0, 0, 0}, {4, 0, 0}, {1, 1, 0}, {0, 4, 0}},                        // a dart
      {{0, 0, 0}, {4, 0, 0}, {4, 1, 0}, {1, 1, 0}, {1, 4, 0}, {0, 4, 0}},  // an L
      {{0, 0, 0}, {6, 0, 0}, {6, 4, 0}, {4, 4, 0}, {4, 1, 0}, {2, 1, 0}, {2, 4, 0}, {0, 4, 0}},
      {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {3, 3, 0}, {0, 3, 0}},  // on a line
      // A square with a hole, joined by a bridge that is walked twice.
      {{0, 0, 0},
       {9, 0, 0},
       {9, 9, 0},
       {0, 9, 0},
       {0, 0, 0},
       {3, 3, 0},
       {3, 6, 0},
       {6, 6, 0},
       {6, 3, 0},
       {3, 3, 0}}};
  for (const Polygon& polygon : polygons) {
    for (int how = 0; how < 6; ++how) {
      Polygon p = turned(polygon, how);
      for (std::size_t first = 0; first < p.size(); ++first) {
        check_cover(p);
        std::rotate(p.begin(), p.begin() + 1, p.end());
      }
    }
  }
}

TEST_CASE("triangulate: random stars of any number of corners are covered once",
          "[io][triangulate]") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> radius(0.1, 1);
  for (int corners = 3; corners < 60; ++corners) {
    Polygon polygon;
    for (int i = 0; i < corners; ++i) {
      const double angle = 2 * std::numbers::pi * i / corners;
      const double r = radius(random);
      polygon.emplace_back(1e7 + r * std::cos(angle), r * std::sin(angle),
                           0.5 * r * std::cos(angle));
    }
    for (glm::dvec3& p : polygon) p.x -= 1e7;
    check_cover(polygon);
  }
}

TEST_CASE("triangulate: what is no polygon gives no triangle, what is no simple one still ends",
          "[io][triangulate]") {
  Triangles triangles;
  triangulate({}, triangles);
  triangulate(Polygon{{0, 0, 0}, {1, 0, 0}}, triangles);
  CHECK(triangles.empty());
  triangulate(Polygon(1000, glm::dvec3(1)), triangles);
  CHECK(triangles.size() == 998);
  triangles.clear();
  Polygon noise;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 20'000; ++i) noise.emplace_back(unit(random), unit(random), 0);
  triangulate(noise, triangles);
  CHECK(triangles.size() == 19'998);
  for (const auto& triangle : triangles) {
    CHECK(*std::ranges::max_element(triangle) < 20'000);
  }
}
