// verify_container() over several threads: what it finds is what one thread finds.
#include <algorithm>
#include <bit>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "format/node_page.h"
#include "tests/support/scenes.h"
#include "tests/verify/damage.h"

namespace ptc::test {
namespace {

VerifyReport verify(const std::filesystem::path& path, const VerifyOptions& options) {
  Progress silent;
  return verify_container(path, options, silent);
}

/// Checks that threads and memory do not change what is found, and returns what is.
VerifyReport verify_each_way(const std::filesystem::path& path) {
  const VerifyReport alone = verify(path, {.threads = 1});
  for (const unsigned threads : {1U, 2U, 5U}) {
    for (const std::uint64_t memory : {36U, 512U}) {
      INFO(threads << " threads, " << memory << " MiB");
      const VerifyReport report = verify(path, {.memory_bytes = memory << 20, .threads = threads});
      REQUIRE(report.findings.size() == alone.findings.size());
      for (std::size_t i = 0; i < alone.findings.size(); ++i)
        CHECK(line_of(report.findings[i]) == line_of(alone.findings[i]));
      CHECK(report.damage == alone.damage);
      CHECK(report.damaged_pages == alone.damaged_pages);
      CHECK(report.points == alone.points);
      CHECK(report.nodes == alone.nodes);
      CHECK(report.groups == alone.groups);
      CHECK(report.levels == alone.levels);
      CHECK(report.tree_checked == alone.tree_checked);
      const VerifyReport first =
          verify(path, {.memory_bytes = memory << 20, .threads = threads, .fail_fast = true});
      REQUIRE(first.findings.size() == std::min<std::size_t>(1, alone.findings.size()));
      if (!alone.sound()) CHECK(line_of(first.findings[0]) == line_of(alone.findings[0]));
    }
  }
  return alone;
}

/// Writes more subtrees than one round has, as raw pages of 4 KiB.
void write_many_subtrees(const std::filesystem::path& path) {
  write_scene(path, random_surfels(120000, 3), {}, 12, Codec::raw);
}

/// A scene whose directory is one page, so that it can be changed under correct checksums.
struct Changeable {
  TemporaryDirectory directory;
  std::filesystem::path path = directory / "scene.ptcx";
  OpenContainer container = [this] {
    write_scene(path, random_surfels(12000, 3), {.leaf_points = 16}, 14, Codec::raw);
    return OpenContainer(path);
  }();

  /// Returns the group that a child refers to.
  [[nodiscard]] GroupView group(const ChildRef& ref) {
    std::uint32_t rank = 0;
    for (std::size_t page = 0;; ++page) {
      if (container.header(page).type != PageType::node || rank++ < ref.page) continue;
      return NodePage(container.payload(page).data(),
                      container.header(page).record_count)[ref.slot];
    }
  }

  /// Returns the first bytes of all groups, page by page.
  [[nodiscard]] std::vector<std::byte*> groups() {
    std::vector<std::byte*> all;
    for (std::size_t page = 0; page < container.pages(); ++page) {
      if (container.header(page).type != PageType::node) continue;
      const NodePage nodes(container.payload(page).data(), container.header(page).record_count);
      for (std::uint32_t slot = 0; slot < nodes.size(); ++slot)
        all.push_back(const_cast<std::byte*>(nodes[slot].bytes().data()));
    }
    return all;
  }
};

}  // namespace

TEST_CASE("verify: a sound file is sound for any number of threads", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  write_many_subtrees(path);
  const VerifyReport report = verify_each_way(path);
  CHECK(report.sound());
  CHECK(report.tree_checked);
  CHECK(report.points == 120000U);
  CHECK(report.nodes == ContainerReader(path).superblock().nodes);
  CHECK_THROWS_WITH(verify(path, {.memory_bytes = 1 << 20}),
                    Catch::Contains("the least that works is"));
}

TEST_CASE("verify: damaged pages hide the same for any number of threads", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  write_many_subtrees(path);
  std::vector<std::byte> bytes = read_file(path);
  std::size_t damaged = 0;
  {
    const ContainerReader container(path);
    for (std::uint32_t page = 0; page < container.page_count(); page += 37) {
      bytes[container.entry(page).offset + 100] ^= std::byte{1};
      ++damaged;
    }
  }
  write_file(path, bytes);
  const VerifyReport report = verify_each_way(path);
  CHECK(report.damage == damaged);
  CHECK_FALSE(report.tree_checked);
  CHECK(report.groups > 0U);
}

TEST_CASE("verify: wrong nodes are all found by any number of threads", "[verify]") {
  // Each count of wrong nodes: in some subtrees, several in each, more than are kept.
  for (const std::size_t every : {200U, 10U, 1U}) {
    Changeable scene;
    std::uint64_t changed = 0;
    const std::vector<std::byte*> groups = scene.groups();
    for (std::size_t i = 0; i < groups.size(); i += every, ++changed)
      const_cast<std::byte*>(GroupView(groups[i]).area())[1] ^= std::byte{0x10};
    scene.container.write(scene.path);
    const VerifyReport report = verify_each_way(scene.path);
    INFO(changed << " changed nodes");
    CHECK(report.damage == changed);
    CHECK(report.tree_checked);
    CHECK(std::ranges::all_of(report.findings,
                              [](const Finding& f) { return code_of(f) == "node-sums"; }));
  }
}

TEST_CASE("verify: a group below two nodes is found by any number of threads", "[verify]") {
  Changeable scene;
  const std::vector<std::byte*> groups = scene.groups();
  std::size_t shared = 0;
  for (std::size_t i = 0; i < groups.size() && shared < 5; i += 7) {
    // Make a child refer to the group that the next interior child refers to.
    const GroupView group(groups[i]);
    int child = 0;
    while (child + 1 < group.size() && (group.interior_mask() >> child & 3) != 3) ++child;
    if (child + 1 >= group.size()) continue;
    set_reference({groups[i], group.bytes().size()}, child, group.child(child + 1));
    ++shared;
  }
  REQUIRE(shared == 5);
  scene.container.write(scene.path);
  const VerifyReport report = verify_each_way(scene.path);
  CHECK(std::ranges::count(report.findings, "references", code_of) >= 5);
}

TEST_CASE("verify: a group of two subtrees is reported where it comes second", "[verify]") {
  Changeable scene;
  const Superblock& s = scene.container.superblock();
  const GroupView root = scene.group({.page = s.root_page, .slot = s.root_slot});
  REQUIRE(root.size() == 8);
  // A group late in the fourth subtree refers to the first group of the fifth, which another thread
  // reaches sooner. It is on the same level, so that nothing below it is visited again.
  const auto last_interior = [](const GroupView& group) {
    return static_cast<int>(std::bit_width(group.interior_mask())) - 1;
  };
  const GroupView fourth = scene.group(root.child(3)), fifth = scene.group(root.child(4));
  const GroupView late = scene.group(fourth.child(last_interior(fourth)));
  REQUIRE((fifth.interior_mask() & 1) == 1);
  REQUIRE(late.level() == scene.group(fifth.child(0)).level());
  REQUIRE(late.interior_mask() != 0);
  set_reference({const_cast<std::byte*>(late.bytes().data()), late.bytes().size()},
                last_interior(late), fifth.child(0));
  scene.container.write(scene.path);
  const VerifyReport report = verify_each_way(scene.path);
  REQUIRE(report.findings.size() == 2);
  CHECK(code_of(report.findings[0]) == "node-level");
  CHECK(code_of(report.findings[1]) == "references");
}

TEST_CASE("verify: page content that breaks a rule comes before the tree", "[verify]") {
  Changeable scene;
  std::size_t last = 0;
  for (std::size_t page = 0; page < scene.container.pages(); ++page) {
    if (scene.container.header(page).type == PageType::point) last = page;
  }
  scene.container.payload(last)[20 * scene.container.header(last).record_count - 1] =
      std::byte{0xff};  // a negative radius
  const std::vector<std::byte*> groups = scene.groups();
  const_cast<std::byte*>(GroupView(groups.front()).area())[1] ^= std::byte{0x10};
  scene.container.write(scene.path);
  const VerifyReport report = verify_each_way(scene.path);
  REQUIRE(report.findings.size() == 2);
  CHECK(code_of(report.findings[0]) == "point-radius");
  CHECK(code_of(report.findings[1]) == "node-sums");
  CHECK(report.damaged_pages == 1U);
  CHECK_FALSE(report.tree_checked);
}

}  // namespace ptc::test
