// Writing clouds as PLY and reading them back.
#include <random>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/io/cloud/points.h"
#include "tests/io/files.h"

using namespace ptc;
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

}  // namespace

TEST_CASE("ply writer: every value of every surfel is read back bit for bit", "[io][writer]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply";
  for (const bool emits : {false, true}) {
    for (const std::size_t count : {0U, 1U, 20'000U}) {  // none, one, more than one buffer
      const std::vector<Surfel> surfels = make_surfels(count);
      PlyWriter writer(path, count, emits, {});
      const std::size_t half = count / 2;
      writer.write(std::span(surfels).first(half), {});
      writer.write(std::span(surfels).subspan(half), {});
      writer.finish();
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
    PlyWriter writer(path, 2, emits, {{"a", 1}});
    writer.write(surfels, std::vector<float>{5, 6});
    writer.finish();
    const std::string bytes = slurp(path);
    const std::string properties =
        emits ? "property float emission_r\nproperty float emission_g\nproperty float emission_b\n"
              : "";
    CHECK_THAT(bytes, Contains("property float albedo_b\n" + properties + "property float a\n"));
    const std::size_t record_bytes = 64 + (emits ? 12 : 0) + 4;
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

TEST_CASE("ply writer: named columns follow the values of the surfel", "[io][writer]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply";
  const std::vector<Surfel> surfels = make_surfels(2);
  PlyWriter writer(path, 2, false,
                   {{"occlusion", 1}, {"irradiance", 3}, {"bent", 3, true}, {"pair", 2}});
  const std::vector<float> values = {0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 13, 14, 15, 16, 17, 18};
  writer.write(surfels, values);
  writer.finish();
  const std::string bytes = slurp(path);
  CHECK_THAT(bytes, StartsWith("ply\nformat binary_little_endian 1.0\nelement vertex 2\n"));
  CHECK_THAT(bytes, Contains("property float albedo_b\nproperty float occlusion\n"
                             "property float irradiance_r\nproperty float irradiance_g\n"
                             "property float irradiance_b\nproperty float bent_x\n"
                             "property float bent_y\nproperty float bent_z\n"
                             "property float pair_0\nproperty float pair_1\nend_header\n"));
  for (std::size_t i = 0; i < 2; ++i) {
    const std::size_t record = bytes.size() - (2 - i) * (64 + 36);
    for (std::size_t k = 0; k < 9; ++k) {
      CHECK(bytes.substr(record + 64 + 4 * k, 4) == raw(values[9 * i + k]));
    }
  }
  CHECK(open_points(path).info.count == 2);
}

TEST_CASE("ply writer: wrong numbers of points or values leave no file", "[io][writer]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply";
  const std::vector<Surfel> surfels = make_surfels(3);
  for (const std::uint64_t announced : {2U, 4U}) {
    PlyWriter writer(path, announced, false, {});
    writer.write(surfels, {});
    CHECK_THROWS_AS(writer.finish(), std::invalid_argument);
  }
  {
    PlyWriter writer(path, 3, false, {{"a", 1}});
    CHECK_THROWS_AS(writer.write(surfels, {}), std::invalid_argument);
    CHECK_THROWS_AS(writer.write(surfels, std::vector<float>(4)), std::invalid_argument);
  }
  CHECK(scratch.listing().empty());
}

TEST_CASE("ply writer: column names that are invalid or taken are refused", "[io][writer]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply";
  const auto make = [&](std::vector<PointColumn> columns, bool emits = false) {
    PlyWriter writer(path, 0, emits, columns);
  };
  CHECK_THROWS_AS(make({{"", 1}}), std::invalid_argument);
  CHECK_THROWS_AS(make({{"a b", 1}}), std::invalid_argument);
  CHECK_THROWS_AS(make({{"a\n", 1}}), std::invalid_argument);
  CHECK_THROWS_AS(make({{"nx", 1}}), std::invalid_argument);
  CHECK_THROWS_AS(make({{"radiance", 3}}), std::invalid_argument);
  CHECK_THROWS_AS(make({{"a", 1}, {"a", 1}}), std::invalid_argument);
  CHECK_THROWS_AS(make({{"emission", 3}}, true), std::invalid_argument);
  CHECK(scratch.listing().empty());
}

TEST_CASE("ply writer: channels get free names, vectors with x, y and z", "[io][writer]") {
  const auto channel = [](const char* name, std::uint8_t components) {
    return Channel{name, ChannelType::half, components, 1};
  };
  const std::vector<Channel> channels{
      channel("bent_normal", 3), channel("sky", 3),       channel("a.b", 1),
      channel("a_b", 1),         channel("c_r", 1),       channel("c", 3),
      channel("radiance", 3),    channel("radius", 1),    channel("pair", 2),
      channel("pair_1", 1),      channel("radiance_", 1), channel("emission", 3),
      channel("emission_g", 1)};
  const std::vector<PointColumn> columns = ply_columns(channels);
  std::vector<std::string> names;
  for (const PointColumn& column : columns) names.push_back(column.name);
  CHECK(names == std::vector<std::string>{"bent_normal", "sky", "a_b", "a_b_", "c_r", "c_",
                                          "radiance_", "radius_", "pair", "pair_1_", "radiance__",
                                          "emission_", "emission_g_"});
  CHECK(columns[0].vector);
  CHECK_FALSE(columns[1].vector);
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply";
  PlyWriter(path, 0, true, columns).finish();
  CHECK_THAT(slurp(path), Contains("property float bent_normal_x\nproperty float bent_normal_y\n"));
  CHECK_THAT(slurp(path), Contains("property float sky_r\n"));
}
