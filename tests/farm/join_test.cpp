// Parts that are built apart and joined have the tree of one file.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <string>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/octree/build_pages.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/parts/join_parts.h"
#include "engine/pipeline/parts/part_edges.h"
#include "engine/ptc.h"
#include "engine/store/writer.h"
#include "engine/verify/verify.h"
#include "format/point_page.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

using Cuts = std::vector<std::size_t>;

/// Sorted points that are built in one piece and in parts.
class Cloud {
 public:
  Cloud(const std::vector<Surfel>& surfels, std::uint32_t leaf_points)
      : scene_(sort_scene(surfels)), leaf_points_(leaf_points) {
    build(0, scene_.records.size(), dir_ / "whole.ptcx", nullptr);
  }

  [[nodiscard]] std::filesystem::path whole() const { return dir_ / "whole.ptcx"; }
  [[nodiscard]] std::filesystem::path joined() const { return dir_ / "scene.ptcx"; }
  [[nodiscard]] std::filesystem::path part(std::size_t i) const {
    return dir_ / ("part." + std::to_string(i) + ".ptcx");
  }
  [[nodiscard]] std::size_t size() const { return scene_.records.size(); }

  /// Returns where leaves of the whole tree begin, but for the first.
  [[nodiscard]] Cuts leaf_begins() const {
    const ContainerReader whole(dir_ / "whole.ptcx");
    Cuts begins;
    std::vector<std::byte> payload(whole.page_payload_limit());
    PageDecoder decoder;
    for (const std::uint32_t page : whole.node_pages()) {
      const PageHeader header = whole.read_page(page, payload, decoder);
      const NodePage nodes(payload.data(), header.record_count);
      for (std::uint32_t slot = 0; slot < nodes.size(); ++slot) {
        for (int i = 0; i < nodes[slot].size(); ++i) {
          const ChildRef ref = nodes[slot].child(i);
          if (!ref.interior && ref.first_point > 0) begins.push_back(ref.first_point);
        }
      }
    }
    std::ranges::sort(begins);
    // Points of one position lie in one part
    std::erase_if(begins, [&](std::size_t at) {
      return scene_.records[at].key == scene_.records[at - 1].key;
    });
    return begins;
  }

  /// Builds and joins the parts between the cuts.
  void join(Cuts cuts, bool with_edges = true) const {
    cuts.insert(cuts.begin(), 0);
    cuts.push_back(size());
    std::vector<std::filesystem::path> parts;
    for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
      TreeEdges edges;
      parts.push_back(part(i));
      const Superblock made = build(cuts[i], cuts[i + 1], part(i), &edges);
      std::filesystem::remove(edges_path(part(i)));
      if (with_edges) write_edges(part(i), edges);
    }
    Progress silent;
    static_cast<void>(join_parts(parts, joined(), {}, silent));
  }

 private:
  Superblock build(std::size_t begin, std::size_t end, const std::filesystem::path& path,
                   TreeEdges* edges) const {
    Progress silent;
    ContainerWriter writer(path, {.page_shift = 12,
                                  .uuid = {std::byte(begin), std::byte(begin >> 8), std::byte{1}},
                                  .frame = scene_.frame});
    VectorStream points({scene_.records.begin() + static_cast<std::ptrdiff_t>(begin),
                         scene_.records.begin() + static_cast<std::ptrdiff_t>(end)});
    const Superblock made = build_pages(points, writer, {.leaf_points = leaf_points_},
                                        ThreadPool(2), silent, {}, edges);
    static_cast<void>(writer.finish({}, made));
    return ContainerReader(path).superblock();
  }

  TemporaryDirectory dir_;
  SortedScene scene_;
  std::uint32_t leaf_points_;
};

VerifyReport verified(const std::filesystem::path& path) {
  Progress silent;
  VerifyReport report = verify_container(path, {.level = VerifyLevel::rebuild}, silent);
  for (const Finding& finding : report.findings) UNSCOPED_INFO(line_of(finding));
  REQUIRE(report.sound());
  REQUIRE(report.damage == 0);
  return report;
}

/// Checks that the joined scene is sound and has the tree and the totals of the whole.
void check_same(const Cloud& cloud, const VerifyReport& whole) {
  const VerifyReport joined = verified(cloud.joined());
  REQUIRE(whole.tree_digest);
  REQUIRE(joined.tree_digest == whole.tree_digest);
  REQUIRE(joined.points == whole.points);
  const Superblock one = ContainerReader(cloud.whole()).superblock();
  const Superblock many = ContainerReader(cloud.joined()).superblock();
  REQUIRE(many.area == one.area);
  REQUIRE(many.bounds_low == one.bounds_low);
  REQUIRE(many.bounds_high == one.bounds_high);
}

/// Returns every n-th cut.
Cuts every(const Cuts& cuts, std::size_t n) {
  Cuts some;
  for (std::size_t i = n - 1; i < cuts.size(); i += n) some.push_back(cuts[i]);
  return some;
}

/// Random surfels, of which many lie at the place of another.
std::vector<Surfel> crowded_surfels(std::size_t count) {
  std::vector<Surfel> surfels = random_surfels(count, 11);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (i % 3 == 0) surfels[i].position = surfels[i / 40].position;
  }
  return surfels;
}

}  // namespace

TEST_CASE("join: a cut at any end of a leaf gives the tree of one file", "[farm][join]") {
  for (const std::uint32_t leaf_points : {1U, 3U}) {
    const Cloud cloud(crowded_surfels(70), leaf_points);
    const VerifyReport whole = verified(cloud.whole());
    const Cuts begins = cloud.leaf_begins();
    REQUIRE(begins.size() > 10);
    for (const std::size_t at : begins) {
      CAPTURE(leaf_points, at);
      cloud.join({at});
      check_same(cloud, whole);
    }
  }
}

TEST_CASE("join: any number of parts gives the tree of one file", "[farm][join]") {
  for (const std::uint32_t leaf_points : {1U, 16U}) {
    const Cloud cloud(crowded_surfels(300), leaf_points);
    const VerifyReport whole = verified(cloud.whole());
    const Cuts begins = cloud.leaf_begins();
    for (const std::size_t n : {1U, 7U, 40U, 10'000U}) {
      CAPTURE(leaf_points, n);
      const Cuts cuts = every(begins, n);
      cloud.join(cuts);
      check_same(cloud, whole);
      CHECK(ContainerReader(cloud.joined()).parts().size() == cuts.size() + 1);
    }
  }
}

TEST_CASE("join: parts of many points share groups of many levels", "[farm][join]") {
  const Cloud cloud(random_surfels(60'000, 3), 16);
  const VerifyReport whole = verified(cloud.whole());
  cloud.join(every(cloud.leaf_begins(), 2'000));
  check_same(cloud, whole);
  const ContainerReader scene(cloud.joined());
  CHECK(scene.superblock().levels == ContainerReader(cloud.whole()).superblock().levels);
}

TEST_CASE("join: clouds of few points or of one position make a scene of one part",
          "[farm][join]") {
  std::vector<Surfel> same(500, random_surfels(1, 5)[0]);
  for (const std::vector<Surfel>& surfels :
       {same, random_surfels(1, 5), random_surfels(16, 5), random_surfels(17, 5)}) {
    const Cloud cloud(surfels, 16);
    CAPTURE(surfels.size());
    cloud.join({});
    check_same(cloud, verified(cloud.whole()));
  }
}

TEST_CASE("join: a cut within a leaf is refused by the names of its parts", "[farm][join]") {
  const Cloud cloud(random_surfels(100, 12), 8);
  const Cuts begins = cloud.leaf_begins();
  std::size_t refused = 0;
  for (std::size_t at = 1; at < cloud.size(); ++at) {
    CAPTURE(at);
    if (std::ranges::binary_search(begins, at)) continue;
    CHECK_THROWS_WITH(cloud.join({at}),
                      Catch::Contains(cloud.part(1).string()) && Catch::Contains("share a leaf"));
    ++refused;
  }
  CHECK(refused > 40);
}

TEST_CASE("join: without the files of edges the scene has the same bytes", "[farm][join]") {
  const Cloud cloud(crowded_surfels(3'000), 4);
  const Cuts cuts = every(cloud.leaf_begins(), 100);
  cloud.join(cuts);
  const std::vector<char> bytes = bytes_of(cloud.joined());
  cloud.join(cuts, false);
  CHECK(bytes_of(cloud.joined()) == bytes);
  // Nor do edges of another part count, and damaged ones are refused by name
  cloud.join(cuts);
  std::filesystem::copy_file(edges_path(cloud.part(1)), edges_path(cloud.part(0)),
                             std::filesystem::copy_options::overwrite_existing);
  std::vector<std::filesystem::path> parts;
  for (std::size_t i = 0; i <= cuts.size(); ++i) parts.push_back(cloud.part(i));
  Progress silent;
  static_cast<void>(join_parts(parts, cloud.joined(), {}, silent));
  CHECK(bytes_of(cloud.joined()) == bytes);
  std::ofstream(edges_path(cloud.part(0)), std::ios::binary | std::ios::app) << 'x';
  CHECK_THROWS_WITH(join_parts(parts, cloud.joined(), {}, silent),
                    Catch::Contains(edges_path(cloud.part(0)).string()));
}

TEST_CASE("join: a gather over joined parts gives the bits of one file", "[farm][join]") {
  const Cloud cloud(small_scene(0.1), 16);
  cloud.join(every(cloud.leaf_begins(), 150));
  Progress silent;
  const auto shaded = [&](const std::filesystem::path& scene) {
    ShadeRequest request;
    request.scene = scene;
    request.count = 300;
    const std::filesystem::path out = cloud.whole().parent_path() / "out.ply";
    static_cast<void>(shade_container(request, out, silent));
    return bytes_of(out);
  };
  const std::vector<char> bytes = shaded(cloud.whole());
  REQUIRE(bytes.size() > 5'000);
  CHECK((shaded(cloud.joined()) == bytes));
}

TEST_CASE("join: parts in another order, elsewhere or of another frame are refused",
          "[farm][join]") {
  const Cloud cloud(random_surfels(500, 12), 8);
  cloud.join({cloud.leaf_begins()[20]});
  Progress silent;
  const auto refusal = [&](std::vector<std::filesystem::path> parts,
                           const std::filesystem::path& target) {
    try {
      static_cast<void>(join_parts(parts, target, {}, silent));
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const auto a = cloud.part(0), b = cloud.part(1);
  CHECK_THAT(refusal({b, a}, cloud.joined()), Catch::Contains("do not lie behind"));
  CHECK_THAT(refusal({a, a}, cloud.joined()), Catch::Contains("do not lie behind"));
  CHECK_THAT(refusal({cloud.joined()}, cloud.whole()), Catch::Contains("scene of parts itself"));
  CHECK_THAT(refusal({}, cloud.joined()), Catch::Contains("at least one part"));
  std::filesystem::create_directory(cloud.whole().parent_path() / "below");
  CHECK_THAT(refusal({a, b}, cloud.whole().parent_path() / "below" / "scene.ptcx"),
             Catch::Contains("in the folder of the scene"));
  const Cloud other(random_surfels(500, 99), 8);
  std::filesystem::copy_file(other.whole(), cloud.whole().parent_path() / "other.ptcx");
  CHECK_THAT(refusal({a, cloud.whole().parent_path() / "other.ptcx"}, cloud.joined()),
             Catch::Contains("it has another frame"));
}

namespace {

/// Changes the edges of a part, and returns why they are refused; empty when they are not.
std::string refusal_of_edges(const Cloud& cloud, const std::function<void(TreeEdges&)>& change) {
  const Cuts begins = cloud.leaf_begins();
  cloud.join({begins[begins.size() / 2]});
  const ContainerReader part(cloud.part(1));
  TreeEdges edges = find_edges(part, ThreadPool(1));
  change(edges);
  write_edges(cloud.part(1), edges);
  Progress silent;
  try {
    static_cast<void>(
        join_parts(std::vector{cloud.part(0), cloud.part(1)}, cloud.joined(), {}, silent));
  } catch (const DataError& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("join: edges that are none of a tree are refused by file, offset and rule",
          "[farm][join]") {
  const Cloud cloud(random_surfels(500, 12), 8);
  CHECK(refusal_of_edges(cloud, [](TreeEdges&) {}).empty());
  struct Case {
    const char* rule;
    std::function<void(TreeEdges&)> change;
  };
  const std::vector<Case> cases{
      {"a leaf of an edge has no points or more",
       [](TreeEdges& e) { e.first.front().children.front().ref.point_count = 0; }},
      {"a leaf of an edge has no points", [](TreeEdges& e) { e.first_leaf.clear(); }},
      {"precedes the point before it", [](TreeEdges& e) { std::ranges::reverse(e.last_leaf); }},
      {"two roots", [](TreeEdges& e) { e.last.back().children.pop_back(); }},
      {"two roots", [](TreeEdges& e) { ++e.first.back().children.back().ref.slot; }},
      {"two roots", [](TreeEdges& e) { e.last.pop_back(); }},
      {"leads to no leaf", [](TreeEdges& e) { e.first.erase(e.first.begin()); }},
      {"levels of an edge do not rise",
       [](TreeEdges& e) { e.first.insert(e.first.begin() + 1, e.first[1]); }},
      {"an edge of the tree has no root", [](TreeEdges& e) { e.first.clear(); }},
      {"a group of an edge has no children", [](TreeEdges& e) { e.first[0].children.clear(); }},
      {"outside of a cell on the way", [](TreeEdges& e) { e.last[0].cell = e.first[0].cell; }},
      {"outside of a cell on the way", [](TreeEdges& e) { e.last_leaf = e.first_leaf; }},
      {"a leaf of an edge lacks points", [](TreeEdges& e) { e.first_leaf.pop_back(); }},
      {"does not begin with the first point",
       [](TreeEdges& e) { ++e.first.front().children.front().ref.first_point; }},
      {"does not end with the last point",
       [](TreeEdges& e) { --e.last.front().children.back().ref.first_point; }},
      {"a number of the state is out of range",
       [](TreeEdges& e) { e.first.front().children.back().ref.first_point = ~std::uint64_t{0}; }},
      {"points that do not exist",
       [](TreeEdges& e) { e.last.front().children.back().ref.point_count = 0xffff; }},
      {"another number of points",
       [](TreeEdges& e) {
         ++e.points;
         ++e.last.front().children.back().ref.first_point;
       }},
      {"a number of the state is out of range", [](TreeEdges& e) { e.points = ~std::uint64_t{0}; }},
      {"refers to a group or to points",
       [](TreeEdges& e) {
         e.first.back().children.front().ref.page = e.last.back().children.front().ref.page = 99;
       }},
      {"a group that the part does not have", [](TreeEdges& e) { e.root.slot = 0xffff; }},
      {"the root of the edges does not exist", [](TreeEdges& e) { e.root.page = 99; }},
      {"not finite", [](TreeEdges& e) { e.first[0].children[0].node.area = NAN; }},
      {"negative or too large", [](TreeEdges& e) { e.first[0].children[0].node.area = 1e300; }},
      {"negative or too large", [](TreeEdges& e) { e.last[0].children[0].node.flux[2][1] = -1; }},
      {"outside of the frame", [](TreeEdges& e) { e.last[0].children[0].node.mean[1] = -3; }},
      {"has no angle", [](TreeEdges& e) { e.last[0].children[0].node.cone_cos = 2; }},
  };
  for (const auto& [rule, change] : cases) {
    CAPTURE(rule);
    const std::string refusal = refusal_of_edges(cloud, change);
    CHECK_THAT(refusal, Catch::StartsWith(edges_path(cloud.part(1)).string() + ": offset ") &&
                            Catch::Contains(rule));
  }
}

TEST_CASE("join: a cell that two parts share has at most 8 children", "[farm][join]") {
  const Cloud cloud(random_surfels(500, 12), 8);
  const std::string refusal = refusal_of_edges(cloud, [](TreeEdges& e) {
    for (NodeGroup* root : {&e.first.back(), &e.last.back()}) {
      const NodeChild copy = root->children[0];
      while (root->children.size() < 8) root->children.insert(root->children.begin() + 1, copy);
    }
  });
  CHECK_THAT(refusal, Catch::StartsWith(cloud.part(1).string()) &&
                          Catch::Contains("has more than 8 children"));
}

TEST_CASE("join: edges of any bytes are refused, or give a scene that can be read",
          "[farm][join]") {
  const Cloud cloud(random_surfels(60, 12), 8);
  cloud.join({cloud.leaf_begins()[3]});
  const std::vector parts{cloud.part(0), cloud.part(1)};
  const std::vector<std::byte> whole = read_state(edges_path(cloud.part(1)));
  Progress silent;
  std::size_t refused = 0, joined = 0;
  for (std::size_t at = 8; at < whole.size(); at += 29) {
    std::vector<std::byte> bytes = whole;
    bytes[at] ^= std::byte{0x81};
    write_state(edges_path(cloud.part(1)), bytes);
    CAPTURE(at);
    try {
      static_cast<void>(join_parts(parts, cloud.joined(), {}, silent));
      static_cast<void>(verify_container(cloud.joined(), {.level = VerifyLevel::rebuild}, silent));
      ++joined;
    } catch (const DataError& error) {
      ++refused;
    }
  }
  CHECK(refused > 100);
  CHECK(joined > 100);  // sums and references of other values
}
