// Writing clouds as PLY and reading them back.
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/io/cloud/points.h"
#include "tests/io/files.h"
#include "tests/io/writer_inputs.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

namespace {

std::vector<Surfel> make_surfels(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<Surfel> surfels(count);
  for (Surfel& s : surfels) {
    s.position = {1e7 + static_cast<double>(unit(random)), unit(random), -1e-9};
    s.normal = {0, 1, 0};
    s.radius = unit(random);
    s.radiance = {unit(random) * 100, unit(random), 0};
    s.albedo = {unit(random), 1, 0};
    s.emission = {0, unit(random), unit(random) * 1000};
  }
  return surfels;
}

PointWriteInfo info_of(const std::vector<Surfel>& surfels, bool emits) {
  PointWriteInfo info = full_info(surfels);
  info.emits = emits;
  return info;
}

Channel channel(const char* name, std::uint8_t components = 1,
                ChannelRole role = ChannelRole::value) {
  return {.name = name, .type = ChannelType::f32, .components = components, .role = role};
}

std::vector<std::byte> bytes_of(const std::vector<float>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}

}  // namespace

TEST_CASE("ply writer: every value of every surfel is read back bit for bit", "[io][writer]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply";
  for (const bool emits : {false, true}) {
    for (const std::size_t count : {0U, 1U, 20'000U}) {  // none, one, more than one buffer
      const std::vector<Surfel> surfels = make_surfels(count);
      write_points(path, OutputFormat::ply, info_of(surfels, emits), surfels);
      PointFile file = open_points(path);
      CHECK(file.info.count == count);
      CHECK(file.info.has_emission == emits);
      std::vector<Surfel> back(count + 1);
      REQUIRE(file.source->next(back) == count);
      bool same = true;
      for (std::size_t i = 0; i < count; ++i) {
        same = same && back[i].position == surfels[i].position &&
               back[i].normal == surfels[i].normal && back[i].radius == surfels[i].radius &&
               back[i].radiance == surfels[i].radiance && back[i].albedo == surfels[i].albedo &&
               back[i].emission == (emits ? surfels[i].emission : glm::vec3(0));
      }
      CHECK(same);
      CHECK(scratch.listing() == "a.ply");
    }
  }
}

TEST_CASE("ply writer: emission follows the albedo, and only where points may emit light",
          "[io][writer]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply";
  const std::vector<Surfel> surfels = make_surfels(2);
  for (const bool emits : {false, true}) {
    PointWriteInfo info = info_of(surfels, emits);
    info.channels = {channel("a")};
    write_points(path, OutputFormat::ply, info, surfels, bytes_of({5, 6}));
    const std::string bytes = slurp(path);
    const std::string properties =
        emits ? "property float emission_r\nproperty float emission_g\nproperty float emission_b\n"
              : "";
    CHECK_THAT(bytes, Contains("property float albedo_b\n" + properties + "property uchar red\n"));
    const std::size_t record_bytes = 64 + (emits ? 12 : 0) + 3 + 4;
    for (std::size_t i = 0; i < 2; ++i) {
      const std::size_t record = bytes.size() - (2 - i) * record_bytes;
      for (std::size_t k = 0; emits && k < 3; ++k) {
        CHECK(bytes.substr(record + 64 + 4 * k, 4) ==
              raw(surfels[i].emission[static_cast<int>(k)]));
      }
      CHECK(bytes.substr(record + record_bytes - 4, 4) == raw(5.0F + static_cast<float>(i)));
    }
  }
}

TEST_CASE("ply writer: channels follow the values of the surfel", "[io][writer]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply";
  const std::vector<Surfel> surfels = make_surfels(2);
  PointWriteInfo info = info_of(surfels, false);
  info.channels = {channel("occlusion"), channel("irradiance", 3),
                   channel("bent", 3, ChannelRole::direction), channel("pair", 2)};
  const std::vector<float> values = {0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 13, 14, 15, 16, 17, 18};
  write_points(path, OutputFormat::ply, info, surfels, bytes_of(values));
  const std::string bytes = slurp(path);
  CHECK_THAT(bytes, StartsWith("ply\nformat binary_little_endian 1.0\nelement vertex 2\n"));
  CHECK_THAT(bytes, Contains("property uchar blue\nproperty float occlusion\n"
                             "property float irradiance_r\nproperty float irradiance_g\n"
                             "property float irradiance_b\nproperty float bent_x\n"
                             "property float bent_y\nproperty float bent_z\n"
                             "property float pair_0\nproperty float pair_1\nend_header\n"));
  for (std::size_t i = 0; i < 2; ++i) {
    const std::size_t record = bytes.size() - (2 - i) * (64 + 3 + 36);
    for (std::size_t k = 0; k < 9; ++k) {
      CHECK(bytes.substr(record + 67 + 4 * k, 4) == raw(values[9 * i + k]));
    }
  }
  CHECK(open_points(path).info.count == 2);
}

TEST_CASE("ply writer: names that no property can have are refused", "[io][writer]") {
  const test::TemporaryDirectory scratch;
  for (const char* name : {"", "a b", "a\n"}) {
    PointWriteInfo info;
    info.channels = {channel(name)};
    CHECK_THROWS_AS(create_points(scratch / "a.ply", OutputFormat::ply, info),
                    std::invalid_argument);
  }
  CHECK(scratch.listing().empty());
}

TEST_CASE("ply writer: channels get free names, vectors with x, y and z", "[io][writer]") {
  PointWriteInfo info = info_of({}, true);
  info.channels = {channel("bent_normal", 3),
                   channel("sky", 3),
                   channel("a.b"),
                   channel("a_b"),
                   channel("c_r"),
                   channel("c", 3),
                   channel("radiance", 3),
                   channel("radius"),
                   channel("pair", 2),
                   channel("pair_1"),
                   channel("radiance_"),
                   channel("emission", 3),
                   channel("emission_g")};
  const test::TemporaryDirectory scratch;
  write_points(scratch / "a.ply", OutputFormat::ply, info, {});
  std::string properties;
  for (const char* name :
       {"bent_normal_x", "bent_normal_y", "bent_normal_z", "sky_r",       "sky_g",
        "sky_b",         "a_b",           "a_b_",          "c_r",         "c__r",
        "c__g",          "c__b",          "radiance__r",   "radiance__g", "radiance__b",
        "radius_",       "pair_0",        "pair_1",        "pair_1_",     "radiance__",
        "emission__r",   "emission__g",   "emission__b",   "emission_g_"}) {
    properties += std::string("property float ") + name + "\n";
  }
  CHECK_THAT(slurp(scratch / "a.ply"),
             Contains("property uchar blue\n" + properties + "end_header\n"));
}
