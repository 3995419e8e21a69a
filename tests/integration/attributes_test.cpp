// What a cloud records of its points beyond their surfels: into a container, and out again.
#include "engine/pipeline/build/attributes.h"

#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/unknown_values.h"
#include "engine/pipeline/convert/container_source.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "format/point_page.h"
#include "tests/support/notes.h"
#include "tests/support/read_points.h"
#include "tests/support/scenes.h"

using namespace ptc;
using test::Notes;
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

/// Returns a channel of a container.
Channel channel_of(const std::filesystem::path& path, const std::string& name) {
  const ContainerReader container(path);
  const std::optional<RowPlace> found = find_in_row(container.meta().channels, name);
  if (!found) throw std::out_of_range(name);
  return *found->channel;
}

/// Writes a PLY with a point for each label; without the channel `label` when the labels are -1.
std::filesystem::path write_labels(const std::filesystem::path& path,
                                   const std::vector<int>& labels) {
  const bool has = labels.front() >= 0;
  std::ofstream file(path);
  file << "ply\nformat ascii 1.0\nelement vertex " << labels.size()
       << "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
          "property float ny\nproperty float nz\nproperty float radius\n"
       << (has ? "property uchar label\n" : "") << "end_header\n";
  for (const int label : labels) {
    file << &label - labels.data() << " 0 0 0 0 1 0.5";
    if (has) file << ' ' << label;
    file << '\n';
  }
  return path;
}

/// Returns the values of a channel of one byte.
std::multiset<unsigned> labels_of(const std::filesystem::path& path,
                                  const std::string& name = "label") {
  const ReadPoints read = read_all(path);
  const std::size_t at = offset_of(path, name);
  std::multiset<unsigned> labels;
  for (std::size_t i = 0; i < read.surfels.size(); ++i)
    labels.insert(read.value<std::uint8_t>(i, at));
  return labels;
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

TEST_CASE("attributes: what an input does not record is marked as not known", "[attributes]") {
  const TemporaryDirectory dir;
  const auto first = write_cloud(dir / "first.ply", 0, 500, false);
  const auto second = write_cloud(dir / "second.ply", 500, 500);
  Notes notes;
  build_container(request_of({first, second}), dir / "both.ptcx", notes);
  CHECK(notes.texts ==
        std::vector<std::string>{"first.ply has no time: these values are marked as not known"});
  const Channel time = channel_of(dir / "both.ptcx", "time");
  const ReadPoints read = read_all(dir / "both.ptcx");
  const std::size_t at = offset_of(dir / "both.ptcx", "time");
  std::size_t unknown = 0;
  for (std::size_t i = 0; i < 1000; ++i) {
    unknown += read.value<std::uint64_t>(i, at) == time.no_value;
    CHECK((read.value<double>(i, at) > 0) != std::isnan(read.value<double>(i, at)));
  }
  CHECK(unknown == 500);
  CHECK_FALSE(channel_of(dir / "both.ptcx", "label").no_value);
  // Files that keep the sorted points go the same way
  BuildRequest kept = request_of({first, second});
  kept.resume = true;
  build(kept, dir / "kept.ptcx");
  CHECK(test::bytes_of(dir / "kept.ptcx") == test::bytes_of(dir / "both.ptcx"));
}

TEST_CASE("attributes: no value of a point is taken for not known", "[attributes]") {
  const TemporaryDirectory dir;
  const auto bare = write_labels(dir / "bare.ply", {-1, -1});
  const auto build_labels = [&](int last) {
    Notes notes;
    const auto labelled = write_labels(dir / "labelled.ply", {1, 2, last});
    build_container(request_of({labelled, bare}), dir / "a.ptcx", notes);
    return std::pair(labels_of(dir / "a.ptcx"), notes.texts);
  };
  const auto [marked, mark] = build_labels(254);
  CHECK(channel_of(dir / "a.ptcx", "label").no_value == 255);
  CHECK(marked == std::multiset<unsigned>{1, 2, 254, 255, 255});
  CHECK(mark ==
        std::vector<std::string>{"bare.ply has no label: these values are marked as not known"});
  const auto [plain, why] = build_labels(255);
  CHECK_FALSE(channel_of(dir / "a.ptcx", "label").no_value);
  CHECK(plain == std::multiset<unsigned>{0, 0, 1, 2, 255});
  CHECK(why == std::vector<std::string>{
                   "bare.ply has no label: 0 stands there, because other points use the value that "
                   "would mark what is not known"});
}

TEST_CASE(
    "attributes: the values of a scene are looked at before one of them is taken for not known",
    "[attributes]") {
  const TemporaryDirectory dir;
  for (const unsigned last : {254U, 255U}) {
    build(request_of({write_labels(dir / "scene.ply", {1, 2, static_cast<int>(last)})}),
          dir / "scene.ptcx");
    BuildRequest more = request_of({write_labels(dir / "bare.ply", {-1})});
    more.append = dir / "scene.ptcx";
    build(more, dir / "both.ptcx");
    const bool free = last == 254;
    CHECK(channel_of(dir / "both.ptcx", "label").no_value.has_value() == free);
    CHECK(labels_of(dir / "both.ptcx") == std::multiset<unsigned>{1, 2, last, free ? 255U : 0U});
  }
}

TEST_CASE("attributes: points go on in a channel that is marked, unless they have the mark's value",
          "[attributes]") {
  const TemporaryDirectory dir;
  build(request_of({write_labels(dir / "a.ply", {1}), write_labels(dir / "b.ply", {-1})}),
        dir / "marked.ptcx");
  for (const unsigned added : {7U, 255U}) {
    BuildRequest more = request_of({write_labels(dir / "c.ply", {static_cast<int>(added)})});
    more.append = dir / "marked.ptcx";
    build(more, dir / "more.ptcx");
    const bool goes_on = added == 7;
    CHECK(ContainerReader(dir / "more.ptcx").meta().channels.size() == (goes_on ? 1 : 2));
    CHECK(channel_of(dir / "more.ptcx", "label").no_value == 255);
    CHECK(labels_of(dir / "more.ptcx") == std::multiset<unsigned>{1, 255, goes_on ? added : 255});
    if (goes_on) continue;
    // The second channel has the value that would mark what is not known
    CHECK_FALSE(channel_of(dir / "more.ptcx", "label_2").no_value);
    CHECK(labels_of(dir / "more.ptcx", "label_2") == std::multiset<unsigned>{0, 0, 255});
  }
}

TEST_CASE("attributes: a watch sees the usual mark in every type and component", "[attributes]") {
  for (int type = 1; type <= 11; ++type) {
    const std::vector<Channel> channels{
        {.name = "before", .type = ChannelType::u8},
        {.name = "a", .type = static_cast<ChannelType>(type), .components = 3}};
    Meta meta{.channels = channels};
    const std::uint64_t usual = usual_no_value(channels[1]).value();
    meta.channels[1].no_value = usual;
    CHECK_NOTHROW(encode_meta(meta, kPointBytes));  // it fits the type
    const std::size_t bytes = channels[1].component_bytes();
    const bool is_float = type == 3 || type == 4 || type == 11;
    for (std::size_t component = 0; component < 3; ++component) {
      std::vector<std::byte> rows(2 * row_bytes(channels));
      std::memcpy(&rows[row_bytes(channels) + 1 + component * bytes], &usual, bytes);
      ValueWatch watch(channels), none(channels);
      watch.add(rows);
      none.add(std::span(rows).first(row_bytes(channels)));
      CHECK(watch.taken() == std::vector<bool>{false, !is_float});
      CHECK(none.taken() == std::vector<bool>{false, false});
    }
  }
  CHECK_FALSE(usual_no_value({.name = "later", .type = static_cast<ChannelType>(99), .size = 4}));
}

TEST_CASE("attributes: two channels of an input never become one", "[attributes]") {
  const Channel bytes{.name = "a", .type = ChannelType::u8};
  const Channel words{.name = "a", .type = ChannelType::u16};
  Channel more = words;
  more.name = "a_2";
  AttributePlan plan;
  plan.add_input(std::vector{bytes});
  plan.add_input(std::vector{words, more});
  std::vector<std::string> names;
  for (const Channel& c : plan.channels()) names.push_back(c.name);
  CHECK(names == std::vector<std::string>{"a", "a_2", "a_2_2"});
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
