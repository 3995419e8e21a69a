#include "engine/octree/octree.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "format/scalar.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// A sink that keeps groups; references count up in page and slot.
struct KeptGroups {
  std::vector<NodeGroup> groups;
  ChildRef add(const NodeGroup& group) {
    groups.push_back(group);
    const std::size_t i = groups.size() - 1;
    return {.interior = true,
            .page = static_cast<std::uint32_t>(i / 100),
            .slot = static_cast<std::uint16_t>(i % 100)};
  }
  [[nodiscard]] const NodeGroup& at(const ChildRef& ref) const {
    return groups.at(ref.page * 100 + ref.slot);
  }
};

struct Tree {
  KeptGroups sink;
  NodeChild root;
};

Tree build(const std::vector<PointRecord>& records, std::uint32_t leaf_points, double unit) {
  Tree tree;
  SubtreeBuilder builder(leaf_points, unit);
  tree.root = builder.build(
      records, 0, 0, [&](const NodeGroup& group, std::uint64_t) { return tree.sink.add(group); });
  return tree;
}

/// A sink that keeps what a builder emits, with group numbers as references, as SubtreeGroups does.
struct Emitted : GroupSink {
  SubtreeGroups out;
  ChildRef add(const GroupView& group, std::uint64_t end) override {
    const std::span<const std::byte> content = group.bytes();
    out.groups.push_back({out.bytes.size(), content.size(), end});
    out.bytes.insert(out.bytes.end(), content.begin(), content.end());
    return {.interior = true, .page = static_cast<std::uint32_t>(out.groups.size() - 1)};
  }
};

/// The groups and the result of one builder that is given `block` points at a time.
std::pair<SubtreeGroups, OctreeBuilder::Result> streamed(std::span<const PointRecord> records,
                                                         std::uint32_t leaf_points,
                                                         std::size_t block, unsigned threads) {
  Emitted sink;
  const ThreadPool executor(threads);
  OctreeBuilder builder(sink, leaf_points, 1.0, executor);
  for (; records.size() > block; records = records.subspan(block))
    builder.add(records.first(block));
  builder.add(records);
  const OctreeBuilder::Result result = builder.finish();
  return {std::move(sink.out), result};
}

bool equal(const SubtreeGroups& a, const SubtreeGroups& b) {
  return std::ranges::equal(
      a.groups, b.groups, [&](const SubtreeGroups::Group& x, const SubtreeGroups::Group& y) {
        const std::size_t size = std::min(x.size, y.size);  // the padded one is longer
        return x.end == y.end && std::ranges::equal(std::span(a.bytes).subspan(x.begin, size),
                                                    std::span(b.bytes).subspan(y.begin, size));
      });
}

/// Returns the leaves of the octree by its top-down definition, as (first, count), in order.
void expected_leaves(const std::vector<PointRecord>& records, std::uint64_t first,
                     std::uint64_t count, std::uint32_t leaf_points,
                     std::vector<std::pair<std::uint64_t, std::uint64_t>>& leaves) {
  if (count <= leaf_points) {
    leaves.emplace_back(first, count);
    return;
  }
  const int level = common_level(records[first].key, records[first + count - 1].key);
  REQUIRE(level < kLatticeBits);  // this test has no coincident cell of more than leaf_points
  for (std::uint64_t begin = first; begin < first + count;) {
    std::uint64_t end = begin + 1;
    while (end < first + count &&
           octant(records[end].key, level + 1) == octant(records[begin].key, level + 1))
      ++end;
    expected_leaves(records, begin, end - begin, leaf_points, leaves);
    begin = end;
  }
}

void walk(const Tree& tree, const ChildRef& ref,
          const std::function<void(const NodeGroup&, const NodeChild&)>& visit) {
  for (const NodeChild& child : tree.sink.at(ref).children) {
    visit(tree.sink.at(ref), child);
    if (child.ref.interior) walk(tree, child.ref, visit);
  }
}

std::vector<std::pair<std::uint64_t, std::uint64_t>> leaves_of(const Tree& tree) {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> leaves;
  walk(tree, tree.root.ref, [&](const NodeGroup&, const NodeChild& child) {
    if (!child.ref.interior) leaves.emplace_back(child.ref.first_point, child.ref.point_count);
  });
  return leaves;
}

}  // namespace

TEST_CASE("octree: leaves equal those of the top-down definition", "[build][octree]") {
  const SortedScene scene = sort_scene(random_surfels(5000, 1));
  for (const std::uint32_t leaf_points : {1U, 2U, 8U, 100U, 4999U}) {
    const Tree tree = build(scene.records, leaf_points, scene.frame.unit());
    std::vector<std::pair<std::uint64_t, std::uint64_t>> expected;
    expected_leaves(scene.records, 0, scene.records.size(), leaf_points, expected);
    CHECK(leaves_of(tree) == expected);
  }
}

TEST_CASE("octree: a group's cell is the deepest one that holds all its points",
          "[build][octree]") {
  const SortedScene scene = sort_scene(random_surfels(3000, 2));
  const Tree tree = build(scene.records, 4, scene.frame.unit());
  const std::function<std::pair<std::uint64_t, std::uint64_t>(const ChildRef&)> check =
      [&](const ChildRef& ref) -> std::pair<std::uint64_t, std::uint64_t> {
    if (!ref.interior) return {ref.first_point, ref.first_point + ref.point_count};
    const NodeGroup& group = tree.sink.at(ref);
    std::uint64_t first = ~std::uint64_t{0}, last = 0;
    for (const NodeChild& child : group.children) {
      const auto [begin, end] = check(child.ref);
      if (last != 0) CHECK(begin == last);
      first = std::min(first, begin);
      last = end;
      if (child.ref.interior) CHECK(tree.sink.at(child.ref).level > group.level);
    }
    CHECK(group.level == common_level(scene.records[first].key, scene.records[last - 1].key));
    CHECK(group.cell == cell_of(scene.records[first].key, group.level));
    return {first, last};
  };
  const auto [first, last] = check(tree.root.ref);
  CHECK(first == 0);
  CHECK(last == scene.records.size());
}

TEST_CASE("octree: spheres contain every disc below them, and sums agree with the points",
          "[build][octree]") {
  const SortedScene scene = sort_scene(random_surfels(2000, 3));
  const double unit = scene.frame.unit();
  const Tree tree = build(scene.records, 8, unit);
  const std::function<std::vector<const PointRecord*>(const ChildRef&, const NodeSummary&)> check =
      [&](const ChildRef& ref, const NodeSummary& node) {
        std::vector<const PointRecord*> points;
        if (ref.interior) {
          for (const NodeChild& child : tree.sink.at(ref).children) {
            const auto below = check(child.ref, child.node);
            points.insert(points.end(), below.begin(), below.end());
          }
        } else {
          for (std::uint32_t i = 0; i < ref.point_count; ++i)
            points.push_back(&scene.records[ref.first_point + i]);
        }
        double area = 0;
        for (const PointRecord* p : points) {
          const LatticePoint q = decode_morton(p->key);
          const double d = std::hypot(static_cast<double>(q[0]) - node.mean[0],
                                      static_cast<double>(q[1]) - node.mean[1],
                                      static_cast<double>(q[2]) - node.mean[2]);
          CHECK(d + static_cast<double>(p->radius) / unit <= node.radius * (1 + 1e-12));
          area += 2.0 * static_cast<double>(p->radius) * static_cast<double>(p->radius);
        }
        CHECK(node.area == Approx(area));
        return points;
      };
  CHECK(check(tree.root.ref, tree.root.node).size() == 2000);
}

TEST_CASE("octree: a million coincident points split by rank into full leaves", "[build][octree]") {
  PointRecord point;
  point.key = encode_morton({12345, 678, 91011});
  point.radius = 0.5F;
  const std::vector<PointRecord> records(1'000'000, point);
  const Tree tree = build(records, 8, 1.0);
  const auto leaves = leaves_of(tree);
  std::uint64_t next = 0;
  for (const auto& [first, count] : leaves) {
    REQUIRE(first == next);
    REQUIRE(count <= 8);
    next = first + count;
  }
  CHECK(next == records.size());
  CHECK(leaves.size() == 125'000);
  CHECK(std::ranges::max(tree.sink.groups, {}, &NodeGroup::level).level <= kMaxLevel);
  CHECK(tree.root.node.area == Approx(0.5e6));
}

TEST_CASE("octree: at most leaf_points points make a root group with one leaf", "[build][octree]") {
  const SortedScene scene = sort_scene(random_surfels(8, 4));
  for (std::size_t count = 1; count <= 8; ++count) {
    const auto [groups, result] = streamed(std::span(scene.records).first(count), 8, 3, 1);
    REQUIRE(groups.groups.size() == 1);
    CHECK(groups.groups[0].end == count);
    const GroupView root(groups.bytes.data());
    REQUIRE(root.size() == 1);
    CHECK(root.level() == 0);
    CHECK(root.child(0) ==
          ChildRef{.first_point = 0, .point_count = static_cast<std::uint32_t>(count)});
    CHECK(result.root == ChildRef{.interior = true});
    CHECK(result.nodes == 1);
  }
  const auto [groups, result] = streamed({}, 8, 1, 1);
  CHECK(groups.groups.empty());
  CHECK_FALSE(result.root.interior);
}

TEST_CASE("octree: blocks and threads change neither groups nor their order", "[build][octree]") {
  std::vector<PointRecord> spread = sort_scene(random_surfels(30'000, 5)).records;
  std::vector<PointRecord> heaps =
      spread;  // sets of coincident points of any size, alone and among others
  std::size_t at = 0;
  for (const std::size_t count : {1U, 2U, 7U, 8U, 9U, 600U, 4095U, 4096U, 4097U, 9000U}) {
    for (std::size_t i = 1; i < count; ++i) heaps[at + i].key = heaps[at].key;
    at += count + (count % 3);
  }
  for (const auto& records : {spread, heaps, std::vector(20'000, spread[0])}) {
    for (const std::uint32_t leaf_points : {1U, 8U, 5000U, kMaxLeafPoints}) {
      SubtreeGroups whole;
      const NodeChild top = SubtreeBuilder(leaf_points, 1.0).build(records, 0, 0, whole);
      if (!top.ref.interior) continue;
      for (const auto& [block, threads] :
           {std::pair(std::size_t{777}, 1U), {std::size_t{10'000}, 3U}, {records.size(), 2U}}) {
        const auto [groups, result] = streamed(records, leaf_points, block, threads);
        CHECK(equal(groups, whole));
        CHECK(result.root == top.ref);
        CHECK(result.total.area == top.node.area);
        CHECK(result.groups == whole.groups.size());
        CHECK(result.points == records.size());
      }
    }
  }
}

TEST_CASE("octree: the mean of points that coincide far from the corner is their place",
          "[build][octree]") {
  std::vector<PointRecord> points(1000);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].key = encode_morton({kLatticeMax, kLatticeMax - 1, 12345});
    points[i].radius = 0.1F * static_cast<float>(i + 1);
  }
  const NodeSummary leaf = summarise_points(points, 1);
  const std::array<const NodeSummary*, 3> children{&leaf, &leaf, &leaf};
  for (const NodeSummary& node : {leaf, summarise_nodes(children)}) {
    CHECK(node.mean == std::array<double, 3>{static_cast<double>(kLatticeMax),
                                             static_cast<double>(kLatticeMax - 1), 12345});
  }
}

TEST_CASE("octree: points without area or with opposite normals still have a mean and a cone",
          "[build][octree]") {
  std::vector<PointRecord> points(2);
  points[0].key = encode_morton({0, 0, 0});
  points[1].key = encode_morton({8, 0, 0});
  const NodeSummary flat = summarise_points(points, 1);
  CHECK(flat.mean[0] == 4);
  CHECK(flat.area == 0);
  points[0].radius = points[1].radius = 1;
  points[0].normal = {32767, 0};
  points[1].normal = {-32767, 0};
  const NodeSummary opposite = summarise_points(points, 1);
  CHECK(opposite.cone_cos == -1);
  CHECK(opposite.facing[0] == Approx(2));
  CHECK(opposite.facing[1] == Approx(2));
}

TEST_CASE("octree: the slab of a plane is thin, that of opposite normals as thick as the sphere",
          "[build][octree]") {
  std::vector<PointRecord> points(64);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].key = encode_morton({1000 + i % 8, 2000 + i / 8, 500});
    points[i].radius = 3;
    points[i].normal = encode_octahedral({0, 0, 1});
  }
  const NodeSummary plane = summarise_points(points, 1);
  CHECK(plane.thickness == 0);
  points[0].normal = encode_octahedral({0, 0.6F, 0.8F});  // a slanted disc
  CHECK(summarise_points(points, 1).thickness == Approx(3 * 0.6).epsilon(0.02));
  points[0].normal = encode_octahedral({0, 0, 1});
  points[0].key = encode_morton({1000, 2000, 507});  // a disc above
  CHECK(summarise_points(points, 1).thickness == Approx(7.0 * 63 / 64).epsilon(0.01));

  NodeSummary above = plane;
  above.mean[2] += 10;
  const std::array<const NodeSummary*, 2> sheets{&plane, &above};
  CHECK(summarise_nodes(sheets).thickness == Approx(5));
  NodeSummary turned = plane;  // a wall next to the floor
  std::swap(turned.facing[0], turned.facing[4]);
  const std::array<const NodeSummary*, 2> corner{&plane, &turned};
  const NodeSummary crease = summarise_nodes(corner);
  CHECK(crease.thickness == Approx(plane.radius * std::sqrt(0.5)));
  turned = plane;
  std::swap(turned.facing[4], turned.facing[5]);  // face to face
  const std::array<const NodeSummary*, 2> pair{&plane, &turned};
  CHECK(summarise_nodes(pair).thickness == summarise_nodes(pair).radius);
}

TEST_CASE("octree: cones contain every normal to the last bit", "[build][octree]") {
  const SortedScene scene = sort_scene(random_surfels(20'000, 5));
  const auto holds = [](const NodeSummary& node, const PointRecord& p) {
    const std::array<double, 3> n = decode_octahedral_f64(p.normal[0], p.normal[1]);
    double dot = 0, nn = 0, aa = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      dot += n[k] * static_cast<double>(node.cone_axis[k]);
      nn += n[k] * n[k];
      aa += static_cast<double>(node.cone_axis[k]) * static_cast<double>(node.cone_axis[k]);
    }
    return dot / std::sqrt(nn * aa) >= static_cast<double>(node.cone_cos);
  };
  for (std::size_t i = 0; i + 3 <= scene.records.size(); i += 3) {
    for (const std::size_t count : {1U, 2U, 3U}) {
      const std::span<const PointRecord> run(scene.records.data() + i, count);
      const NodeSummary node = summarise_points(run, 1);
      for (const PointRecord& p : run) REQUIRE(holds(node, p));
    }
  }
}

TEST_CASE("octree: discs of any size over a lattice of any unit have finite bounds",
          "[build][octree]") {
  SortedScene scene = sort_scene(random_surfels(9, 6));
  for (PointRecord& p : scene.records) p.radius = 3e38F;
  const NodeSummary all = summarise_points(scene.records, 0x1p-1002);
  const std::array<const NodeSummary*, 2> two{&all, &all};
  for (const NodeSummary& node : {all, summarise_nodes(two)}) {
    CHECK(std::isfinite(node.radius));
    CHECK(std::isfinite(node.thickness));
  }
}
