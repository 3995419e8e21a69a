// Polygons to triangles by cutting ears. Source: Meisters, "Polygons have ears", 1975.
#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "engine/io/mesh/mesh_soup.h"

namespace ptc {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

void fan(std::span<const std::uint32_t> corners, Triangles& triangles) {
  for (std::size_t i = 2; i < corners.size(); ++i) {
    triangles.push_back({corners[0], corners[i - 1], corners[i]});
  }
}

// Twice the signed area of a triangle in the plane.
double turn(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// The polygon seen along the largest component of its normal, counter-clockwise.
std::vector<glm::dvec2> project(std::span<const glm::dvec3> polygon) {
  // Newell: the sum over edges is twice the area vector, also for polygons that are not quite flat.
  glm::dvec3 normal(0);
  const glm::dvec3 base = polygon[0];  // differences keep digits far from the origin
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    normal += glm::cross(polygon[i] - base, polygon[(i + 1) % polygon.size()] - base);
  }
  const glm::dvec3 size = glm::abs(normal);
  const int drop = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const int u = (drop + 1) % 3;
  const int v = (drop + 2) % 3;
  const double side = normal[drop] < 0 ? -1 : 1;
  std::vector<glm::dvec2> flat;
  flat.reserve(polygon.size());
  for (const glm::dvec3& p : polygon) flat.emplace_back(p[u] - base[u], side * (p[v] - base[v]));
  return flat;
}

// A polygon being cut: a ring of the corners that are left.
class EarClipper {
 public:
  explicit EarClipper(std::vector<glm::dvec2> points)
      : points_(std::move(points)), budget_(2048 * points_.size()) {
    const auto n = static_cast<std::uint32_t>(points_.size());
    next_.resize(n);
    previous_.resize(n);
    for (std::uint32_t i = 0; i < n; ++i) {
      next_[i] = (i + 1) % n;
      previous_[i] = (i + n - 1) % n;
    }
    // Cutting an ear never turns a bulging corner inwards: these stay the only ones that can lie
    // in an ear.
    for (std::uint32_t i = 0; i < n; ++i) {
      if (turn(points_[previous_[i]], points_[i], points_[next_[i]]) <= 0) inward_.push_back(i);
    }
    gone_.resize(n);
  }

  void clip(Triangles& triangles) {
    std::size_t left = points_.size();
    std::uint32_t at = 0;
    std::size_t passed = 0;  // corners in a row that were no ears
    while (left > 3 && passed < left && budget_ > 0) {
      if (!is_ear(at)) {
        at = next_[at];
        ++passed;
        continue;
      }
      triangles.push_back({previous_[at], at, next_[at]});
      gone_[at] = true;
      next_[previous_[at]] = next_[at];
      previous_[next_[at]] = previous_[at];
      at = next_[next_[at]];  // every other corner, so that ears do not share one apex
      passed = 0;
      --left;
    }
    std::vector<std::uint32_t> rest;
    for (std::size_t i = 0; i < left; ++i, at = next_[at]) rest.push_back(at);
    fan(rest, triangles);
  }

 private:
  // A corner that bulges, or has no area, and whose triangle holds no other corner.
  bool is_ear(std::uint32_t i) {
    const glm::dvec2& a = points_[previous_[i]];
    const glm::dvec2& b = points_[i];
    const glm::dvec2& c = points_[next_[i]];
    const double area = turn(a, b, c);
    if (area == 0) return true;
    if (area < 0) return false;
    for (const std::uint32_t k : inward_) {
      if (budget_ > 0) --budget_;
      const glm::dvec2& p = points_[k];
      if (gone_[k]) continue;
      if (p == a || p == b || p == c) continue;
      if (turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) return false;
    }
    return true;
  }

  std::vector<glm::dvec2> points_;
  std::vector<std::uint32_t> next_;
  std::vector<std::uint32_t> previous_;
  std::vector<std::uint32_t> inward_;
  std::vector<bool> gone_;
  std::size_t budget_;  // tests: keeps the work linear in the size of the file
};

}  // namespace

void triangulate(std::span<const glm::dvec3> polygon, Triangles& triangles) {
  if (polygon.size() < 3) return;
  if (polygon.size() == 3) {
    triangles.push_back({0, 1, 2});
    return;
  }
  EarClipper(project(polygon)).clip(triangles);
}

}  // namespace ptc
