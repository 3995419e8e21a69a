// Splits polygons into triangles by cutting ears. Source: Meisters, "Polygons have ears", 1975.
//
//   c-----------f     An ear is a corner that bulges and whose triangle holds no other corner.
//   |          /      Here b is one, because the triangle a b c is empty. Cutting it off leaves
//   |     d   /       a polygon with one corner less. A simple polygon of more than three
//   |    / \ /        corners always has an ear.
//   b---a   e
//
// Only corners that turn inwards, such as d, can lie in the triangle of another corner, and cutting
// makes no new ones. So they are kept in a k-d tree (PointTree), in which the search for a corner
// in a triangle takes about log n looks.
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

// Appends triangles that all share the first corner.
void fan(std::span<const std::uint32_t> corners, Triangles& triangles) {
  for (std::size_t i = 2; i < corners.size(); ++i) {
    triangles.push_back({corners[0], corners[i - 1], corners[i]});
  }
}

// Returns the polygon as seen along the largest component of its normal, counter-clockwise.
std::vector<glm::dvec2> project(std::span<const glm::dvec3> polygon) {
  // Sum over the edges (Newell): the result is twice the area vector, even for polygons that are
  // not quite flat.
  glm::dvec3 normal(0);
  const glm::dvec3 base = polygon[0];  // differences to it keep digits far from the origin
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

constexpr std::uint32_t kNoMember = 0xffffffff;

// Returns the default number of looks after which the rest of a polygon becomes a fan. A line meets
// about sqrt(n) boxes of a k-d tree over n evenly spread points, and the worst simple polygons that
// we know take that many looks for each corner. 2^34 looks take about a minute.
std::uint64_t usual_most_looks(std::size_t corners) {
  const auto n = static_cast<double>(corners);
  return static_cast<std::uint64_t>(std::min(n * (1024 + 8 * std::sqrt(n)), 0x1p34));
}

// Doubly linked lists of numbers below `members`; each number is in at most one list.
class Lists {
 public:
  Lists(std::size_t lists, std::size_t members)
      : first_(lists, kNoMember), list_of_(members, kNoMember), before_(members), after_(members) {}

  // Moves a member to the front of a list.
  void put(std::uint32_t member, std::uint32_t list) {
    take(member);
    list_of_[member] = list;
    before_[member] = kNoMember;
    after_[member] = first_[list];
    if (first_[list] != kNoMember) before_[first_[list]] = member;
    first_[list] = member;
  }

  // Removes a member from its list, if it is in one.
  void take(std::uint32_t member) {
    if (list_of_[member] == kNoMember) return;
    const std::uint32_t before = before_[member], after = after_[member];
    (before == kNoMember ? first_[list_of_[member]] : after_[before]) = after;
    if (after != kNoMember) before_[after] = before;
    list_of_[member] = kNoMember;
  }

  // Returns the first member of a list, or kNoMember when it is empty.
  [[nodiscard]] std::uint32_t first(std::uint32_t list) const { return first_[list]; }

 private:
  std::vector<std::uint32_t> first_, list_of_, before_, after_;
};

// The corners that turn inwards or go straight on, grouped by place, because several corners may
// lie at one place.
struct InwardCorners {
  std::vector<glm::dvec2> places;         // all different
  std::vector<std::uint32_t> corners_at;  // per place, number of corners that are not cut away
  std::vector<std::uint32_t> place_of;    // per corner of the polygon, its place or kNoMember
};

// Finds the corners that turn inwards. Cutting an ear never turns a bulging corner inwards, so they
// stay the only ones that can lie in an ear.
InwardCorners inward_corners(const std::vector<glm::dvec2>& points) {
  const std::size_t n = points.size();
  InwardCorners inward{.place_of = std::vector<std::uint32_t>(n, kNoMember)};
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

// A polygon that is being cut: a ring of the corners that are left.
//
//   open --> an ear: cut away, its neighbours are open again
//    ^  \--> turns inwards: closed until a neighbour is cut away
//    |   \-> holds an inward corner: closed until all corners there, or a neighbour, are cut away
//    \--------/
//
// Open corners are examined in the order of the ring. A closed corner would give the same answer as
// before, so the triangles are the same as if every corner were examined each time round. Nor do
// they depend on which of several corners in a triangle is found. The one that is found is random,
// so that a triangle is examined about log n times on average before it is empty or gone.
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

  // Cuts ears until three corners are left or no ear is found; the rest becomes a fan.
  TriangulationCounts clip(Triangles& triangles) {
    std::size_t left = points_.size();
    std::uint32_t at = 0;
    for (; left > 3; --left) {
      const std::uint32_t ear = find_ear(at);
      if (ear == kNoMember) break;
      triangles.push_back({previous_[ear], ear, next_[ear]});
      cut(ear);
      at = next_[next_[ear]];  // skip a corner, so that ears do not all share one apex
    }
    std::vector<std::uint32_t> rest;
    for (std::size_t i = 0; i < left; ++i, at = next_[at]) rest.push_back(at);
    fan(rest, triangles);
    return {.looks = looks_ + tree_.looks(), .fan_corners = left > 3 ? left : 0};
  }

 private:
  // Returns the first ear of the ring from a corner on, or kNoMember when there is none or the
  // search takes too many looks. Corners that are no ears are closed.
  std::uint32_t find_ear(std::uint32_t from) {
    while (looks_ + tree_.looks() < max_looks_) {
      auto corner = open_.next(from);
      if (!corner) corner = open_.next(0);
      if (!corner) break;
      const auto i = static_cast<std::uint32_t>(*corner);
      if (is_ear(i)) return i;
      open_.erase(i);
    }
    return kNoMember;
  }

  // Says whether a corner can be cut: its triangle has no area, or it bulges and its triangle holds
  // no other corner. A corner whose triangle holds one waits at the place of that one.
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

  // Cuts a corner away and opens the corners whose answer may change: its neighbours, and those
  // that waited at its place if no corner is left there.
  void cut(std::uint32_t i) {
    next_[previous_[i]] = next_[i];
    previous_[next_[i]] = previous_[i];
    open_.erase(i);
    open_.insert(previous_[i]);
    open_.insert(next_[i]);
    waiting_.take(i);
    const std::uint32_t place = inward_.place_of[i];
    if (place == kNoMember || --inward_.corners_at[place] > 0) return;
    tree_.remove(place);
    for (std::uint32_t k = waiting_.first(place); k != kNoMember; k = waiting_.first(place)) {
      waiting_.take(k);
      open_.insert(k);
    }
  }

  std::vector<glm::dvec2> points_;
  std::vector<std::uint32_t> next_;      // the ring of corners that are left
  std::vector<std::uint32_t> previous_;  // the same ring backwards
  IndexSet open_;                        // corners to examine
  InwardCorners inward_;
  PointTree tree_;  // places of inward corners that are left
  Lists waiting_;   // per place, the corners whose triangle holds it
  std::uint64_t max_looks_;
  std::uint64_t looks_ = 0;
};

// Triangulates four corners as EarClipper does, but without its tables, because most polygons that
// are not triangles have four corners.
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
