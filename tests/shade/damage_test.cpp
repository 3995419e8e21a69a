// Shading past pages that cannot be read: what stands in for them, and the bound on the change.
#include <fstream>
#include <optional>

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/shade/reference/brute_force.h"
#include "format/error.h"
#include "tests/shade/gather_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr double kSpacing = 0.05;

/// The results of a receiver in the whole scene and in the damaged one.
struct Pair {
  Shading expected, found;
  double bound = 0;
  [[nodiscard]] double off() const { return std::abs(found.occlusion - expected.occlusion); }
};

/// A scene, whole and with two bytes changed in the payload of some pages. Without an argument it
/// is small_scene().
struct Damaged {
  Scene scene;
  std::unique_ptr<ContainerReader> broken;

  Damaged() : Damaged(small_scene(kSpacing), {}) { add_floor_receivers(scene.receivers, kSpacing); }
  Damaged(const std::vector<Surfel>& surfels, const BuildOptions& options)
      : scene(surfels, options) {
    break_pages({});
  }

  [[nodiscard]] std::uint32_t root_page() const {
    return scene.container->node_pages()[scene.container->superblock().root_page];
  }

  /// Returns all node pages but the root's.
  [[nodiscard]] std::vector<std::uint32_t> node_pages() const {
    std::vector<std::uint32_t> pages;
    for (const std::uint32_t page : scene.container->node_pages()) {
      if (page != root_page()) pages.push_back(page);
    }
    return pages;
  }

  void break_pages(const std::vector<std::uint32_t>& pages) {
    std::vector<char> bytes = bytes_of(scene.dir / "scene.ptcx");
    for (const std::uint32_t page : pages) {
      const std::size_t at = scene.container->entry(page).offset + kPageHeaderBytes;
      bytes[at] = static_cast<char>(~bytes[at]);
      bytes[at + 1] = static_cast<char>(~bytes[at + 1]);
    }
    std::ofstream(scene.dir / "broken.ptcx", std::ios::binary)
        .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    broken = std::make_unique<ContainerReader>(scene.dir / "broken.ptcx");
  }

  /// Shades every step-th receiver by itself, which gives each a bound of its own, or with its
  /// neighbours: the bound of each is that of them all.
  [[nodiscard]] std::vector<Pair> shade_some(std::size_t step, LostPages& lost,
                                             std::size_t together = 1,
                                             std::size_t things_left = Gather::kThingsLeft) const {
    const SceneView whole(*scene.container), view(*broken, &lost);
    PageCache whole_cache(*scene.container, {.memory_bytes = 64U << 20}),
        cache(*broken, {.memory_bytes = 64U << 20});
    const DirectionGrid grid(GatherOptions().resolution, {}, 0);
    Gather reference(whole, whole_cache, {}, {}, things_left);
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i + together <= scene.receivers.size(); i += step) {
      const auto some = std::span(scene.receivers).subspan(i, together);
      std::vector<Shading> expected(together), found(together);
      reference.shade(some, expected, grid);
      Gather gather(view, cache, {}, {}, things_left);
      gather.shade(some, found, grid);
      for (std::size_t k = 0; k < together; ++k)
        pairs.push_back({expected[k], found[k], gather.counts().damage.max_bound});
    }
    return pairs;
  }

  struct Run {
    std::vector<Shading> results;
    GatherCounts counts;
  };
  [[nodiscard]] Run shade(LostPages* lost, unsigned threads = 1,
                          std::uint64_t cache_bytes = 64U << 20) const {
    const ThreadPool executor(threads);
    Shader shader(*broken, {.cache_bytes = cache_bytes, .lost = lost}, executor);
    Run run{std::vector<Shading>(scene.receivers.size()), {}};
    Progress silent;
    shader.shade(scene.receivers, run.results, silent);
    run.counts = shader.counts();
    return run;
  }
};

bool same(const Shading& a, const Shading& b) {
  return a.occlusion == b.occlusion && a.bent_normal == b.bent_normal &&
         a.irradiance == b.irradiance && a.sky == b.sky;
}

}  // namespace

TEST_CASE("damage: in a whole scene no page is lost and no bit differs", "[shade][damage]") {
  const Damaged damaged;
  LostPages lost(*damaged.broken);
  const auto run = damaged.shade(&lost);
  CHECK(std::ranges::equal(run.results, damaged.scene.shade(), same));
  CHECK(lost.list().empty());
  CHECK(run.counts.damage.stand_ins == 0);
  CHECK(run.counts.damage.max_bound == 0);
}

TEST_CASE("damage: unless it is tolerated, a lost page is an error that names file, place and rule",
          "[shade][damage]") {
  Damaged damaged;
  for (const std::uint32_t page :
       {damaged.node_pages().back(), damaged.scene.container->point_pages()[30]}) {
    damaged.break_pages({page});
    try {
      static_cast<void>(damaged.shade(nullptr));
      FAIL("page " << page << " was not missed");
    } catch (const FormatError& error) {
      CHECK(error.clause() == "spec/container.md#page-payload");
      CHECK(error.offset() == damaged.broken->entry(page).offset + kPageHeaderBytes);
      CHECK_THAT(error.what(), Catch::Matchers::Contains("broken.ptcx"));
    }
  }
}

TEST_CASE("damage: stand-ins change no receiver by more than its bound", "[shade][damage]") {
  Damaged damaged;
  const std::vector<std::uint32_t> nodes = damaged.node_pages();
  const auto points = damaged.scene.container->point_pages();
  const std::vector<std::vector<std::uint32_t>> trials{
      {points[10]},
      {points[30], points[31], points[60]},
      {nodes.back()},
      {nodes[nodes.size() / 2]},
      {nodes.front(), nodes[1]},
      {points[20], points[21], points[22], nodes[3]}};
  // Alone, and in cells that leave clusters unopened
  const bool full = GENERATE(false, true);
  const std::size_t step = full ? 56 : 7, together = full ? 8 : 1;
  const std::size_t things_left = full ? kFewLeft : Gather::kThingsLeft;
  CAPTURE(full);
  std::size_t changed = 0, tight = 0;
  for (const auto& pages : trials) {
    damaged.break_pages(pages);
    LostPages lost(*damaged.broken);
    for (const Pair& pair : damaged.shade_some(step, lost, together, things_left)) {
      changed += pair.off() > 0.01;
      tight += pair.bound < 0.1;
      if (pair.off() > pair.bound + 0.01)
        FAIL("off by " << pair.off() << ", bound " << pair.bound << ", page " << pages[0]);
      if (pair.bound == 0 && !same(pair.found, pair.expected))
        FAIL("no bound, and off by " << pair.off());
      CHECK(std::isfinite(pair.found.irradiance.g));
    }
    CHECK_FALSE(lost.list().empty());  // some may be needed by no receiver
    for (const auto& [page, why] : lost.list())
      CHECK(std::ranges::find(pages, page) != pages.end());
  }
  if (full) {  // cells are, so that some see another picture
    LostPages lost(*damaged.broken);
    const auto some = damaged.shade_some(step, lost, together, things_left),
               usual = damaged.shade_some(step, lost, together);
    CHECK_FALSE(std::ranges::equal(some, usual, same, &Pair::expected, &Pair::expected));
  }
  CHECK(changed > 20);
  CHECK(tight > damaged.scene.receivers.size() / 7 * trials.size() / 2);
}

TEST_CASE("damage: stand-ins for points that emit light shine as these did",
          "[shade][damage][emission]") {
  std::vector<Surfel> surfels = small_scene(kSpacing);
  const std::size_t dark = surfels.size();
  add_rectangle(surfels, {-1.5, -1.5, 1.6}, {0, 3, 0}, {3, 0, 0}, kSpacing, glm::vec3(0));
  for (std::size_t i = dark; i < surfels.size(); ++i) surfels[i].emission = {0, 8, 1};
  Damaged damaged(surfels, {});
  add_floor_receivers(damaged.scene.receivers, kSpacing);
  std::vector<std::uint32_t> lamps;
  for (const std::uint32_t page : damaged.scene.container->point_pages()) {
    std::vector<Surfel> points;
    append_surfels(*damaged.scene.container, {page, 1}, points);
    if (std::ranges::all_of(points, [](const Surfel& s) { return s.emission.g == 8; }))
      lamps.push_back(page);
  }
  REQUIRE(lamps.size() > 5);
  damaged.break_pages(lamps);
  LostPages lost(*damaged.broken);
  double found = 0, expected = 0, wrong = 0;
  std::size_t stood_in = 0;
  for (const Pair& pair : damaged.shade_some(7, lost)) {
    if (pair.bound == 0) CHECK(same(pair.found, pair.expected));
    stood_in += pair.bound > 0;
    found += static_cast<double>(pair.found.irradiance.g);
    expected += static_cast<double>(pair.expected.irradiance.g);
    wrong += std::abs(static_cast<double>(pair.found.irradiance.g - pair.expected.irradiance.g));
  }
  CHECK(stood_in > 50);
  CHECK(lost.list().size() > 5);
  INFO(found / expected << " of the light, off by " << wrong / expected);
  CHECK(found == Approx(expected).epsilon(0.01));
  CHECK(wrong < 0.01 * expected);
}

TEST_CASE("damage: the worst possible stand-in comes near its bound", "[shade][damage]") {
  // Two piles of equal discs in one leaf: their summed area fills its sphere, and they themselves
  // cover little.
  std::vector<Surfel> piles;
  for (int i = 0; i < 40; ++i) {
    for (const double at : {0.1, 0.3})
      piles.push_back({.position = {at, at, 0}, .normal = {0, 0, 1}, .radius = 0.02F});
  }
  for (int i = 0; i < 100; ++i)
    piles.push_back({.position = glm::dvec3(1 - 1e-4 * i), .normal = {0, 0, 1}, .radius = 1e-5F});
  Damaged damaged(piles, {.leaf_points = 90});
  for (int i = 0; i < 40; ++i) {
    const double turn = 0.04 * i, far = 0.25 + 0.05 * i;
    const glm::dvec3 from(std::sin(turn) * std::cos(3.0 * i), std::sin(turn) * std::sin(3.0 * i),
                          std::cos(turn));
    damaged.scene.receivers.push_back({glm::dvec3(0.2, 0.2, 0) + from * far, -glm::vec3(from)});
  }
  const auto points = damaged.scene.container->point_pages();
  damaged.break_pages({points.begin(), points.end()});
  LostPages lost(*damaged.broken);
  double tightest = 0;
  for (const Pair& pair : damaged.shade_some(1, lost)) {
    CHECK(pair.off() <= pair.bound);
    CHECK(pair.bound < 1);
    tightest = std::max(tightest, pair.off() / pair.bound);
  }
  CHECK(tightest > 0.8);
}

TEST_CASE("damage: neither threads nor the cap change the stand-ins", "[shade][damage]") {
  Damaged damaged;
  const auto points = damaged.scene.container->point_pages();
  damaged.break_pages({points[10], points[30], damaged.node_pages().front()});
  std::optional<Damaged::Run> first;
  for (const unsigned threads : {1U, 3U}) {
    for (const std::uint64_t cap :
         {PageCache::min_bytes(*damaged.broken, threads), std::uint64_t{64} << 20}) {
      LostPages lost(*damaged.broken);
      const auto run = damaged.shade(&lost, threads, cap);
      CHECK(lost.list().size() == 3);
      if (!first) first = run;
      CHECK(std::ranges::equal(run.results, first->results, same));
      CHECK(run.counts.damage.stand_ins == first->counts.damage.stand_ins);
      CHECK(run.counts.damage.receivers == first->counts.damage.receivers);
      CHECK(run.counts.damage.bounds == first->counts.damage.bounds);
      CHECK(run.counts.damage.max_bound == first->counts.damage.max_bound);
    }
  }
  CHECK(first->counts.damage.stand_ins > 0);
}

TEST_CASE("damage: nothing can stand in for a lost root", "[shade][damage]") {
  Damaged damaged;
  damaged.break_pages({damaged.root_page()});
  LostPages lost(*damaged.broken);
  CHECK_THROWS_AS(damaged.shade(&lost), FormatError);
}
