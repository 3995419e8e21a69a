// verify_container() and trees that the builder would not build.
#include <algorithm>

#include <catch2/catch.hpp>

#include "engine/octree/octree.h"
#include "engine/store/writer.h"
#include "format/point_page.h"
#include "format/scalar.h"
#include "tests/support/scenes.h"
#include "tests/verify/damage.h"

namespace ptc::test {
namespace {

/// Writes points under a tree of one group, whose leaves have these numbers of points.
void write_flat_tree(const std::filesystem::path& target, const SortedScene& scene, int level,
                     const std::vector<std::uint32_t>& runs) {
  ContainerWriter writer(target, {.page_shift = 12, .codec = Codec::raw, .frame = scene.frame});
  const MortonKey first = scene.records.front().key;
  NodeGroup group{.cell = cell_of(first, level), .level = level};
  std::uint64_t at = 0;
  for (const std::uint32_t run : runs) {
    const auto points = std::span(scene.records).subspan(at, run);
    group.children.push_back(
        {{.first_point = at, .point_count = run}, summarise_points(points, scene.frame.unit())});
    at += run;
  }
  Superblock superblock;
  superblock.leaf_points = 8;
  superblock.points = scene.records.size();
  superblock.nodes = runs.size();
  superblock.node_groups = 1;
  superblock.levels = static_cast<std::uint16_t>(level + 1);
  superblock.root_page = 0;
  superblock.bounds_low = superblock.bounds_high = scene.frame.to_position(decode_morton(first));
  for (const PointRecord& point : scene.records) {
    const std::array<double, 3> position = scene.frame.to_position(decode_morton(point.key));
    const double area = 2.0 * static_cast<double>(point.radius) * static_cast<double>(point.radius);
    superblock.area += area;
    for (std::size_t k = 0; k < 3; ++k) {
      superblock.bounds_low[k] = std::min(superblock.bounds_low[k], position[k]);
      superblock.bounds_high[k] = std::max(superblock.bounds_high[k], position[k]);
      superblock.flux[k] += area * static_cast<double>(decode_half(point.radiance[k]));
    }
  }
  writer.write_page({.type = PageType::point,
                     .rank = writer.reserve_page(PageType::point),
                     .record_count = static_cast<std::uint32_t>(scene.records.size()),
                     .first_key = first.high,
                     .last_key = scene.records.back().key.high},
                    encode_point_page(scene.records, kPointBytes));
  NodePageEncoder page(4032);
  page.add(group);
  writer.write_page({.type = PageType::node,
                     .rank = writer.reserve_page(PageType::node),
                     .level = static_cast<std::uint8_t>(level),
                     .record_count = 1,
                     .first_key = group.cell.high,
                     .last_key = group.cell.high},
                    page.take());
  writer.finish({}, superblock);
}

}  // namespace

TEST_CASE("verify: a tree that splits where the rules do not is found", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  std::vector<Surfel> surfels = random_surfels(32, 11);
  std::erase_if(surfels,
                [](const Surfel& s) { return s.position.x > 0.45 && s.position.y > 0.45; });
  const SortedScene scene = sort_scene(surfels);
  std::vector<std::uint32_t> octants;  // points in each occupied octant of the root cell
  int last = -1;
  for (const PointRecord& point : scene.records) {
    if (octant(point.key, 1) != last) octants.push_back(0);
    ++octants.back();
    last = octant(point.key, 1);
  }
  REQUIRE(octants.size() < 8);
  REQUIRE(octants.size() > 2);
  REQUIRE(*std::ranges::max_element(octants) <= 8);
  using Catch::Matchers::Contains;

  write_flat_tree(path, scene, 0, octants);
  CHECK(fault_of(path) == "");
  for (std::size_t i = 0; i < octants.size(); ++i) {
    if (octants[i] < 2) continue;
    std::vector<std::uint32_t> split = octants;  // one octant in two leaves
    --split[i];
    split.insert(split.begin() + static_cast<std::ptrdiff_t>(i), 1);
    write_flat_tree(path, scene, 0, split);
    CHECK_THAT(fault_of(path), Contains("spec/nodes.md#node-children"));
  }
  std::vector<std::uint32_t> joined = octants;  // two octants in one leaf
  joined[0] = std::min(8U, joined[0] + joined[1]);
  joined[1] = octants[0] + octants[1] - joined[0];
  if (joined[1] == 0) joined.erase(joined.begin() + 1);
  write_flat_tree(path, scene, 0, joined);
  CHECK_THAT(fault_of(path), Contains("spec/nodes.md#node-children"));

  SortedScene few = scene;  // points of two octants, but no more than a leaf holds
  const std::uint32_t both = octants[0] + octants[1];
  REQUIRE(both <= 8);
  few.records.resize(both);
  write_flat_tree(path, few, 0, {both});
  CHECK(fault_of(path) == "");
  write_flat_tree(path, few, 0, {octants[0], octants[1]});
  CHECK_THAT(fault_of(path), Contains("spec/nodes.md#node-leaf"));
}

}  // namespace ptc::test
