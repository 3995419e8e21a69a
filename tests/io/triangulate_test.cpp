// Cutting polygons into triangles: same area, same winding, nothing outside.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
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

// Checks that the triangles cover the polygon once: oriented areas and sizes have the same sum.
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

// Cuts ears by testing every corner against every other, without any bound on the work.
class PlainClipper {
 public:
  explicit PlainClipper(const Polygon& polygon) : at_(polygon) {
    for (std::uint32_t i = 0; i < polygon.size(); ++i) {
      ring_.push_back(i);
      inward_.push_back(turn(i == 0 ? polygon.size() - 1 : i - 1, i, (i + 1) % polygon.size()) <=
                        0);
    }
  }

  Triangles clip() {
    Triangles triangles;
    std::size_t at = 0;  // place in the ring
    for (std::size_t passed = 0; ring_.size() > 3 && passed < ring_.size();) {
      const std::size_t n = ring_.size();
      const std::uint32_t a = ring_[(at + n - 1) % n], b = ring_[at], c = ring_[(at + 1) % n];
      if (!is_ear(a, b, c)) {
        at = (at + 1) % n;
        ++passed;
        continue;
      }
      triangles.push_back({a, b, c});
      ring_.erase(ring_.begin() + static_cast<std::ptrdiff_t>(at));
      at = (at % (n - 1) + 1) % (n - 1);
      passed = 0;
    }
    std::ranges::rotate(ring_, ring_.begin() + static_cast<std::ptrdiff_t>(at));
    for (std::size_t i = 2; i < ring_.size(); ++i) {
      triangles.push_back({ring_[0], ring_[i - 1], ring_[i]});
    }
    return triangles;
  }

 private:
  [[nodiscard]] double turn(std::size_t a, std::size_t b, std::size_t c) const {
    return (at_[b].x - at_[a].x) * (at_[c].y - at_[a].y) -
           (at_[b].y - at_[a].y) * (at_[c].x - at_[a].x);
  }

  [[nodiscard]] bool is_ear(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    const double area = turn(a, b, c);
    return area == 0 || (area > 0 && std::ranges::none_of(ring_, [&](std::uint32_t p) {
                           const bool corner =
                               at_[p] == at_[a] || at_[p] == at_[b] || at_[p] == at_[c];
                           return inward_[p] && !corner && turn(a, b, p) >= 0 &&
                                  turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
                         }));
  }

  Polygon at_;
  std::vector<std::uint32_t> ring_;
  std::vector<bool> inward_;
};

// Returns the polygon as it is projected: flat, counter-clockwise, its first corner at the origin.
Polygon normal_form(Polygon polygon) {
  if (area_vector(polygon).z < 0) std::ranges::reverse(polygon);
  const glm::dvec3 base = polygon[0];
  for (glm::dvec3& p : polygon) p -= base;
  return polygon;
}

glm::dvec3 on_circle(double turns, double radius) {
  const double angle = 2 * std::numbers::pi * turns;
  return {radius * std::cos(angle), radius * std::sin(angle), 0};
}

// A comb whose teeth have random depths or the same depth.
Polygon comb(std::size_t corners, std::optional<std::uint32_t> seed = {}) {
  Polygon polygon{{0, 0, 0}, {1, 0, 0}};
  std::mt19937 random(seed.value_or(0));
  std::uniform_real_distribution<double> depth(0.05, 0.95);
  const auto teeth = static_cast<double>(corners / 2 - 1);
  for (double i = teeth; i > 0; --i) {
    polygon.emplace_back(i / teeth, 1, 0);
    polygon.emplace_back((i - 0.5) / teeth, seed ? depth(random) : 0.05, 0);
  }
  return polygon;
}

// A corridor along a spiral.
Polygon spiral(std::size_t corners, double turns) {
  Polygon polygon;
  const auto half = static_cast<int>(corners / 2);
  for (int i = 0; i < 2 * half; ++i) {
    const double t = turns * (i < half ? i : 2 * half - 1 - i) / (half - 1);
    polygon.push_back(on_circle(t, t + (i < half ? 1.5 : 1)));
  }
  return polygon;
}

// A star: every other corner lies inwards, or each at random.
Polygon star(std::size_t corners, double inner, std::optional<std::uint32_t> seed = {}) {
  Polygon polygon;
  std::mt19937 random(seed.value_or(0));
  std::uniform_real_distribution<double> radius(inner, 1);
  for (std::size_t i = 0; i < corners; ++i) {
    const double r = seed ? radius(random) : i % 2 == 0 ? 1 : inner;
    polygon.push_back(on_circle(static_cast<double>(i) / static_cast<double>(corners), r));
  }
  return polygon;
}

// A regular polygon with corners along its sides, which lie on a line except for rounding.
Polygon dotted_sides(std::size_t corners, int sides) {
  Polygon polygon;
  const auto each = static_cast<int>(corners) / sides;
  for (int i = 0; i < each * sides; ++i) {
    const glm::dvec3 from = on_circle(0.1 + static_cast<double>(i / each) / sides, 1);
    const glm::dvec3 to = on_circle(0.1 + static_cast<double>(i / each + 1) / sides, 1);
    polygon.push_back(from + (to - from) * (static_cast<double>(i % each) / each));
  }
  return polygon;
}

Polygon noise(std::size_t corners, std::uint32_t places, std::uint32_t seed) {
  Polygon polygon;
  std::mt19937 random(seed);
  for (std::size_t i = 0; i < corners; ++i) {
    polygon.emplace_back(random() % places, random() % places, 0);
  }
  return polygon;
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

TEST_CASE("triangulate: triangles and their order equal those of testing every pair of corners",
          "[io][triangulate]") {
  std::mt19937 random(7);
  std::vector<Polygon> polygons;
  for (std::uint32_t i = 0; i < 60; ++i) {
    const std::size_t corners = 4 + random() % (i < 40 ? 30 : 400);
    polygons.insert(polygons.end(), {comb(corners, i), spiral(corners, 1 + i % 7),
                                     star(corners, 0.1, i), dotted_sides(corners, 3),
                                     noise(corners, 2 + i % 6, i), noise(corners, 1000, i)});
  }
  for (std::uint32_t i = 0; i < 4000; ++i) polygons.push_back(noise(4, 3, i));
  std::size_t different = 0;
  for (const Polygon& polygon : polygons) {
    if (area_vector(polygon).z == 0) continue;  // it has no front
    const Polygon p = normal_form(polygon);
    Triangles triangles;
    triangulate(p, triangles);
    different += triangles != PlainClipper(p).clip();
  }
  CHECK(different == 0);
}

TEST_CASE("triangulate: half a million corners are covered once with few tests",
          "[io][triangulate]") {
  constexpr std::size_t kCorners = 500'000;
  const double line = 8 * std::log2(kCorners);
  const auto check = [&](const Polygon& polygon, double max_looks) {
    Triangles triangles;
    const TriangulationCounts counts = triangulate(polygon, triangles);
    CHECK(triangles.size() == polygon.size() - 2);
    CHECK(counts.fan_corners == 0);
    CHECK(static_cast<double>(counts.looks) < max_looks * kCorners);
    double size = 0;
    for (const auto& [a, b, c] : triangles) {
      size += glm::length(glm::cross(polygon[b] - polygon[a], polygon[c] - polygon[a])) / 2;
    }
    CHECK(size == Approx(glm::length(area_vector(polygon))).epsilon(1e-9));
  };
  check(comb(kCorners), line);
  check(spiral(kCorners, 10), line);
  check(spiral(kCorners, 1000), line);
  check(star(kCorners, 0.5), line);
  check(star(kCorners, 1), line);  // a circle
  check(dotted_sides(kCorners, 3), line);
  check(dotted_sides(kCorners, 700), line);
  check(star(kCorners, 0.1, 1), 2 * std::sqrt(kCorners));
}

TEST_CASE("triangulate: a self-intersecting polygon of half a million corners takes few tests",
          "[io][triangulate]") {
  constexpr std::size_t kCorners = 500'000;
  Polygon rose, walk{glm::dvec3(0)};
  std::mt19937 random(8);
  for (std::size_t i = 0; i < kCorners; ++i) {
    const double t = static_cast<double>(i) / kCorners;
    rose.push_back(on_circle(777 * t, 1 + 0.5 * std::sin(3000 * t)));
    walk.push_back(walk.back() + on_circle(1e-9 * static_cast<double>(random()), 1));
  }
  for (const Polygon& polygon :
       {noise(kCorners, 1 << 30, 1), noise(kCorners, 3, 1), rose, walk, Polygon(kCorners)}) {
    Triangles triangles;
    const TriangulationCounts counts = triangulate(polygon, triangles);
    CHECK(triangles.size() == polygon.size() - 2);
    CHECK(static_cast<double>(counts.looks) < 8 * std::log2(kCorners) * kCorners);
  }
}

TEST_CASE("triangulate: after the maximum of tests the rest becomes a fan", "[io][triangulate]") {
  const Polygon polygon = star(2000, 0.1, 1);
  Triangles all;
  const TriangulationCounts whole = triangulate(polygon, all);
  for (const std::uint64_t most : {std::uint64_t{0}, whole.looks / 2, whole.looks / 10 * 9}) {
    Triangles triangles;
    const TriangulationCounts counts = triangulate(polygon, triangles, most);
    CHECK(triangles.size() == all.size());
    CHECK(counts.looks <= whole.looks);
    CHECK(counts.fan_corners > 3);
    // The ears are the same up to that point.
    const auto ears = static_cast<std::ptrdiff_t>(polygon.size() - counts.fan_corners);
    CHECK(std::equal(triangles.begin(), triangles.begin() + ears, all.begin()));
  }
}

TEST_CASE("triangulate: fewer than three corners give no triangle, random ones still end",
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
