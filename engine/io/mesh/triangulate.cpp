// Polygons to triangles by cutting ears. Source: Meisters, "Polygons have ears", 1975.
#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/io/mesh/index_set.h"
#include "engine/io/mesh/mesh_soup.h"
#include "engine/io/mesh/point_tree.h"

namespace ptc {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

void fan(std::span<const std::uint32_t> corners, Triangles& triangles) {
  for (std::size_t i = 2; i < corners.size(); ++i) {
    triangles.push_back({corners[0], corners[i - 1], corners[i]});
  }
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

constexpr std::uint32_t kNone = 0xffffffff;

// Looks before what is left becomes a fan. A line meets some sqrt(n) boxes of a k-d tree over n
// evenly spread points, which is what the worst simple polygons that we know take for each corner.
// 2^34 looks take about a minute.
std::uint64_t usual_most_looks(std::size_t corners) {
  const auto n = static_cast<double>(corners);
  return static_cast<std::uint64_t>(std::min(n * (1024 + 8 * std::sqrt(n)), 0x1p34));
}

// Numbers below `members` in lists, each in one at most.
class Lists {
 public:
  Lists(std::size_t lists, std::size_t members)
      : first_(lists, kNone), list_of_(members, kNone), before_(members), after_(members) {}

  void put(std::uint32_t member, std::uint32_t list) {
    take(member);
    list_of_[member] = list;
    before_[member] = kNone;
    after_[member] = first_[list];
    if (first_[list] != kNone) before_[first_[list]] = member;
    first_[list] = member;
  }

  void take(std::uint32_t member) {
    if (list_of_[member] == kNone) return;
    const std::uint32_t before = before_[member], after = after_[member];
    (before == kNone ? first_[list_of_[member]] : after_[before]) = after;
    if (after != kNone) before_[after] = before;
    list_of_[member] = kNone;
  }

  // kNone when the list is empty.
  [[nodiscard]] std::uint32_t first(std::uint32_t list) const { return first_[list]; }

 private:
  std::vector<std::uint32_t> first_, list_of_, before_, after_;
};

// The corners that turn inwards or go straight on, by place: many may share one.
struct InwardCorners {
  std::vector<glm::dvec2> places;
  std::vector<std::uint32_t> corners_at;  // of each place, those that are not cut away
  std::vector<std::uint32_t> place_of;    // of each corner of the polygon, or kNone
};

// Cutting an ear never turns a bulging corner inwards: these stay the only ones that can lie in an
// ear.
InwardCorners inward_corners(const std::vector<glm::dvec2>& points) {
  const std::size_t n = points.size();
  InwardCorners inward{.place_of = std::vector<std::uint32_t>(n, kNone)};
  std::vector<std::uint32_t> corners;
  for (std::uint32_t i = 0; i < n; ++i) {
    if (turn(points[(i + n - 1) % n], points[i], points[(i + 1) % n]) <= 0) corners.push_back(i);
  }
  std::ranges::sort(corners, {},
                    [&](std::uint32_t i) { return std::pair(points[i].x, points[i].y); });
  for (const std::uint32_t i : corners) {
    if (inward.places.empty() || inward.places.back() != points[i]) {
      inward.places.push_back(points[i]);
      inward.corners_at.push_back(0);
    }
    inward.place_of[i] = static_cast<std::uint32_t>(inward.places.size() - 1);
    ++inward.corners_at.back();
  }
  return inward;
}

// A polygon being cut: a ring of the corners that are left.
//
//   open --> an ear: cut away, its neighbours are open again
//    ^  \--> turns inwards: closed until a neighbour is cut away
//    |   \-> holds an inward corner: closed until all corners there, or a neighbour, are cut away
//    \--------/
//
// Open corners are asked in the order of the ring. Closed ones would give the same answer as
// before, so that the triangles are those of asking every corner each time round. They do not
// depend on which of the corners in a triangle is found, either. That is one at random, so that a
// triangle is asked about log n times on the average until it is empty or gone.
class EarClipper {
 public:
  EarClipper(std::vector<glm::dvec2> points, std::uint64_t max_looks)
      : points_(std::move(points)),
        next_(points_.size()),
        previous_(points_.size()),
        open_(points_.size()),
        inward_(inward_corners(points_)),
        tree_(inward_.places),
        waiting_(inward_.places.size(), points_.size()),
        max_looks_(max_looks) {
    const auto n = static_cast<std::uint32_t>(points_.size());
    for (std::uint32_t i = 0; i < n; ++i) {
      next_[i] = (i + 1) % n;
      previous_[i] = (i + n - 1) % n;
    }
  }

  TriangulationCounts clip(Triangles& triangles) {
    std::size_t left = points_.size();
    std::uint32_t at = 0;
    for (; left > 3; --left) {
      const std::uint32_t ear = find_ear(at);
      if (ear == kNone) break;
      triangles.push_back({previous_[ear], ear, next_[ear]});
      cut(ear);
      at = next_[next_[ear]];  // every other corner, so that ears do not share one apex
    }
    std::vector<std::uint32_t> rest;
    for (std::size_t i = 0; i < left; ++i, at = next_[at]) rest.push_back(at);
    fan(rest, triangles);
    return {.looks = looks_ + tree_.looks(), .fan_corners = left > 3 ? left : 0};
  }

 private:
  // The first ear of the ring from a corner on; kNone when there is none or it takes too long.
  std::uint32_t find_ear(std::uint32_t from) {
    while (looks_ + tree_.looks() < max_looks_) {
      auto corner = open_.next(from);
      if (!corner) corner = open_.next(0);
      if (!corner) break;
      const auto i = static_cast<std::uint32_t>(*corner);
      if (is_ear(i)) return i;
      open_.erase(i);
    }
    return kNone;
  }

  // A corner that bulges, or has no area, and whose triangle holds no other corner.
  bool is_ear(std::uint32_t i) {
    ++looks_;
    const glm::dvec2& a = points_[previous_[i]];
    const glm::dvec2& b = points_[i];
    const glm::dvec2& c = points_[next_[i]];
    const double area = turn(a, b, c);
    if (area == 0) return true;
    if (area < 0) return false;
    const auto place = tree_.find_in(a, b, c);
    if (place) waiting_.put(i, *place);
    return !place;
  }

  void cut(std::uint32_t i) {
    next_[previous_[i]] = next_[i];
    previous_[next_[i]] = previous_[i];
    open_.erase(i);
    open_.insert(previous_[i]);
    open_.insert(next_[i]);
    waiting_.take(i);
    const std::uint32_t place = inward_.place_of[i];
    if (place == kNone || --inward_.corners_at[place] > 0) return;
    tree_.remove(place);
    for (std::uint32_t k = waiting_.first(place); k != kNone; k = waiting_.first(place)) {
      waiting_.take(k);
      open_.insert(k);
    }
  }

  std::vector<glm::dvec2> points_;
  std::vector<std::uint32_t> next_;
  std::vector<std::uint32_t> previous_;
  IndexSet open_;
  InwardCorners inward_;
  PointTree tree_;
  Lists waiting_;  // of each place, the corners whose triangle holds it
  std::uint64_t max_looks_;
  std::uint64_t looks_ = 0;
};

// What EarClipper makes of four corners, without its tables: most polygons have so many.
TriangulationCounts cut_quad(const std::vector<glm::dvec2>& points, Triangles& triangles) {
  for (std::uint32_t i = 0; i < 4; ++i) {
    const std::uint32_t next = (i + 1) % 4, far = (i + 2) % 4, previous = (i + 3) % 4;
    const glm::dvec2 &a = points[previous], &b = points[i], &c = points[next], &d = points[far];
    const double area = turn(a, b, c);
    const bool blocked = turn(c, d, a) <= 0 && lies_in(a, b, c, d);
    if (area < 0 || (area > 0 && blocked)) continue;
    triangles.push_back({previous, i, next});
    triangles.push_back({far, previous, next});
    return {.looks = 2 * (i + 1)};
  }
  fan(std::array<std::uint32_t, 4>{0, 1, 2, 3}, triangles);
  return {.looks = 8, .fan_corners = 4};
}

}  // namespace

TriangulationCounts triangulate(std::span<const glm::dvec3> polygon, Triangles& triangles,
                                std::optional<std::uint64_t> max_looks) {
  if (polygon.size() < 3) return {};
  if (polygon.size() == 3) {
    triangles.push_back({0, 1, 2});
    return {};
  }
  std::vector<glm::dvec2> flat = project(polygon);
  if (flat.size() == 4) return cut_quad(flat, triangles);
  const std::uint64_t most = max_looks.value_or(usual_most_looks(flat.size()));
  return EarClipper(std::move(flat), most).clip(triangles);
}

}  // namespace ptc
