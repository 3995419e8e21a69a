#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <thread>

#include <catch2/catch.hpp>

#include "engine/io/cloud/record.h"
#include "engine/octree/radius.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/reader.h"
#include "format/point_page.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

TEST_CASE("build: a container returns its points in order", "[build]") {
  const TemporaryDirectory dir;
  const std::vector<Surfel> surfels = random_surfels(3000, 7);
  const SortedScene scene = sort_scene(surfels);
  for (const Codec codec : {Codec::raw, Codec::zstd}) {
    write_scene(dir / "a.ptcx", surfels, {}, 12, codec);
    const ContainerReader reader(dir / "a.ptcx");
    CHECK(reader.superblock().points == 3000);
    std::vector<std::byte> payload(reader.page_payload_limit());
    PageDecoder decoder;
    std::size_t at = 0;
    for (const std::uint32_t page : reader.point_pages()) {
      const PageHeader header = reader.read_page(page, payload, decoder);
      const PointPage points(payload.data(), header.record_count, kPointBytes);
      for (std::uint32_t i = 0; i < points.size(); ++i, ++at) {
        const PointRecord got = points[i];
        const PointRecord& want = scene.records[at];
        REQUIRE(got.key == want.key);
        REQUIRE(got.radius == want.radius);
        REQUIRE(got.normal == want.normal);
        REQUIRE(got.radiance == want.radiance);
        REQUIRE(got.albedo == want.albedo);
      }
    }
    CHECK(at == 3000);
  }
}

TEST_CASE("build: a container without room for emission refuses points that emit light",
          "[build]") {
  const TemporaryDirectory dir;
  std::vector<Surfel> surfels = random_surfels(500, 7);
  surfels[123].emission = {0, 1, 0};
  SortedScene scene = sort_scene(surfels);
  ContainerWriter writer(dir / "a.ptcx", {.page_shift = 12, .frame = scene.frame});
  VectorStream stream(std::move(scene.records));
  Progress silent;
  CHECK_THROWS_AS(build_pages(stream, writer, {}, ThreadPool(), silent), std::invalid_argument);
}

TEST_CASE("build: the block size of the stream changes no byte of the container", "[build]") {
  const TemporaryDirectory dir;
  const SortedScene scene = sort_scene(random_surfels(5000, 8));
  const auto write = [&](const std::string& name, std::size_t block) {
    ContainerWriter writer(dir / name, {.page_shift = 12, .frame = scene.frame});
    VectorStream stream(scene.records, block);
    Progress silent;
    writer.finish({}, build_pages(stream, writer, {}, ThreadPool(), silent));
  };
  write("one.ptcx", 1);
  write("all.ptcx", 5000);
  CHECK(bytes_of(dir / "one.ptcx") == bytes_of(dir / "all.ptcx"));
}

TEST_CASE("build: radii estimated from any point on equal those of a full pass",
          "[build][checkpoint]") {
  SortedScene scene = sort_scene(random_surfels(140'000, 6));
  for (PointRecord& record : scene.records) record.radius = 0;
  const auto radii = [&](std::uint64_t first) {
    VectorStream points(
        {scene.records.begin() + static_cast<std::ptrdiff_t>(first_for_radii(first)),
         scene.records.end()});
    RadiusCounts counts;
    const auto stream = estimate_radii(points, scene.frame.unit(), counts, first);
    std::vector<float> all;
    std::vector<PointRecord> block(10'000);
    while (const std::size_t count = stream->next(block)) {
      for (const PointRecord& record : std::span(block).first(count)) all.push_back(record.radius);
    }
    return all;
  };
  const std::vector<float> whole = radii(0);
  REQUIRE(whole.size() == scene.records.size());
  for (const std::size_t first :
       {1u, 65'535u, 65'536u, 65'540u, 100'000u, 131'072u, 139'999u, 140'000u}) {
    const bool same =
        radii(first) ==
        std::vector<float>(whole.begin() + static_cast<std::ptrdiff_t>(first), whole.end());
    CHECK(same);
  }
}

TEST_CASE("build: no page is still being written after the stream failed", "[build]") {
  const TemporaryDirectory dir;
  const SortedScene scene = sort_scene(random_surfels(200'000, 9));
  struct Failing : PointStream {
    explicit Failing(const std::vector<PointRecord>& records) : stream(records, 1 << 14) {}
    std::size_t next(std::span<PointRecord> out) override {
      const std::size_t count = stream.next(out);
      if (count == 0) throw std::runtime_error("the stream failed");
      return count;
    }
    VectorStream stream;
  };
  const auto written = [&] { return std::filesystem::directory_iterator(dir / ".")->file_size(); };
  {
    ContainerWriter writer(dir / "a.ptcx", {.frame = scene.frame});
    Failing stream(scene.records);
    Progress silent;
    // The executor is destroyed before the writer: pages that are still being compressed would use
    // it.
    CHECK_THROWS_WITH(build_pages(stream, writer, {}, ThreadPool(2), silent), "the stream failed");
    const std::uintmax_t bytes = written();
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    CHECK(written() == bytes);
  }
  CHECK(std::filesystem::is_empty(dir / "."));
}

TEST_CASE("build: a container without points has no root", "[build]") {
  const TemporaryDirectory dir;
  write_scene(dir / "empty.ptcx", {});
  const ContainerReader reader(dir / "empty.ptcx");
  CHECK(reader.superblock().points == 0);
  CHECK(reader.superblock().root_page == kNoPage);
  CHECK(reader.point_pages().empty());
}

TEST_CASE("radius: discs of an even grid circumscribe its cells", "[build][radius]") {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {300, 0, 0}, {0, 300, 0}, 1, glm::vec3(1));
  for (Surfel& s : surfels) s.radius = 0;
  SortedScene scene = sort_scene(surfels);
  VectorStream sorted(scene.records, 777);
  RadiusCounts counts;
  const auto stream = estimate_radii(sorted, scene.frame.unit(), counts);
  std::vector<PointRecord> block(5000);
  std::size_t seen = 0;
  while (const std::size_t count = stream->next(block)) {
    for (std::size_t i = 0; i < count; ++i, ++seen) {
      REQUIRE(block[i].key == scene.records[seen].key);
      // sqrt(2) sqrt(pi / 12) inside, up to 2 sqrt(pi / 12) at the rim and at seams of the curve
      REQUIRE(block[i].radius >= 0.72F);
      REQUIRE(block[i].radius <= 1.3F);
    }
  }
  CHECK(seen == surfels.size());
}

TEST_CASE("radius: given radii stay, coincident points get the median", "[build][radius]") {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {50, 0, 0}, {0, 50, 0}, 1, glm::vec3(1));
  for (Surfel& s : surfels) s.radius = 0;
  surfels[0].radius = 9;
  for (int i = 0; i < 20; ++i) surfels.push_back(surfels[100]);
  SortedScene scene = sort_scene(surfels);
  VectorStream sorted(scene.records);
  RadiusCounts counts;
  const auto stream = estimate_radii(sorted, scene.frame.unit(), counts);
  std::vector<PointRecord> out(surfels.size());
  REQUIRE(stream->next(out) == out.size());
  std::size_t nines = 0;
  for (const PointRecord& p : out) {
    nines += p.radius == 9;
    REQUIRE(p.radius > 0);
  }
  CHECK(nines == 1);
}

namespace {

/// Returns the radii of up to 2^16 points by their definition, in lattice units: every point
/// against every other.
/// @param each  true: coincident points count each; false: they count as one
std::vector<double> plain_radii(const std::vector<PointRecord>& records, bool each) {
  std::vector<std::array<double, 3>> all, others;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const LatticePoint q = decode_morton(records[i].key);
    all.push_back(
        {static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2])});
    if (each || i == 0 || all[i] != all[i - 1]) others.push_back(all[i]);
  }
  std::vector<double> radii;
  for (const auto& p : all) {
    std::vector<double> squared;
    for (const auto& q : others) {
      const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      squared.push_back(x * x + y * y + z * z);
    }
    const std::size_t nearest = std::min<std::size_t>(7, squared.size()) - 1;
    std::ranges::nth_element(squared, squared.begin() + static_cast<std::ptrdiff_t>(nearest));
    radii.push_back(nearest > 0
                        ? std::sqrt(squared[nearest] * M_PI / (2.0 * static_cast<double>(nearest)))
                        : 0);
  }
  return radii;
}

double middle_of(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

struct Estimated {
  std::vector<float> radii;
  RadiusCounts counts;
};

Estimated estimate(const SortedScene& scene) {
  Estimated estimated;
  VectorStream sorted(scene.records);
  const auto stream = estimate_radii(sorted, scene.frame.unit(), estimated.counts);
  std::vector<PointRecord> block(5000);
  while (const std::size_t count = stream->next(block)) {
    for (const PointRecord& p : std::span(block).first(count)) estimated.radii.push_back(p.radius);
  }
  return estimated;
}

/// Returns random points in the unit cube, and more points in the places of some of them.
SortedScene stacked_scene(std::size_t places, std::size_t more, std::size_t shared) {
  std::vector<Surfel> surfels = random_surfels(places, 3);
  for (std::size_t i = 0; i < more; ++i) surfels.push_back(surfels[i * i % shared]);
  for (Surfel& s : surfels) s.radius = 0;
  return sort_scene(surfels);
}

}  // namespace

TEST_CASE("radius: radii equal their definition to the bit, however many points coincide",
          "[build][radius]") {
  for (const auto& [places, more, shared] :
       {std::array{1500, 0, 1}, std::array{1000, 900, 1000}, std::array{1000, 500, 40},
        std::array{4, 0, 1}, std::array{2, 3, 2}, std::array{5, 1000, 1}}) {
    const SortedScene scene =
        stacked_scene(static_cast<std::size_t>(places), static_cast<std::size_t>(more),
                      static_cast<std::size_t>(shared));
    bool each = true;
    std::vector<double> radii = plain_radii(scene.records, true);
    double middle = middle_of(radii);
    if (middle == 0) {
      each = false;
      radii = plain_radii(scene.records, false);
      std::vector<double> once;
      for (std::size_t i = 0; i < radii.size(); ++i) {
        if (i == 0 || scene.records[i].key != scene.records[i - 1].key) once.push_back(radii[i]);
      }
      middle = middle_of(once);
    }
    CHECK(each == (more <= 900));
    std::vector<float> expected;
    for (const double radius : radii) {
      const double held = radius > 0 ? std::min(radius, 3 * middle) : middle;
      expected.push_back(static_cast<float>(held * scene.frame.unit()));
    }
    const Estimated estimated = estimate(scene);
    const bool same = estimated.radii == expected;
    CHECK(same);
    CHECK(estimated.counts.without_radius == 0);
  }
}

TEST_CASE("radius: points that coincide ten by ten get radii that reach the neighbouring places",
          "[build][radius]") {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {60, 0, 0}, {0, 60, 0}, 1, glm::vec3(1));
  const std::size_t places = surfels.size();
  for (int i = 0; i < 9; ++i)
    surfels.insert(surfels.end(), surfels.begin(), surfels.begin() + 3600);
  for (Surfel& s : surfels) s.radius = 0;
  REQUIRE(places == 3600);
  for (const float radius : estimate(sort_scene(surfels)).radii) {
    REQUIRE(radius >= 0.72F);
    REQUIRE(radius <= 1.3F);
  }
}

TEST_CASE("radius: each place is searched for neighbours once or twice, however many points it has",
          "[build][radius]") {
  const Estimated lone = estimate(stacked_scene(1, 199'999, 1));
  CHECK(lone.counts.searches <= 8);  // two for each chunk
  CHECK(lone.counts.without_radius == 200'000);
  const bool zero = std::ranges::all_of(lone.radii, [](float radius) { return radius == 0; });
  CHECK(zero);
  const Estimated mixed = estimate(stacked_scene(3000, 60'000, 1));
  CHECK(mixed.counts.searches <= 2 * 3001);
  CHECK(mixed.counts.without_radius == 0);
}
