// Cutting a mesh into patches and spreading points over them.
#include "engine/scene/sampling/surface_patches.h"

#include <cmath>
#include <map>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

SpacingField constant(double spacing) {
  SamplingOptions options;
  options.spacing = spacing;
  return SpacingField(options);
}

std::vector<SurfacePoint> all_points(const SurfacePatches& patches, unsigned each) {
  std::vector<SurfacePoint> all;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const SurfacePatch patch = patches.spread(i, each);
    CHECK(patch.points.size() == patch.surfels * each);
    all.insert(all.end(), patch.points.begin(), patch.points.end());
  }
  return all;
}

}  // namespace

TEST_CASE("sub-triangle: halves have half the area and share the cut", "[scene][patches]") {
  const Mesh mesh = sphere(1, 5);
  Random random(1);
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    SubTriangle t = whole_triangle(mesh, i);
    for (int depth = 0; depth < 12; ++depth) {
      const SubTriangle a = t.half(false);
      const SubTriangle b = t.half(true);
      CHECK(a.area() == Approx(t.area() / 2).epsilon(1e-9));
      CHECK(b.area() == Approx(t.area() / 2).epsilon(1e-9));
      CHECK(glm::dot(a.normal(), t.normal()) > 0);
      CHECK(a.longest_edge() <= t.longest_edge());
      t = random.unit() < 0.5 ? a : b;
    }
  }
}

TEST_CASE("patches: points lie on their triangle and add up to the area", "[scene][patches]") {
  const Mesh mesh = sphere(1, 20);
  const SpacingField field = constant(0.05);
  const SurfacePatches patches(mesh, field, 500);
  CHECK(patches.size() > 5);
  const auto points = all_points(patches, 8);
  CHECK(points.size() == 8 * patches.surfels());
  double area = 0;
  for (const SurfacePoint& p : points) {
    area += p.area;
    const auto& t = mesh.triangles[p.triangle];
    CHECK((p.uv.x >= 0 && p.uv.y >= 0 && p.uv.x + p.uv.y <= 1));
    const glm::vec3 expected = (1 - p.uv.x - p.uv.y) * mesh.positions[t[0]] +
                               p.uv.x * mesh.positions[t[1]] + p.uv.y * mesh.positions[t[2]];
    CHECK(glm::distance(expected, p.position) < 1e-6f);
    CHECK(glm::dot(p.normal, p.position) > 0.9f);
  }
  CHECK(area == Approx(one_sided_area(mesh)).epsilon(1e-6));
  CHECK(static_cast<double>(patches.surfels()) == Approx(one_sided_area(mesh) / 0.0025).margin(1));
}

TEST_CASE("patches: every part of the surface gets its share of the points", "[scene][patches]") {
  // A unit square of two triangles, and of 200 strips: points per cell of a 20 x 20 grid.
  for (const int n : {1, 200}) {
    Mesh mesh = empty_mesh();
    for (int i = 0; i < n; ++i) {
      const float y = static_cast<float>(i) / static_cast<float>(n);
      add_quad(mesh, {0, y, 0}, {1, 0, 0}, {0, 1 / static_cast<float>(n), 0});
    }
    const SpacingField field = constant(0.01);
    const SurfacePatches patches(mesh, field, 1000);
    std::map<std::pair<int, int>, int> cells;
    for (const SurfacePoint& p : all_points(patches, 16)) {
      ++cells[{std::min(19, static_cast<int>(p.position.x * 20)),
               std::min(19, static_cast<int>(p.position.y * 20))}];
    }
    CHECK(cells.size() == 400);
    for (const auto& [cell, count] : cells) {
      CHECK(count == Approx(400).epsilon(0.1));  // random points: +- 5 % is one deviation
    }
  }
}

TEST_CASE("patches: the index of a patch's first surfel is the number of surfels before it",
          "[scene][patches]") {
  const Mesh mesh = sphere(1, 20);
  const SpacingField field = constant(0.05);
  const SurfacePatches patches(mesh, field, 300);
  std::uint64_t before = 0;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const SurfacePatch patch = patches.spread(i, 1);
    CHECK(patch.first == before);
    CHECK(patch.surfels >= 1);
    before += patch.surfels;
  }
  CHECK(before == patches.surfels());
}

TEST_CASE("patches: spreading a patch again gives the same points", "[scene][patches]") {
  const Mesh mesh = sphere(1, 12);
  const SpacingField field = constant(0.05);
  const SurfacePatches patches(mesh, field, 300);
  const SurfacePatch a = patches.spread(2, 8);
  const SurfacePatch b = patches.spread(2, 8);
  REQUIRE(a.points.size() == b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    CHECK(a.points[i].position == b.points[i].position);
    CHECK(a.points[i].area == b.points[i].area);
  }
}

TEST_CASE("patches: patches are ordered by kind", "[scene][patches]") {
  Mesh mesh = empty_mesh();
  mesh.materials.resize(4);
  mesh.materials[1].emission = glm::vec3(1);
  mesh.materials[2].double_sided = true;
  mesh.materials[3].emission = glm::vec3(1);
  mesh.materials[3].double_sided = true;
  for (std::uint16_t i = 0; i < 40; ++i) {
    add_quad(mesh, {static_cast<float>(i), 0, 0}, {1, 0, 0}, {0, 1, 0},
             static_cast<std::uint16_t>(i % 4));
  }
  const SpacingField field = constant(0.2);
  const SurfacePatches patches(mesh, field, 1e9);
  REQUIRE(patches.size() == 1);
  const SurfacePatch patch = patches.spread(0, 8);
  std::uint32_t last = 0;
  for (const SurfacePoint& p : patch.points) {
    CHECK(p.kind >= last);
    CHECK(p.kind == mesh.material_of[p.triangle]);
    last = p.kind;
  }
  CHECK(last == 3);
}

TEST_CASE("patches: a needle of any length is cut no deeper than a path can record",
          "[scene][patches]") {
  Mesh mesh = empty_mesh();
  add_triangle(mesh, {0, 0, 0}, {1e6f, 0, 0}, {1e6f, 1e-6f, 0});
  const SpacingField field = constant(0.1);  // 50 surfels, 10^7 spacings long
  const SurfacePatches patches(mesh, field, 8192);
  CHECK(patches.surfels() == 50);
  const auto points = all_points(patches, 8);
  double area = 0;
  for (const SurfacePoint& p : points) area += p.area;
  CHECK(area == Approx(0.5).epsilon(1e-5));
}

TEST_CASE("patches: a mesh without area has no patches", "[scene][patches]") {
  Mesh mesh = empty_mesh();
  const SpacingField field = constant(0.1);
  CHECK(SurfacePatches(mesh, field, 100).size() == 0);
  add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {2, 0, 0});
  CHECK(SurfacePatches(mesh, field, 100).surfels() == 0);
}
