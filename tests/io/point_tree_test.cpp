// Points in triangles, and the set of corners that are still to be tested.
#include "engine/io/mesh/point_tree.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <catch2/catch.hpp>

#include "engine/io/mesh/index_set.h"

using namespace ptc;

TEST_CASE("index set: the next number equals that of an ordered set after any changes",
          "[io][triangulate]") {
  std::mt19937 random(3);
  for (const std::size_t size : {1u, 63u, 64u, 65u, 4096u, 4097u, 20'000u}) {
    IndexSet set(size);
    std::set<std::size_t> expected;
    for (std::size_t i = 0; i < size; ++i) expected.insert(expected.end(), i);
    bool same = true;
    for (int step = 0; step < 60'000; ++step) {
      const std::size_t number = random() % size;
      // Mostly erase first, then mostly insert: all numbers of many words come and go.
      const bool erase = random() % 8 < (step < 40'000 ? 7u : 1u);
      erase ? set.erase(number) : set.insert(number);
      erase ? void(expected.erase(number)) : void(expected.insert(number));
      const std::size_t from = random() % (size + 1);
      const auto next = expected.lower_bound(from);
      same =
          same && set.next(from) == (next == expected.end() ? std::nullopt : std::optional(*next));
    }
    CHECK(same);
  }
}

TEST_CASE("point tree: a point is found exactly when a remaining one lies in the triangle",
          "[io][triangulate]") {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(-1, 1);
  bool same = true;
  for (int round = 0; round < 60; ++round) {
    // A third of the clouds lies on a slanted line, except for the rounding of its coordinates.
    const bool line = round % 3 == 0;
    std::vector<glm::dvec2> points;
    for (int i = 0; i < 500; ++i) {
      const double t = unit(random);
      points.emplace_back(line ? glm::dvec2(t, t / 3 + 7) : glm::dvec2(t, unit(random)));
    }
    PointTree tree(points);
    std::set<std::uint32_t> left;
    for (std::uint32_t i = 0; i < points.size(); ++i) left.insert(left.end(), i);
    while (!left.empty()) {
      for (int i = 0; i < 40; ++i) {
        glm::dvec2 a = points[random() % 500], b = points[random() % 500],
                   c = points[random() % 500];
        if (i % 2 == 0) c = a + (b - a) * 0.5 + 1e-3 * glm::dvec2(a.y - b.y, b.x - a.x);  // thin
        if (!(turn(a, b, c) > 0)) continue;
        const auto found = tree.find_in(a, b, c);
        const auto lies = [&](std::uint32_t p) { return lies_in(a, b, c, points[p]); };
        const bool any = std::ranges::any_of(left, lies);
        same =
            same && found.has_value() == any && (!found || (left.contains(*found) && lies(*found)));
      }
      for (int i = 0; i < 40 && !left.empty(); ++i) {
        const auto gone = std::next(left.begin(), static_cast<long>(random() % left.size()));
        tree.remove(*gone);
        left.erase(gone);
      }
    }
  }
  CHECK(same);
  CHECK_FALSE(PointTree({}).find_in({0, 0}, {1, 0}, {0, 1}));
}

TEST_CASE("point tree: few points are visited when many are removed in order",
          "[io][triangulate]") {
  constexpr std::uint32_t kPoints = 4096;
  for (const bool backwards : {false, true}) {
    std::vector<glm::dvec2> points;
    for (std::uint32_t i = 0; i < kPoints; ++i) points.emplace_back(i % 64, i / 64);
    PointTree tree(points);
    std::vector<bool> gone(kPoints);
    std::uint32_t next = 0;  // the next one to be removed
    int found = 0;
    while (const auto point = tree.find_in({-1, -1}, {200, -1}, {-1, 200})) {
      ++found;
      while (!gone[*point]) {
        const std::uint32_t victim = backwards ? kPoints - 1 - next : next;
        tree.remove(victim);
        gone[victim] = true;
        ++next;
      }
    }
    CHECK(next == kPoints);
    CHECK(found < 60);  // 8.9 on the average, were all equally likely
  }
}
