#include <chrono>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <thread>

#include <catch2/catch.hpp>

#include "engine/io/cloud/record.h"
#include "engine/octree/radius.h"
#include "engine/store/reader.h"
#include "format/point_page.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

TEST_CASE("build: a container gives its points back in order", "[build]") {
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
      const PointPage points(payload.data(), header.record_count);
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

TEST_CASE("build: the block size of the stream changes no byte", "[build]") {
  const TemporaryDirectory dir;
  const SortedScene scene = sort_scene(random_surfels(5000, 8));
  const auto write = [&](const std::string& name, std::size_t block) {
    ContainerWriter writer(dir / name, {.page_shift = 12, .frame = scene.frame});
    VectorStream stream(scene.records, block);
    Progress silent;
    writer.finish({}, build_pages(stream, writer, {}, Executor(), silent));
  };
  write("one.ptcx", 1);
  write("all.ptcx", 5000);
  CHECK(bytes_of(dir / "one.ptcx") == bytes_of(dir / "all.ptcx"));
}

TEST_CASE("build: radii of points from any one on are those of all", "[build][checkpoint]") {
  SortedScene scene = sort_scene(random_surfels(140'000, 6));
  for (PointRecord& record : scene.records) record.radius = 0;
  const auto radii = [&](std::uint64_t first) {
    VectorStream points(
        {scene.records.begin() + static_cast<std::ptrdiff_t>(first_for_radii(first)),
         scene.records.end()});
    const auto stream = estimate_radii(points, scene.frame.unit(), first);
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

TEST_CASE("build: when the stream fails no page is on its way any more", "[build]") {
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
    // The executor is gone before the writer is: pages that were still being compressed would use
    // it.
    CHECK_THROWS_WITH(build_pages(stream, writer, {}, Executor(2), silent), "the stream failed");
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

TEST_CASE("radius: discs of an even grid come to circumscribe its cells", "[build][radius]") {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {300, 0, 0}, {0, 300, 0}, 1, glm::vec3(1));
  for (Surfel& s : surfels) s.radius = 0;
  SortedScene scene = sort_scene(surfels);
  VectorStream sorted(scene.records, 777);
  const auto stream = estimate_radii(sorted, scene.frame.unit());
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
  const auto stream = estimate_radii(sorted, scene.frame.unit());
  std::vector<PointRecord> out(surfels.size());
  REQUIRE(stream->next(out) == out.size());
  std::size_t nines = 0;
  for (const PointRecord& p : out) {
    nines += p.radius == 9;
    REQUIRE(p.radius > 0);
  }
  CHECK(nines == 1);
}
