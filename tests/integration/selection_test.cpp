// Parts of containers and clouds, and containers that are joined.
#include <algorithm>
#include <array>
#include <fstream>
#include <numeric>
#include <set>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/pipeline/point_input.h"
#include "engine/store/box_pages.h"
#include "engine/store/point_scan.h"
#include "engine/store/reader.h"
#include "tests/support/read_points.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;

namespace {

const Bounds kBox{{0.2, 0.3, 0.1}, {0.45, 0.5, 0.4}};

bool is_inside(const glm::dvec3& p) {
  for (int axis = 0; axis < 3; ++axis) {
    if (p[axis] < kBox.low[axis] || p[axis] > kBox.high[axis]) return false;
  }
  return true;
}

ReadPoints read_all(const std::filesystem::path& path, const Selection& selection = {}) {
  return read_points(*open_point_input(path, selection).source);
}

std::set<std::array<double, 3>> places(const std::vector<Surfel>& surfels) {
  std::set<std::array<double, 3>> all;
  for (const Surfel& s : surfels) all.insert({s.position.x, s.position.y, s.position.z});
  return all;
}

/// Writes random points as a PLY with the channels classification (i % 5), and number (i, u16).
std::filesystem::path write_cloud(const std::filesystem::path& path, std::size_t count,
                                  std::uint64_t seed) {
  PointWriteInfo info{.count = count, .has_normals = true, .has_radius = true};
  for (const auto& [name, type] :
       {std::pair("classification", ChannelType::u8), std::pair("number", ChannelType::u16)}) {
    Channel channel;
    channel.name = name;
    channel.type = type;
    info.channels.push_back(channel);
  }
  const std::vector<Surfel> surfels = random_surfels(count, seed);
  std::vector<std::byte> rows;
  for (std::size_t i = 0; i < count; ++i) {
    info.bounds.add(surfels[i].position);
    rows.push_back(static_cast<std::byte>(i % 5));
    rows.push_back(static_cast<std::byte>(i & 255));
    rows.push_back(static_cast<std::byte>(i >> 8));
  }
  const auto writer = create_points(path, OutputFormat::ply, info);
  writer->write(surfels, rows);
  writer->finish();
  return path;
}

std::filesystem::path build(const BuildRequest& request, const std::filesystem::path& target) {
  Progress silent;
  build_container(request, target, silent);
  return target;
}

BuildRequest request_of(std::vector<std::filesystem::path> inputs) {
  BuildRequest request;
  request.inputs = std::move(inputs);
  request.page_shift = 12;
  request.profile = Profile::exact;
  request.run = {.memory_bytes = 1 << 28, .threads = 2};
  return request;
}

}  // namespace

TEST_CASE("selection: a box takes the points within, and reads no other pages", "[selection]") {
  const TemporaryDirectory dir;
  write_scene(dir / "a.ptcx", random_surfels(30'000, 3));
  std::vector<Surfel> inside = points_of(dir / "a.ptcx");
  std::erase_if(inside, [](const Surfel& s) { return !is_inside(s.position); });
  REQUIRE(inside.size() > 300);

  // Damage every other page
  std::vector<std::size_t> ranks;
  {
    const ContainerReader container(dir / "a.ptcx");
    ranks = pages_in_box(container, kBox);
    const auto pages = container.point_pages();
    CHECK(ranks.size() < pages.size() / 4);
    std::fstream file(dir / "a.ptcx", std::ios::in | std::ios::out | std::ios::binary);
    for (std::size_t rank = 0; rank < pages.size(); ++rank) {
      if (std::ranges::binary_search(ranks, rank)) continue;
      file.seekp(static_cast<std::streamoff>(container.entry(pages[rank]).offset) + 100);
      file.write("damage", 6);
    }
  }
  CHECK(places(read_all(dir / "a.ptcx", {.box = kBox}).surfels) == places(inside));
  CHECK_THROWS(read_all(dir / "a.ptcx"));
}

TEST_CASE("selection: any box leaves out no page that has a point in it", "[selection]") {
  const TemporaryDirectory dir;
  write_scene(dir / "a.ptcx", random_surfels(5'000, 8));
  const ContainerReader container(dir / "a.ptcx");
  const std::vector<Surfel> corners = random_surfels(200, 11);
  for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
    Bounds box;
    box.add(corners[i].position);
    box.add(corners[i + 1].position);
    const std::vector<std::size_t> ranks = pages_in_box(container, box);
    PointScan scan(container);
    while (scan.next()) {
      if (std::ranges::binary_search(ranks, scan.index())) continue;
      for (std::uint32_t k = 0; k < scan.count(); ++k) {
        const auto p = container.header().frame.to_position(decode_morton(scan.points()[k].key));
        bool within = true;
        for (int axis = 0; axis < 3; ++axis) {
          const double x = p[static_cast<std::size_t>(axis)];
          within = within && x >= box.low[axis] && x <= box.high[axis];
        }
        REQUIRE_FALSE(within);
      }
    }
  }
}

TEST_CASE("selection: classes, every so many, and channels, of clouds and containers alike",
          "[selection]") {
  const TemporaryDirectory dir;
  const auto cloud = write_cloud(dir / "a.ply", 3'000, 5);
  const auto container = build(request_of({cloud}), dir / "a.ptcx");
  const Selection selection{
      .classes = {1, 3}, .every = 4, .channels = std::vector<std::string>{"number"}};
  for (const auto& path : {cloud, container}) {
    const ReadPoints read = read_all(path, selection);
    CHECK(read.surfels.size() == 300);
    REQUIRE(read.rows.size() == 300 * sizeof(std::uint16_t));
    for (std::size_t i = 0; i < 300; ++i) {
      const auto number = read.value<std::uint16_t>(i, 0);
      REQUIRE((number % 5 == 1 || number % 5 == 3));
    }
  }
  CHECK_THROWS_WITH(read_all(cloud, {.channels = std::vector<std::string>{"colour"}}),
                    Contains("no channel named colour") && Contains("classification, number"));
  write_scene(dir / "bare.ptcx", random_surfels(10, 1));
  CHECK_THROWS_AS(read_all(dir / "bare.ptcx", {.classes = {2}}), RequestError);
  CHECK_THROWS_AS(read_all(cloud, {.level = 3}), RequestError);
}

TEST_CASE("selection: a part becomes a container, and parts are joined again", "[selection]") {
  const TemporaryDirectory dir;
  const auto whole = build(request_of({write_cloud(dir / "a.ply", 4'000, 6)}), dir / "a.ptcx");
  BuildRequest request = request_of({whole});
  request.selection.classes = {0, 1};
  const auto low = build(request, dir / "low.ptcx");
  request.selection.classes = {2, 3, 4};
  const auto high = build(request, dir / "high.ptcx");
  const auto joined = build(request_of({low, high}), dir / "joined.ptcx");
  CHECK(ContainerReader(low).superblock().points == 1'600);
  CHECK(ContainerReader(joined).meta().channels == ContainerReader(whole).meta().channels);
  const ReadPoints before = read_all(whole), after = read_all(joined);
  CHECK(places(before.surfels) == places(after.surfels));
  CHECK(before.rows == after.rows);
}

TEST_CASE("selection: a file of points holds what was selected, in the order of the input",
          "[selection]") {
  const TemporaryDirectory dir;
  BuildRequest request = request_of({write_cloud(dir / "a.ply", 2'000, 7)});
  request.original_order = true;
  const auto whole = build(request, dir / "a.ptcx");
  Progress silent;
  container_to_points(ContainerReader(whole), dir / "b.ply",
                      {.original_order = true, .selection = {.classes = {2}}}, silent);
  const ReadPoints read = read_all(dir / "b.ply");
  CHECK(read.surfels.size() == 400);
  for (std::size_t i = 0; i < 400; ++i) {
    REQUIRE(read.value<std::uint16_t>(i, 1) == 5 * i + 2);
  }
}

TEST_CASE("selection: the clusters of a level have the area and the middle of the scene",
          "[selection]") {
  const TemporaryDirectory dir;
  std::vector<Surfel> surfels;
  add_sphere(surfels, {10, 2, 3}, 1, 0.02, glm::vec3(2));
  write_scene(dir / "a.ptcx", surfels);
  const auto area = [](const std::vector<Surfel>& of) {
    return std::accumulate(of.begin(), of.end(), 0.0, [](double sum, const Surfel& s) {
      return sum + 2.0 * static_cast<double>(s.radius) * static_cast<double>(s.radius);
    });
  };
  std::size_t before = 0;
  for (unsigned level = 1; level <= 5; ++level) {
    const std::vector<Surfel> clusters = read_all(dir / "a.ptcx", {.level = level}).surfels;
    CHECK(clusters.size() > before);
    CHECK(area(clusters) == Approx(area(surfels)).epsilon(0.01));
    for (const Surfel& cluster : clusters) {
      const glm::dvec3 from = cluster.position - glm::dvec3(10, 2, 3);
      REQUIRE(glm::dot(glm::normalize(from), glm::dvec3(cluster.normal)) > 0.95);
      REQUIRE(cluster.radiance.g == Approx(2).epsilon(0.02));
    }
    before = clusters.size();
  }
  CHECK(before < surfels.size() / 4);
}
