// What a cloud records of its points beyond their surfels: into a container, and out again.
#include "engine/pipeline/build/attributes.h"

#include <array>
#include <cstring>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/convert/container_source.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "tests/support/read_points.h"
#include "tests/support/scenes.h"

using namespace ptc;
using test::read_points;
using test::ReadPoints;
using test::TemporaryDirectory;

namespace {

/// The values of point i of a cloud, which follow from i alone.
struct Point {
  explicit Point(std::uint32_t i)
      : x(static_cast<float>((i * 7919) % 1009)),
        y(static_cast<float>((i * 104729) % 997)),
        z(static_cast<float>((i * 31) % 101)),
        intensity(static_cast<std::uint16_t>(i * 3)),
        time(i * 0.5 + 1e9),
        label(static_cast<std::uint8_t>(i % 7)) {}
  float x, y, z;
  std::uint16_t intensity;
  double time;
  std::uint8_t label;
};

/// Writes points [first, first + count) as a binary PLY with normals, radii and three attributes.
std::filesystem::path write_cloud(const std::filesystem::path& path, std::uint32_t first,
                                  std::uint32_t count, bool with_time = true) {
  std::ofstream file(path, std::ios::binary);
  file << "ply\nformat binary_little_endian 1.0\nelement vertex " << count
       << "\nproperty float x\nproperty float y\nproperty float z\n"
          "property float nx\nproperty float ny\nproperty float nz\nproperty float radius\n"
          "property ushort intensity\n"
       << (with_time ? "property double time\n" : "") << "property uchar label\nend_header\n";
  const auto put = [&](auto value) {
    file.write(reinterpret_cast<const char*>(&value), sizeof value);
  };
  for (std::uint32_t i = first; i < first + count; ++i) {
    const Point p(i);
    for (const float v : {p.x, p.y, p.z, 0.0F, 0.0F, 1.0F, 0.5F}) put(v);
    put(p.intensity);
    if (with_time) put(p.time);
    put(p.label);
  }
  return path;
}

ReadPoints read_all(const std::filesystem::path& path) {
  const ContainerReader container(path);
  ContainerSource source(container);
  return read_points(source);
}

/// Returns the offset of a channel in a row.
std::size_t offset_of(const std::filesystem::path& path, const std::string& name) {
  const ContainerReader container(path);
  std::size_t at = 0;
  for (const Channel& c : container.meta().channels) {
    if (c.name == name) return at;
    at += c.component_bytes() * c.components;
  }
  throw std::out_of_range(name);
}

BuildRequest request_of(std::vector<std::filesystem::path> inputs, std::uint64_t memory = 1 << 28) {
  BuildRequest request;
  request.inputs = std::move(inputs);
  request.page_shift = 12;
  request.profile = Profile::exact;
  request.run = {.memory_bytes = memory, .threads = 2};
  return request;
}

void build(const BuildRequest& request, const std::filesystem::path& target) {
  Progress quiet;
  build_container(request, target, quiet);
}

/// Checks that the attributes of every point are those of the point at its position.
void check_attributes(const std::filesystem::path& path, std::uint32_t count) {
  std::map<std::array<double, 3>, Point> points;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Point p(i);
    points.emplace(std::array<double, 3>{p.x, p.y, p.z}, p);
  }
  REQUIRE(points.size() == count);  // positions differ, so that they tell the points apart
  const ReadPoints read = read_all(path);
  REQUIRE(read.surfels.size() == count);
  const std::size_t intensity = offset_of(path, "intensity"), time = offset_of(path, "time"),
                    label = offset_of(path, "label");
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 at = glm::round(read.surfels[i].position);
    const auto found = points.find({at.x, at.y, at.z});
    REQUIRE(found != points.end());
    const Point& p = found->second;
    wrong += read.value<std::uint16_t>(i, intensity) != p.intensity ||
             read.value<double>(i, time) != p.time || read.value<std::uint8_t>(i, label) != p.label;
  }
  CHECK(wrong == 0);
}

}  // namespace

TEST_CASE("attributes: every point keeps its values through sort and build", "[attributes]") {
  const TemporaryDirectory dir;
  const auto cloud = write_cloud(dir / "a.ply", 0, 20'000);
  build(request_of({cloud}), dir / "a.ptcx");
  check_attributes(dir / "a.ptcx", 20'000);
  Progress quiet;
  CHECK(verify_container(dir / "a.ptcx", {.level = VerifyLevel::rebuild}, quiet).sound());
}

TEST_CASE("attributes: memory, threads and the spill change no byte", "[attributes]") {
  const TemporaryDirectory dir;
  const auto cloud = write_cloud(dir / "a.ply", 0, 50'000);
  build(request_of({cloud}), dir / "a.ptcx");
  BuildRequest kept = request_of({cloud});
  kept.resume = true;  // all points go through temporary files
  kept.run.threads = 1;
  build(kept, dir / "b.ptcx");
  CHECK(test::bytes_of(dir / "a.ptcx") == test::bytes_of(dir / "b.ptcx"));
  CHECK(std::distance(std::filesystem::directory_iterator(dir.path()), {}) == 3);
}

TEST_CASE("attributes: appended points give what one build of all gives", "[attributes]") {
  const TemporaryDirectory dir;
  const auto first = write_cloud(dir / "first.ply", 0, 9'000);
  const auto second = write_cloud(dir / "second.ply", 9'000, 6'000);
  build(request_of({first}), dir / "first.ptcx");
  BuildRequest more = request_of({second});
  more.append = dir / "first.ptcx";
  build(more, dir / "both.ptcx");
  check_attributes(dir / "both.ptcx", 15'000);
}

TEST_CASE("attributes: what an input does not record is 0", "[attributes]") {
  const TemporaryDirectory dir;
  const auto first = write_cloud(dir / "first.ply", 0, 500, false);
  const auto second = write_cloud(dir / "second.ply", 500, 500);
  build(request_of({first, second}), dir / "both.ptcx");
  const ReadPoints read = read_all(dir / "both.ptcx");
  const std::size_t time = offset_of(dir / "both.ptcx", "time");
  std::size_t unknown = 0;
  for (std::size_t i = 0; i < 1000; ++i) unknown += read.value<double>(i, time) == 0;
  CHECK(unknown == 500);
}

TEST_CASE("attributes: the order of the input comes back", "[attributes]") {
  const TemporaryDirectory dir;
  const auto cloud = write_cloud(dir / "a.ply", 0, 30'000);
  BuildRequest request = request_of({cloud});
  request.original_order = true;
  build(request, dir / "a.ptcx");
  Progress quiet;
  container_to_points(ContainerReader(dir / "a.ptcx"), dir / "b.ply", {.original_order = true},
                      quiet);
  const PointFile written = open_points(dir / "b.ply");
  const ReadPoints read = read_points(*written.source);
  REQUIRE(read.surfels.size() == 30'000);
  REQUIRE(written.info.channels.size() == 3);
  const auto at = [&](const char* name) {
    return find_in_row(written.info.channels, name)->offset;
  };
  std::size_t wrong = 0;
  for (std::uint32_t i = 0; i < 30'000; ++i) {
    const Point p(i);
    wrong += glm::round(read.surfels[i].position) != glm::dvec3(p.x, p.y, p.z) ||
             read.value<std::uint16_t>(i, at("intensity")) != p.intensity ||
             read.value<double>(i, at("time")) != p.time ||
             read.value<std::uint8_t>(i, at("label")) != p.label;
  }
  CHECK(wrong == 0);
}

TEST_CASE("attributes: an order that was not recorded is refused", "[attributes]") {
  const TemporaryDirectory dir;
  build(request_of({write_cloud(dir / "a.ply", 0, 100)}), dir / "a.ptcx");
  Progress quiet;
  CHECK_THROWS_AS(container_to_points(ContainerReader(dir / "a.ptcx"), dir / "b.ply",
                                      {.original_order = true}, quiet),
                  RequestError);
  CHECK_FALSE(std::filesystem::exists(dir / "b.ply"));
}

TEST_CASE("attributes: a plan joins equal channels and tells different ones apart",
          "[attributes]") {
  const Channel intensity{.name = "intensity", .type = ChannelType::u16};
  Channel other = intensity;
  other.type = ChannelType::f32;
  const Channel wide{.name = "descriptor", .type = ChannelType::f32, .components = 16};
  const Channel shaded{.name = "occlusion", .type = ChannelType::f32};
  AttributePlan plan;
  CHECK(plan.add_input(std::vector{intensity, wide}) == 0);
  CHECK(plan.add_input(std::vector{other, intensity, shaded}) == 1);
  std::vector<std::string> names;
  for (const Channel& c : plan.channels()) names.push_back(c.name);
  CHECK(names == std::vector<std::string>{"intensity", "descriptor_0", "descriptor_1",
                                          "descriptor_2", "intensity_2", "occlusion_2"});
  for (std::size_t i = 1; i < plan.channels().size(); ++i)
    CHECK(plan.channels()[i].group >= plan.channels()[i - 1].group);
  for (std::size_t group = 0; group < plan.groups(); ++group)
    CHECK(plan.group_bytes(group) <= kGroupBytes);
  CHECK(plan.row_bytes(0) == 66);
  CHECK(plan.row_bytes(1) == 10);
}
