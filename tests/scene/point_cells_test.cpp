// Cells of points: what is next to a point is found around its cell.
#include "engine/scene/sampling/point_cells.h"

#include <algorithm>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

// Points in a box, and the group and the reach of each group.
struct Cloud {
  std::vector<SurfacePoint> points;
  std::vector<std::uint32_t> groups;
  std::vector<float> reach;
};

void add(Cloud& cloud, Random& random, int count, const glm::vec3& low, float width, float reach) {
  for (int i = 0; i < count; ++i) {
    SurfacePoint p;
    p.position = low + width * glm::vec3(random.in_box(0, 1));
    cloud.points.push_back(p);
    cloud.groups.push_back(static_cast<std::uint32_t>(cloud.reach.size()));
  }
  cloud.reach.push_back(reach);
}

bool is_around(const PointCells& cells, std::uint32_t cell, std::uint32_t other) {
  const auto around = cells.around(cell);
  return std::any_of(around.begin(), around.end(), [other](const PointCells::Range& range) {
    return range.first <= other && other < range.end;
  });
}

// Checks each pair of points, and returns how many pairs are next to each other.
int check_pairs(const Cloud& cloud) {
  const PointCells cells(cloud.points, cloud.groups, cloud.reach);
  int near = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    for (std::size_t k = 0; k < cloud.points.size(); ++k) {
      const float reach = std::max(cloud.reach[cloud.groups[i]], cloud.reach[cloud.groups[k]]);
      if (glm::distance(cloud.points[i].position, cloud.points[k].position) > 0.9F * reach)
        continue;
      near += 1;
      REQUIRE(is_around(cells, cells.of_point(i), cells.of_point(k)));
    }
  }
  return near;
}

}  // namespace

TEST_CASE("point cells: points within the reach of each other lie in cells around each other",
          "[scene][clusters]") {
  Random random(3);
  Cloud cloud;
  add(cloud, random, 800, glm::vec3(-1), 2, 0.2F);
  CHECK(check_pairs(cloud) > 1000);
}

TEST_CASE("point cells: cells of all levels lie around each other where their points are near",
          "[scene][clusters]") {
  Random random(4);
  Cloud cloud;
  add(cloud, random, 400, glm::vec3(-1), 2, 0.3F);
  add(cloud, random, 400, glm::vec3(-0.2F), 0.5F, 0.04F);
  add(cloud, random, 200, glm::vec3(0.1F), 0.1F, 0.003F);
  CHECK(check_pairs(cloud) > 1000);
}

TEST_CASE("point cells: a position is found in the cell of the points there, and nowhere else",
          "[scene][clusters]") {
  Random random(5);
  Cloud cloud;
  add(cloud, random, 300, glm::vec3(0), 1, 0.1F);
  const PointCells cells(cloud.points, cloud.groups, cloud.reach);
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const std::uint32_t cell = cells.of_point(i);
    REQUIRE(cell < cells.size());
    CHECK(cells.find(cells.level_of(cell), cloud.points[i].position) == cell);
  }
  CHECK(cells.find(0, glm::vec3(5)) == PointCells::kNone);
}
