// The procedural city.
#include "engine/scene/procedural/city.h"

#include <cmath>
#include <set>
#include <utility>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/scene/procedural/city_block.h"
#include "engine/scene/ray_scene.h"
#include "tests/scene/coverage.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

bool holds(const Bounds& bounds, const glm::dvec3& p) {
  return p.x >= bounds.low.x && p.y >= bounds.low.y && p.z >= bounds.low.z &&
         p.x <= bounds.high.x && p.y <= bounds.high.y && p.z <= bounds.high.z;
}

std::uint64_t count_points(std::uint64_t wanted) {
  const auto city = make_city(wanted);
  std::vector<Surfel> block(65536);
  std::uint64_t count = 0;
  while (const std::size_t n = city->next(block)) count += n;
  return count;
}

// Returns true when a triangle of the point's colour and normal contains it, to a millimetre.
bool is_on(const Mesh& mesh, const Surfel& s) {
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& t = mesh.triangles[i];
    const glm::dvec3 a(mesh.positions[t[0]]);
    const glm::dvec3 ab = glm::dvec3(mesh.positions[t[1]]) - a;
    const glm::dvec3 ac = glm::dvec3(mesh.positions[t[2]]) - a;
    const glm::dvec3 n = glm::cross(ab, ac);
    const double twice = glm::length(n);
    const glm::dvec3 to = s.position - a;
    if (std::abs(glm::dot(to, n)) > 1e-3 * twice) continue;
    if (glm::dot(n, glm::dvec3(s.normal)) < 0.999 * twice) continue;
    const double u = glm::dot(glm::cross(to, ac), n) / (twice * twice);
    const double v = glm::dot(glm::cross(ab, to), n) / (twice * twice);
    if (std::min({u, v, 1 - u - v}) < -1e-3) continue;
    if (mesh.materials[mesh.material_of[i]].albedo == s.albedo) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("city: the number of points is met within 5 %", "[scene][city]") {
  for (const std::uint64_t wanted :
       {1000u, 3000u, 10'000u, 17'000u, 30'000u, 100'000u, 250'000u, 1'000'000u, 5'000'000u}) {
    CHECK(static_cast<double>(count_points(wanted)) ==
          Approx(static_cast<double>(wanted)).epsilon(0.05));
  }
  CHECK(count_points(0) == 0);
  CHECK(count_points(1) >= 1);
}

TEST_CASE("city: the same count gives the same points, whatever the block", "[scene][city]") {
  const auto first = make_city(50'000);
  const auto second = make_city(50'000);
  const std::vector<Surfel> a = drain(*first, 1);
  const std::vector<Surfel> b = drain(*second, 9999);
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].position != b[i].position || a[i].radius != b[i].radius)
      FAIL("point " << i << " differs");
  }
}

TEST_CASE("city: points are valid surfels inside the bounds", "[scene][city]") {
  for (const std::uint64_t count : {1u, 100u, 5000u, 200'000u}) {
    const Bounds bounds = city_bounds(count);
    const auto city = make_city(count);
    for (const Surfel& s : drain(*city)) {
      const bool is_sound = holds(bounds, s.position) &&
                            std::abs(glm::length(s.normal) - 1) < 1e-5f && s.radius > 0 &&
                            s.radiance.x >= 0 && s.albedo.x > 0 && s.albedo.x <= 1;
      if (!is_sound)
        FAIL("point at " << s.position.x << " " << s.position.y << " " << s.position.z);
    }
  }
  CHECK(city_bounds(0).empty());
}

TEST_CASE("city: points lie on the mesh, with its normals and colours", "[scene][city]") {
  for (const std::uint64_t count : {2000u, 60'000u}) {
    const Mesh mesh = city_mesh(count);
    const auto city = make_city(count);
    const std::vector<Surfel> points = drain(*city);
    for (std::size_t i = 0; i < points.size(); i += 23) {
      if (!is_on(mesh, points[i])) FAIL("point " << i << " of " << points.size());
    }
  }
}

TEST_CASE("city: the discs add up to the mesh's area", "[scene][city]") {
  for (const std::uint64_t count : {10'000u, 300'000u}) {
    const auto city = make_city(count);
    CHECK(covered_area(drain(*city)) == Approx(one_sided_area(city_mesh(count))).epsilon(0.005));
  }
}

TEST_CASE("city: vertices lie inside the bounds, and every facet faces out of its solid",
          "[scene][city]") {
  const Bounds bounds = city_bounds(300'000);
  for (const glm::vec3& p : city_mesh(300'000).positions) {
    if (!holds(bounds, glm::dvec3(p))) FAIL("vertex at " << p.x << " " << p.y << " " << p.z);
  }
  // No back side is visible from high above.
  const Mesh mesh = city_mesh(100'000);
  const RayScene scene(mesh);
  Random random(1);
  for (int i = 0; i < 5000; ++i) {
    const glm::dvec3 from(random.between(-20, 20), 100, random.between(-20, 20));
    const glm::vec3 down =
        glm::normalize(glm::vec3(random.between(-0.3, 0.3), -1, random.between(-0.3, 0.3)));
    const auto hit = scene.closest(from, down, 0, 1e9);
    if (hit && !hit->front)
      FAIL("a back side from above at " << hit->position.x << " " << hit->position.z);
  }
}

TEST_CASE("city: the ground and the walls are covered as by a regular sampling", "[scene][city]") {
  const Mesh mesh = city_mesh(100'000);
  const auto city = make_city(100'000);
  const Coverage c = measure_coverage(mesh, drain(*city), 0.25, 50'000);
  INFO("uncovered " << c.uncovered << ", hole " << c.largest_hole);
  CHECK(c.uncovered < 0.08);  // points are jittered, and small facets share points
}

TEST_CASE("city: the spiral visits every block of a square once", "[scene][city]") {
  std::set<std::pair<std::int64_t, std::int64_t>> places;
  for (std::int64_t ring = 0; ring < 30; ++ring) {
    const auto end = static_cast<std::uint64_t>((2 * ring + 1) * (2 * ring + 1));
    while (places.size() < end) {
      const BlockPlace place = block_place(places.size());
      REQUIRE(std::max(std::abs(place.column), std::abs(place.row)) == ring);
      REQUIRE(places.insert({place.column, place.row}).second);
    }
  }
  for (const std::uint64_t far : {std::uint64_t{1} << 40, (std::uint64_t{1} << 50) - 1}) {
    const BlockPlace place = block_place(far);
    const auto ring =
        static_cast<std::uint64_t>(std::max(std::abs(place.column), std::abs(place.row)));
    CHECK((2 * ring - 1) * (2 * ring - 1) <= far);
    CHECK(far < (2 * ring + 1) * (2 * ring + 1));
  }
}

TEST_CASE("city: blocks differ, and each is the same every time", "[scene][city]") {
  const auto a = build_block({3, 4});
  const auto again = build_block({3, 4});
  const auto b = build_block({4, 3});
  REQUIRE(a.size() == again.size());
  for (std::size_t i = 0; i < a.size(); ++i) CHECK(a[i].corner == again[i].corner);
  CHECK((a.size() != b.size() || a[200].corner != b[200].corner));
}

TEST_CASE("city: points come block by block", "[scene][city]") {
  const auto city = make_city(300'000);
  std::set<std::pair<std::int64_t, std::int64_t>> left;
  std::pair<std::int64_t, std::int64_t> current{0, 0};
  for (const Surfel& s : drain(*city)) {
    const std::pair<std::int64_t, std::int64_t> block(std::llround(s.position.x / kBlockMetres),
                                                      std::llround(s.position.z / kBlockMetres));
    if (block == current) continue;
    left.insert(current);
    current = block;
    if (left.count(block) > 0) FAIL("back to block " << block.first << " " << block.second);
  }
  CHECK(left.size() > 5);
}

TEST_CASE("city: a mesh too large for its indices is refused", "[scene][city]") {
  CHECK_THROWS_AS(city_mesh(std::uint64_t{1} << 62), RequestError);
}
