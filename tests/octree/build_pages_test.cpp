#include <algorithm>
#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <thread>
#include <utility>

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

TEST_CASE("build: node pages that are held lie behind the points, the deepest level first",
          "[build]") {
  const TemporaryDirectory dir;
  write_scene(dir / "a.ptcx", random_surfels(60'000, 10), {}, 12, Codec::raw);
  const ContainerReader reader(dir / "a.ptcx");
  const auto nodes = reader.node_pages();
  REQUIRE(nodes.size() > 2 * kMaxTailPages);
  std::uint64_t end = 0;
  for (const std::uint32_t page : reader.point_pages())
    end = std::max(end, reader.entry(page).offset);
  for (std::size_t rank = 0; rank < nodes.size(); ++rank) {
    const DirectoryEntry& entry = reader.entry(nodes[rank]);
    CHECK(entry.offset > std::exchange(end, entry.offset));
    if (rank == 0) continue;
    const DirectoryEntry& before = reader.entry(nodes[rank - 1]);
    CHECK(before.level >= entry.level);
    if (before.level == entry.level) CHECK(before.first_key < entry.first_key);
  }
}

TEST_CASE("build: node pages that are not held lie some 64 together, the deepest level first",
          "[build]") {
  const TemporaryDirectory dir;
  write_scene(dir / "a.ptcx", random_surfels(100'000, 10), {.leaf_points = 2}, 12, Codec::raw);
  const ContainerReader reader(dir / "a.ptcx");
  std::vector<DirectoryEntry> nodes;
  for (const std::uint32_t page : reader.node_pages()) nodes.push_back(reader.entry(page));
  std::ranges::sort(nodes, {}, &DirectoryEntry::offset);
  REQUIRE(nodes.size() > 600);
  std::size_t rises = 0;
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    if (nodes[i].level > nodes[i - 1].level) ++rises;
  }
  CHECK(rises >= 3);
  CHECK(rises <= nodes.size() / 60);
}

TEST_CASE("build: the tail has as many of the last node pages as fit 150 KB", "[build]") {
  const TemporaryDirectory dir;
  write_scene(dir / "a.ptcx", random_surfels(60'000, 10), {}, 12, Codec::raw);
  const ContainerReader reader(dir / "a.ptcx");
  const Superblock& s = reader.superblock();
  const auto bytes_from = [&](std::size_t rank) {
    std::uint64_t bytes = 0;
    for (; rank < s.node_pages; ++rank)
      bytes += extent_bytes(reader.entry(reader.node_pages()[rank]).stored_bytes);
    return bytes;
  };
  const std::size_t first = s.node_pages - (s.tail.size() - 1);
  REQUIRE((first > 0 && s.tail.size() < kMaxTailPages));
  CHECK(bytes_from(first) <= 150'000);
  CHECK(bytes_from(first - 1) > 150'000);
  CHECK(reader.entry(reader.node_pages()[first - 1]).offset < s.directory_offset);
  CHECK(s.root_page == s.node_pages - 1);
}

TEST_CASE("build: most node pages end where a cell of several groups does", "[build]") {
  const TemporaryDirectory dir;
  write_scene(dir / "a.ptcx", random_surfels(200'000, 11), {}, 14);
  const ContainerReader reader(dir / "a.ptcx");
  const auto nodes = reader.node_pages();
  std::size_t ends = 0, wide = 0;
  for (std::size_t rank = 1; rank < nodes.size(); ++rank) {
    const PageHeader before = reader.read_page_header(nodes[rank - 1]);
    const PageHeader after = reader.read_page_header(nodes[rank]);
    if (before.level != after.level || before.last_key >= after.first_key) continue;
    // The last group of a page and the first of the next one share their cells down to `common`.
    // Groups of one cell share all but the last of theirs.
    const int common = common_level({before.last_key, 0}, {after.first_key, 0});
    ++ends;
    if (common < before.level - 1) ++wide;
  }
  REQUIRE(ends > 100);
  CHECK(wide > ends / 2);  // without regard to cells: an eighth
}

TEST_CASE("build: a container without points has no root", "[build]") {
  const TemporaryDirectory dir;
  write_scene(dir / "empty.ptcx", {});
  const ContainerReader reader(dir / "empty.ptcx");
  CHECK(reader.superblock().points == 0);
  CHECK(reader.superblock().root_page == kNoPage);
  CHECK(reader.point_pages().empty());
}
