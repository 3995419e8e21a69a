#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <thread>

#include <catch2/catch.hpp>

#include "engine/io/cloud/record.h"
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
