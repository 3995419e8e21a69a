#include "tools/bench/experiments/remote.h"

#include <catch2/catch.hpp>

#include "engine/ptc.h"
#include "engine/store/reader.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

std::filesystem::path city(const test::TemporaryDirectory& scratch, std::uint64_t points) {
  const std::filesystem::path path = scratch.path() / "city.ptcx";
  Progress silent;
  static_cast<void>(build_container({.city_points = points}, path, silent));
  return path;
}

/// A city that is read in ranges, which are counted.
struct RemoteCity {
  explicit RemoteCity(std::uint64_t points) : file(city(scratch, points)) {}

  test::TemporaryDirectory scratch;
  InputFile file;
  FileRanges ranges{file};
  CountingRanges source{ranges};
  PartialReader scene{source};
};

}  // namespace

// The table of `ptcbench remote` has the counts of this view for 200 million points: 1 request and
// 262 KB, then 1 more and 585 KB.
TEST_CASE("remote: a view of a whole city takes few requests and few bytes", "[bench][remote]") {
  RemoteCity remote(4'000'000);
  const CountingRanges& source = remote.source;
  PartialReader& scene = remote.scene;
  CHECK(source.requests() == 1);
  CHECK(source.bytes() <= 300'000);
  REQUIRE(scene.superblock().node_pages > 500);

  ViewChoice choice(scene, views_of(scene.superblock()).front());
  const std::size_t coarse = choice.choose(500);
  CHECK((coarse >= 500 && coarse < 508));
  CHECK(source.requests() <= 3);
  CHECK(scene.rounds() <= source.requests());
  CHECK(source.bytes() <= 300'000);

  const std::uint64_t requests = source.requests(), bytes = source.bytes();
  const std::size_t fine = choice.choose(10'000);
  CHECK((fine >= 10'000 && fine < 10'008));
  CHECK(source.requests() - requests <= 2);
  CHECK(source.bytes() - bytes <= 600'000);
  CHECK(scene.rounds() <= source.requests());
}

TEST_CASE("remote: a view from within a city takes no more than was measured", "[bench][remote]") {
  RemoteCity remote(4'000'000);
  const CountingRanges& source = remote.source;
  PartialReader& scene = remote.scene;
  ViewChoice choice(scene, views_of(scene.superblock()).back());
  static_cast<void>(choice.choose(500));
  CHECK(source.requests() <= 3);
  CHECK(source.bytes() <= 350'000);
  // Nodes near the eye lie deep in the tree, on pages far from each other
  const std::uint64_t requests = source.requests(), bytes = source.bytes();
  static_cast<void>(choice.choose(10'000));
  CHECK(source.requests() - requests <= 12);
  CHECK(source.bytes() - bytes <= 1'100'000);
  CHECK(scene.rounds() <= 5);
}

TEST_CASE("remote: a view of as many nodes as there are divides them all", "[bench][remote]") {
  const test::TemporaryDirectory scratch;
  const InputFile file(city(scratch, 100'000));
  FileRanges ranges(file);
  PartialReader scene(ranges);
  ViewChoice choice(scene, views_of(scene.superblock()).front());
  // Every node is a leaf or divided, and each but the root's stands in a group.
  CHECK(choice.choose(1'000'000) == scene.superblock().nodes - scene.superblock().node_groups + 1);
}

TEST_CASE("remote: what lies behind the eye is neither loaded nor counted", "[bench][remote]") {
  const test::TemporaryDirectory scratch;
  const InputFile file(city(scratch, 100'000));
  FileRanges ranges(file);
  CountingRanges inside(ranges), everywhere(ranges);
  PartialReader less(inside), all(everywhere);
  ConeView view = views_of(less.superblock()).back();
  const std::size_t seen = ViewChoice(less, view).choose(1'000'000);
  view.half_angle = 4;
  CHECK(seen < ViewChoice(all, view).choose(1'000'000) / 2);
  CHECK(inside.bytes() < everywhere.bytes());
}
