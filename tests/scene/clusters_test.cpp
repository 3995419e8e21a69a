// Grouping surface points into clusters.
#include "engine/scene/sampling/clusters.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

SurfacePoint point(const glm::vec3& position, const glm::vec3& normal, std::uint32_t kind = 0) {
  SurfacePoint p;
  p.position = position;
  p.normal = normal;
  p.area = 0.01;
  p.kind = kind;
  return p;
}

// Returns n x n points of the unit square, row by row.
std::vector<SurfacePoint> square(int n, const glm::vec3& normal, float height,
                                 std::uint32_t kind = 0) {
  std::vector<SurfacePoint> points;
  const auto step = static_cast<float>(n);
  for (int i = 0; i < n * n; ++i) {
    points.push_back(
        point({static_cast<float>(i % n) / step, height, static_cast<float>(i / n) / step}, normal,
              kind));
    points.back().area = 1.0 / (n * n);
  }
  return points;
}

// Returns the clusters of a mesh, all of one patch.
std::vector<Cluster> clusters_of(const Mesh& mesh, double spacing) {
  SamplingOptions options;
  options.spacing = spacing;
  const SpacingField field(options);
  const SurfacePatch patch = SurfacePatches(mesh, field, 1e9).spread(0, 16);
  std::vector<std::uint32_t> owners;
  return cluster_points(patch.points, patch.surfels, 6, owners);
}

// Returns the sum of squared distances from points to their clusters.
double spread(const std::vector<SurfacePoint>& points, const std::vector<Cluster>& clusters,
              const std::vector<std::uint32_t>& owners) {
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const glm::vec3 d = points[i].position - clusters[owners[i]].position;
    sum += static_cast<double>(glm::dot(d, d));
  }
  return sum;
}

}  // namespace

TEST_CASE("clusters: each cluster has members, and their mean is its middle", "[scene][clusters]") {
  const auto points = square(64, {0, 1, 0}, 0);
  std::vector<std::uint32_t> owners;
  const auto clusters = cluster_points(points, 200, 6, owners);
  REQUIRE(clusters.size() == 200);
  REQUIRE(owners.size() == points.size());
  std::vector<glm::dvec3> sums(200, glm::dvec3(0));
  std::vector<int> members(200);
  for (std::size_t i = 0; i < points.size(); ++i) {
    sums[owners[i]] += glm::dvec3(points[i].position);
    ++members[owners[i]];
  }
  for (std::size_t c = 0; c < 200; ++c) {
    REQUIRE(members[c] > 0);
    CHECK(glm::distance(sums[c] / static_cast<double>(members[c]),
                        glm::dvec3(clusters[c].position)) < 1e-6);
    CHECK(glm::length(clusters[c].normal) == Approx(1));
  }
}

TEST_CASE("clusters: rounds make clusters nearly as compact as a regular grid",
          "[scene][clusters]") {
  Mesh mesh = empty_mesh();
  add_quad(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  SamplingOptions options;
  options.spacing = 1.0 / 16;
  const SpacingField field(options);
  const SurfacePatch patch = SurfacePatches(mesh, field, 1e9).spread(0, 16);
  std::vector<std::uint32_t> owners;
  double before = 1e9;
  for (const unsigned rounds : {0u, 2u, 6u}) {
    const auto clusters = cluster_points(patch.points, patch.surfels, rounds, owners);
    const double now =
        spread(patch.points, clusters, owners) / static_cast<double>(patch.points.size());
    CHECK(now < before);
    before = now;
  }
  const double squares = options.spacing * options.spacing / 6;  // mean square in a square cell
  CHECK(before < 1.05 * squares);
}

TEST_CASE("clusters: the owner is the nearest cluster that faces the same way",
          "[scene][clusters]") {
  const auto points = square(48, {0, 1, 0}, 0);
  std::vector<std::uint32_t> owners;
  // Before the last move, the middles equal those of one round fewer.
  std::vector<std::uint32_t> ignored;
  const auto clusters = cluster_points(points, 150, 40, owners);
  int astray = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    float best = 1e9f;
    for (const Cluster& c : clusters)
      best = std::min(best, glm::distance(c.position, points[i].position));
    if (glm::distance(clusters[owners[i]].position, points[i].position) > best * 1.05f + 1e-4f)
      ++astray;
  }
  CHECK(astray < 5);
}

TEST_CASE("clusters: the two sides of a thin wall stay apart", "[scene][clusters]") {
  auto points = square(32, {0, 1, 0}, 0.001f);
  const auto below = square(32, {0, -1, 0}, 0);
  points.insert(points.end(), below.begin(), below.end());
  std::vector<std::uint32_t> owners;
  const auto clusters = cluster_points(points, 64, 6, owners);
  for (std::size_t i = 0; i < points.size(); ++i) {
    CHECK(glm::dot(clusters[owners[i]].normal, points[i].normal) > 0.99f);
  }
}

TEST_CASE("clusters: their borders follow a ridge", "[scene][clusters]") {
  // A roof whose slopes fall by 35 degrees
  constexpr double kSlope = 0.7;
  Mesh mesh = empty_mesh();
  add_quad(mesh, {0, 0, 0}, {0, 0, 1}, {1, kSlope, 0});
  add_quad(mesh, {1, kSlope, 0}, {0, 0, 1}, {1, -kSlope, 0});
  SamplingOptions options;
  options.spacing = 0.05;
  const SpacingField field(options);
  const SurfacePatch patch = SurfacePatches(mesh, field, 1e9).spread(0, 16);
  std::vector<std::uint32_t> owners;
  const auto clusters = cluster_points(patch.points, patch.surfels, 6, owners);
  double astray = 0;  // points whose cluster has its middle on the other slope
  for (std::size_t i = 0; i < patch.points.size(); ++i) {
    const bool left = patch.points[i].position.x < 1;
    if (left != (clusters[owners[i]].position.x < 1)) astray += 1;
  }
  // None is; of clusters that look at the distance alone, 0.4 % of the points are
  CHECK(astray < 0.001 * static_cast<double>(patch.points.size()));
}

TEST_CASE("clusters: points of different kinds stay in different clusters", "[scene][clusters]") {
  auto points = square(32, {0, 1, 0}, 0, 0);
  const auto others = square(32, {0, 1, 0}, 0, 1);
  points.insert(points.end(), others.begin(), others.end());
  std::vector<std::uint32_t> owners;
  const auto clusters = cluster_points(points, 64, 6, owners);
  for (std::size_t i = 0; i < points.size(); ++i) CHECK(clusters[owners[i]].kind == points[i].kind);
}

TEST_CASE("clusters: those inside a surface are enclosed, those at its edges and creases are not",
          "[scene][clusters]") {
  // Fold a sheet of 2 x 1 by a right angle in its middle.
  Mesh mesh = empty_mesh();
  add_quad(mesh, {0, 0, 0}, {0, 0, 1}, {1, 0, 0});
  add_quad(mesh, {1, 0, 0}, {0, 0, 1}, {0, -1, 0});
  const double width = 1.0 / 24;
  int inside = 0, enclosed = 0;
  for (const Cluster& c : clusters_of(mesh, width)) {
    const float along = c.position.x < 0.999F ? c.position.x : 1 - c.position.y;  // 0 to 2
    const auto edge = static_cast<double>(
        std::min({along, std::abs(1 - along), 2 - along, c.position.z, 1 - c.position.z}));
    if (edge < 0.7 * width) CHECK(!c.is_enclosed);
    if (edge < 1.5 * width) continue;
    inside += 1;
    enclosed += c.is_enclosed ? 1 : 0;
  }
  CHECK(inside > 800);
  CHECK(enclosed > 0.95 * inside);
}

TEST_CASE("clusters: a slit of more than half a cluster leaves those next to it open",
          "[scene][clusters]") {
  const double width = 1.0 / 24;
  const auto slit = static_cast<float>(0.6 * width);
  Mesh mesh = empty_mesh();
  add_quad(mesh, {0, 0, 0}, {0, 0, 1}, {1, 0, 0});
  add_quad(mesh, {1 + slit, 0, 0}, {0, 0, 1}, {1, 0, 0});
  int next = 0;
  for (const Cluster& c : clusters_of(mesh, width)) {
    if (static_cast<double>(std::abs(c.position.x - 1 - 0.5F * slit)) > 0.9 * width) continue;
    next += 1;
    CHECK(!c.is_enclosed);
  }
  CHECK(next > 30);
}

TEST_CASE("clusters: coincident points, few points and no points are handled",
          "[scene][clusters]") {
  std::vector<std::uint32_t> owners;
  CHECK(cluster_points({}, 5, 6, owners).empty());
  const std::vector<SurfacePoint> same(100, point({1, 2, 3}, {0, 0, 1}));
  CHECK(cluster_points(same, 0, 6, owners).empty());
  const auto clusters = cluster_points(same, 10, 6, owners);
  REQUIRE(!clusters.empty());
  for (const std::uint32_t owner : owners) REQUIRE(owner < clusters.size());
  for (const Cluster& c : clusters) CHECK(c.position == glm::vec3(1, 2, 3));
  const std::vector<SurfacePoint> three(same.begin(), same.begin() + 3);
  CHECK(cluster_points(three, 10, 6, owners).size() <= 3);
  CHECK(owners.size() == 3);
}

TEST_CASE("clusters: a patch with two densities of points keeps both", "[scene][clusters]") {
  // Put as many points on a square as on one of an eighth of its width next to it.
  auto points = square(64, {0, 1, 0}, 0);
  for (SurfacePoint p : square(64, {0, 1, 0}, 0)) {
    p.position = glm::vec3(1.1f, 0, 0) + 0.125f * p.position;
    p.area /= 64;
    points.push_back(p);
  }
  std::vector<std::uint32_t> owners;
  const auto clusters = cluster_points(points, 512, 6, owners);
  int fine = 0;
  for (const Cluster& c : clusters) fine += c.position.x > 1.05f ? 1 : 0;
  CHECK(fine == Approx(256).margin(4));
}
