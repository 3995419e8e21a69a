#include "engine/scan/sky_view.h"

#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "format/morton.h"
#include "tests/scan/clouds.h"

namespace ptc::test {
namespace {

/// Returns the view from a cloud of places in a cube of 1.
SkyView view_of(const std::vector<glm::dvec3>& places, const std::array<float, 3>& up) {
  SkyView view;
  for (const glm::dvec3& p : places) {
    const double unit = std::ldexp(1.0, kLatticeBits);
    view.add({p.x * unit, p.y * unit, p.z * unit});
  }
  view.finish(up);
  return view;
}

int more(const SkyView& view, const glm::dvec3& p, const std::array<float, 3>& normal) {
  const double unit = std::ldexp(1.0, kLatticeBits);
  return view.more_in_front({p.x * unit, p.y * unit, p.z * unit}, normal);
}

/// Returns a square grid of places in the plane of two axes, the third being `at`.
void add_square(std::vector<glm::dvec3>& places, int axis, double at, double low, double high) {
  for (int u = 0; u < 200; ++u) {
    for (int v = 0; v < 200; ++v) {
      glm::dvec3 p(at);
      p[(axis + 1) % 3] = low + (high - low) * (u + 0.5) / 200;
      p[(axis + 2) % 3] = low + (high - low) * (v + 0.5) / 200;
      places.push_back(p);
    }
  }
}

/// Adds a wall or roof of a house to a cloud: an axis-parallel rectangle whose points are random.
void add_rectangle(TrueCloud& cloud, const glm::dvec3& corner, const glm::dvec3& u,
                   const glm::dvec3& v, const glm::dvec3& normal, double per_area, Random& random) {
  const double area = glm::length(u) * glm::length(v);
  for (int i = 0; i < static_cast<int>(area * per_area); ++i)
    cloud.push_back({corner + random.uniform() * u + random.uniform() * v, normal});
}

}  // namespace

TEST_CASE("sky view: the upper side of the ground sees all of it, the lower one nothing",
          "[scan][sky]") {
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<glm::dvec3> places;
    add_square(places, axis, 0.4, 0, 1);
    std::array<float, 3> up{};
    up[static_cast<std::size_t>(axis)] = 1;
    const SkyView view = view_of(places, up);
    std::array<float, 3> down{};
    down[static_cast<std::size_t>(axis)] = -1;
    glm::dvec3 middle(0.5);
    middle[axis] = 0.4;
    CHECK(more(view, middle, up) == 16);
    CHECK(more(view, middle, down) == -16);
    glm::dvec3 edge = middle;
    edge[(axis + 1) % 3] = 0.001;
    CHECK(more(view, edge, up) == 16);
  }
}

TEST_CASE("sky view: the sides of a lone wall see alike", "[scan][sky]") {
  std::vector<glm::dvec3> places;
  add_square(places, 0, 0.5, 0.1, 0.9);
  const SkyView view = view_of(places, {0, 0, 1});
  CHECK(more(view, {0.5, 0.5, 0.5}, {1, 0, 0}) == 0);
  CHECK(std::abs(more(view, {0.5, 0.5, 0.5}, {0.8F, 0, 0.6F})) <= 16);
}

TEST_CASE("sky view: from under a roof less is seen, and from inside of a box nothing",
          "[scan][sky]") {
  std::vector<glm::dvec3> places;
  add_square(places, 2, 0.7, 0.2, 0.8);
  for (const double at : {0.2, 0.8}) {
    for (const int axis : {0, 1}) {
      std::vector<glm::dvec3> wall;
      add_square(wall, axis, at, 0.2, 0.8);
      for (const glm::dvec3& p : wall) {
        if (p.z < 0.7) places.push_back(p);
      }
    }
  }
  const SkyView view = view_of(places, {0, 0, 1});
  // It is open below.
  CHECK(more(view, {0.8, 0.5, 0.4}, {1, 0, 0}) >= 6);
  CHECK(more(view, {0.8, 0.5, 0.4}, {-1, 0, 0}) <= -6);
  CHECK(more(view, {0.5, 0.5, 0.7}, {0, 0, 1}) == 16);
  CHECK(more(view, {0.2, 0.5, 0.25}, {1, 0, 0}) <= -6);
}

TEST_CASE("sky view: the outside of a house is in the open, its inside is not", "[scan][sky]") {
  std::vector<glm::dvec3> places;
  add_square(places, 2, 0.05, 0, 1);  // the ground
  for (const double at : {0.3, 0.7}) {
    add_square(places, 0, at, 0.3, 0.7);
    add_square(places, 1, at, 0.3, 0.7);
  }
  add_square(places, 2, 0.7, 0.3, 0.7);  // the roof
  const SkyView view = view_of(places, {0, 0, 1});
  const auto side = [&](const glm::dvec3& p, const std::array<float, 3>& normal) {
    const double unit = std::ldexp(1.0, kLatticeBits);
    return view.open_side({p.x * unit, p.y * unit, p.z * unit}, normal);
  };
  CHECK(side({0.3, 0.5, 0.5}, {-1, 0, 0}) == 1);
  CHECK(side({0.3, 0.5, 0.5}, {1, 0, 0}) == -1);
  CHECK(side({0.5, 0.7, 0.5}, {0, 1, 0}) == 1);
  CHECK(side({0.5, 0.5, 0.7}, {0, 0, -1}) == -1);
  CHECK(side({0.5, 0.5, 0.7}, {0.7071F, 0, 0.7071F}) == 1);
  CHECK(side({0.3, 0.5, 0.3}, {0, 0, 1}) == 0);  // along the wall, air is on both sides
}

TEST_CASE("orientation: houses without floors on the ground turn outwards", "[scan][orientation]") {
  // Four houses of different heights; the ground ends at their walls.
  Random random(3);
  TrueCloud cloud, ground;
  const double density = 400;  // of a square unit: the spacing is 0.05
  add_rectangle(ground, {-8, -8, 0}, {16, 0, 0}, {0, 16, 0}, {0, 0, 1}, density, random);
  for (const double x : {-5.0, 2.0}) {
    for (const double y : {-5.0, 2.0}) {
      const double w = 3, h = 2 + (x + 5) / 7 + (y + 5) / 3.5;
      add_rectangle(cloud, {x, y, 0}, {w, 0, 0}, {0, 0, h}, {0, -1, 0}, density, random);
      add_rectangle(cloud, {x, y + w, 0}, {w, 0, 0}, {0, 0, h}, {0, 1, 0}, density, random);
      add_rectangle(cloud, {x, y, 0}, {0, w, 0}, {0, 0, h}, {-1, 0, 0}, density, random);
      add_rectangle(cloud, {x + w, y, 0}, {0, w, 0}, {0, 0, h}, {1, 0, 0}, density, random);
      add_rectangle(cloud, {x, y, h}, {w, 0, 0}, {0, w, 0}, {0, 0, 1}, density, random);
      std::erase_if(ground, [&](const SurfacePointTruth& p) {
        return p.position.x > x && p.position.x < x + w && p.position.y > y && p.position.y < y + w;
      });
    }
  }
  cloud.insert(cloud.end(), ground.begin(), ground.end());
  const RawScan scan = raw_scan(cloud);
  const Completed completed = complete(scan);
  CHECK(compare(cloud, scan, completed.records).flipped < 0.01);
  CHECK(completed.report.islands == 0);
}

TEST_CASE("orientation: a pit faces the sky, though its shape is nearly closed",
          "[scan][orientation]") {
  Random random(4);
  TrueCloud cloud;
  const double density = 10'000, h = 0.4;  // the spacing is 0.01
  add_rectangle(cloud, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, density, random);
  add_rectangle(cloud, {0, 0, 0}, {1, 0, 0}, {0, 0, h}, {0, 1, 0}, density, random);
  add_rectangle(cloud, {0, 1, 0}, {1, 0, 0}, {0, 0, h}, {0, -1, 0}, density, random);
  add_rectangle(cloud, {0, 0, 0}, {0, 1, 0}, {0, 0, h}, {1, 0, 0}, density, random);
  add_rectangle(cloud, {1, 0, 0}, {0, 1, 0}, {0, 0, h}, {-1, 0, 0}, density, random);
  const RawScan scan = raw_scan(cloud);
  CHECK(compare(cloud, scan, complete(scan).records).flipped < 0.01);
}

}  // namespace ptc::test
