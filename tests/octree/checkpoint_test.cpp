// Builds that end at a checkpoint and are continued from it.
#include <memory>
#include <optional>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/octree/build_pages.h"
#include "engine/octree/rounding.h"
#include "engine/parallel/thread_pool.h"
#include "format/error.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::size_t kPoints = 200'000;  // four blocks of a build

struct Saved {
  BuildPlace place;
  WriterState writer;
  std::vector<std::byte> state;
};

/// Rounded points, and builds of them under any profile.
struct Setting {
  std::uint8_t page_shift = 12;
  BuildOptions tree;
  unsigned threads = 2;
};

class Rebuild {
 public:
  Rebuild(const SortedScene& scene, const Setting& setting)
      : scene_(scene), setting_(setting), executor_(setting.threads) {}

  /// Builds from a checkpoint or from the first point on; stops after this many checkpoints.
  void run(const std::filesystem::path& target, const std::filesystem::path& partial,
           const std::optional<Saved>& from, std::size_t most = kPoints) {
    const WriterOptions options{
        .page_shift = setting_.page_shift, .frame = scene_.frame, .partial = partial};
    ContainerWriter writer =
        from ? ContainerWriter(target, options, from->writer) : ContainerWriter(target, options);
    const std::uint64_t first = from ? from->place.points : 0;
    const auto begin = scene_.records.begin() + static_cast<std::ptrdiff_t>(first);
    VectorStream points({begin, scene_.records.end()});
    const auto rounded = round_points(points, scene_.frame.unit(), executor_,
                                      from ? from->place.last_key : MortonKey{});
    Checkpoints checkpoints{.interval = 1,
                            .save = [&](const BuildPlace& place, std::vector<std::byte> state) {
                              saved.push_back({place, writer.state(), std::move(state)});
                              if (saved.size() == most) throw DataError("killed");
                            }};
    std::optional<StateReader> reader;
    if (from) checkpoints.from = &reader.emplace(from->state, "state");
    Progress silent;
    writer.finish({}, build_pages(*rounded, writer, setting_.tree, executor_, silent, checkpoints));
  }

  std::vector<Saved> saved;

 private:
  const SortedScene& scene_;
  Setting setting_;
  ThreadPool executor_;
};

/// Returns points that rounding moves, and single ones between them that it must leave.
SortedScene rounded_scene() {
  SortedScene scene = sort_scene(random_surfels(kPoints, 3));
  for (std::size_t i = 0; i < 3000; ++i)
    scene.records[100'000 + i].key = scene.records[100'000].key;  // split by rank
  std::ranges::stable_sort(scene.records, {}, &PointRecord::key);
  for (PointRecord& record : scene.records) record.radius = 0.01F;
  // After a point that is not rounded comes one that must not move in front of it: the previous key
  // matters in every block.
  for (std::size_t i = 2; i < kPoints; i += 2) {
    PointRecord &before = scene.records[i - 1], &record = scene.records[i];
    if (before.key == record.key) continue;
    before.radius = 1e-30F;
    before.key.low |= 1;
    record.key = {before.key.high, before.key.low + 1};
  }
  std::ranges::stable_sort(scene.records, {}, &PointRecord::key);
  return scene;
}

}  // namespace

TEST_CASE("checkpoint: a build continued from any checkpoint gives the same bytes",
          "[build][checkpoint]") {
  const TemporaryDirectory dir;
  const SortedScene scene = rounded_scene();
  for (const Setting& setting :
       {Setting{}, Setting{.page_shift = 16, .tree = {.leaf_points = 5, .levels_per_stream = 63}},
        Setting{.page_shift = 13, .tree = {.leaf_points = 60'000}, .threads = 1}}) {
    CAPTURE(int{setting.page_shift});
    Rebuild whole(scene, setting);
    whole.run(dir / "whole.ptcx", {}, {});
    CHECK(whole.saved.size() == 3);
    for (std::size_t k = 1; k <= whole.saved.size(); ++k) {
      Rebuild first(scene, setting);
      CHECK_THROWS_WITH(first.run(dir / "again.ptcx", dir / "pages", {}, k), "killed");
      CHECK_FALSE(std::filesystem::exists(dir / "again.ptcx"));
      std::filesystem::resize_file(dir / "pages",
                                   100 << 20);  // the bytes beyond the state are cut off
      Setting other = setting;
      other.threads = 3 - setting.threads;
      Rebuild second(scene, other);
      second.run(dir / "again.ptcx", dir / "pages", first.saved.back());
      CHECK(second.saved.size() == 3 - k);
      const bool same = bytes_of(dir / "again.ptcx") == bytes_of(dir / "whole.ptcx");
      CHECK(same);
      CHECK_FALSE(std::filesystem::exists(dir / "pages"));
      std::filesystem::remove(dir / "again.ptcx");
    }
  }
}

TEST_CASE("checkpoint: every prefix of a state is refused", "[build][checkpoint]") {
  const TemporaryDirectory dir;
  const SortedScene scene = rounded_scene();
  Rebuild first(scene, {});
  CHECK_THROWS(first.run(dir / "a.ptcx", dir / "pages", {}, 1));
  const Saved& saved = first.saved.front();
  const std::vector<char> pages = bytes_of(dir / "pages");
  ContainerWriter writer(dir / "a.ptcx",
                         {.page_shift = 12, .frame = scene.frame, .partial = dir / "pages"},
                         saved.writer);
  const auto load = [&](const std::vector<std::byte>& bytes) {
    VectorStream none({});
    StateReader state(bytes, "state");
    Progress silent;
    static_cast<void>(build_pages(none, writer, {}, ThreadPool(1), silent, {.from = &state}));
  };
  std::vector<std::byte> bytes = saved.state;
  const std::size_t step =
      bytes.size() / 2000 + 1;  // the first and last bytes one by one, and some between
  for (std::size_t n = 0; n < bytes.size(); n += n < 300 || n + 3000 > bytes.size() ? 1 : step) {
    const std::vector<std::byte> prefix(bytes.begin(),
                                        bytes.begin() + static_cast<std::ptrdiff_t>(n));
    bool refused = false;
    try {
      load(prefix);
    } catch (const DataError&) {
      refused = true;
    } catch (const FormatError&) {
      refused = true;
    }
    REQUIRE(refused);
  }
}

TEST_CASE("checkpoint: an unfinished container that was changed is refused",
          "[build][checkpoint]") {
  const TemporaryDirectory dir;
  const SortedScene scene = rounded_scene();
  Rebuild first(scene, {});
  CHECK_THROWS(first.run(dir / "a.ptcx", dir / "pages", {}, 2));
  const Saved saved = first.saved.back();
  const WriterOptions options{.page_shift = 12, .frame = scene.frame, .partial = dir / "pages"};
  const auto open = [&](const WriterOptions& with, const WriterState& state) {
    const ContainerWriter writer(dir / "a.ptcx", with, state);
  };
  CHECK_NOTHROW(open(options, saved.writer));
  WriterOptions other = options;
  other.uuid[0] = std::byte{1};
  CHECK_THROWS_WITH(open(other, saved.writer),
                    Catch::Contains("no unfinished container of this scene"));
  WriterState state = saved.writer;
  state.end -= 512;
  CHECK_THROWS_WITH(open(options, state), Catch::Contains("last page is cut"));
  for (std::uint32_t WriterState::*pages : {&WriterState::point_pages, &WriterState::node_pages}) {
    state = saved.writer;
    state.*pages /= 2;
    CHECK_THROWS_WITH(open(options, state), Catch::Contains("was not written"));
  }
  std::filesystem::resize_file(dir / "pages", saved.writer.end - 1);
  CHECK_THROWS_WITH(open(options, saved.writer), Catch::Contains("shorter than it was"));
}
