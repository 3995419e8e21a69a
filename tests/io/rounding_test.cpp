// Sentences about rounding come only where a number is really rounded.
#include <cmath>

#include <catch2/catch.hpp>

#include "engine/io/cloud/rounding_survey.h"
#include "tests/io/files.h"
#include "tests/io/writer_inputs.h"

using namespace ptc;
using namespace ptc::test;

namespace {

using Sentences = std::vector<std::string>;

// Returns what is said of points that were measured.
Sentences said(OutputFormat format, PointWriteInfo info, const std::vector<Surfel>& surfels,
               const std::vector<std::byte>& rows = {}) {
  RoundingSurvey survey(format, info);
  survey.add(surfels, rows);
  info.rounding = survey.rounding();
  return losses(format, info);
}

Sentences said(OutputFormat format, const std::vector<Surfel>& surfels) {
  return said(format, plain_info(surfels), surfels);
}

std::vector<Surfel> places(std::initializer_list<double> coordinates) {
  std::vector<Surfel> surfels;
  for (const double x : coordinates) surfels.push_back({.position = {x, -x, 0}});
  return surfels;
}

// Returns what is said of a channel with these values.
template <typename T>
Sentences said_of(OutputFormat format, Channel channel, std::initializer_list<T> values) {
  const std::vector<Surfel> surfels(values.size());
  PointWriteInfo info = plain_info(surfels);
  channel.name = channel.name.empty() ? "c" : channel.name;
  info.channels = {channel};
  std::vector<std::byte> rows;
  for (const T value : values) append_value(rows, value);
  return said(format, info, surfels, rows);
}

constexpr OutputFormat kFloatFormats[] = {OutputFormat::bgeo, OutputFormat::pcd, OutputFormat::ptc,
                                          OutputFormat::usda, OutputFormat::usdc};

}  // namespace

TEST_CASE("rounding: positions that floats hold are not said to be rounded", "[io][writers]") {
  const std::vector<Surfel> floats = places({0.0F, 0.1F, 3.7e-9F, 0.7F});
  const std::vector<Surfel> doubles = places({0.0, 0.1, 0.7});
  for (const OutputFormat format : kFloatFormats) {
    INFO(static_cast<int>(format));
    CHECK(said(format, floats).empty());
    CHECK(said(format, doubles) ==
          Sentences{"Positions are rounded to float, by up to 1.2e-08 units."});
  }
}

TEST_CASE("rounding: floats far from the origin are written as floats where they are",
          "[io][writers]") {
  const std::vector<Surfel> surfels = places({637'000.0625F, 637'000.125F});
  CHECK(said(OutputFormat::pcd, surfels).empty());
  CHECK(said(OutputFormat::usda, surfels).empty());
  PointWriteInfo info = plain_info(surfels);
  const test::TemporaryDirectory scratch;
  write_points(scratch / "a.usda", OutputFormat::usda, info, surfels);
  CHECK(slurp(scratch / "a.usda").find("translate") != std::string::npos);
  RoundingSurvey survey(OutputFormat::usda, info);
  survey.add(surfels, {});
  info.rounding = survey.rounding();
  write_points(scratch / "a.usda", OutputFormat::usda, info, surfels);
  CHECK(slurp(scratch / "a.usda").find("translate") == std::string::npos);
  write_points(scratch / "a.pcd", OutputFormat::pcd, info, surfels);
  CHECK(slurp(scratch / "a.pcd").find("SIZE 4 4 4") != std::string::npos);
}

TEST_CASE("rounding: a translation of USD that leaves floats rounds nothing",
          "[io][writers][usd]") {
  // Multiples of 2^-6, whose middle is one of 2^-7
  CHECK(said(OutputFormat::usda, places({637'000.015'625, 637'001.25, 637'004})).empty());
  CHECK(said(OutputFormat::usda, places({637'000.01, 637'004})) ==
        Sentences{"Positions are rounded to float, by up to 6e-08 units."});
}

TEST_CASE("rounding: a LAS holds decimals and the steps that positions came from",
          "[io][writers][las]") {
  CHECK(said(OutputFormat::las, places({637'000.125, 637'012.001, 0.07})).empty());
  CHECK(said(OutputFormat::las, places({101 * 1e-3, 102 * 1e-3, 103 * 1e-3})).empty());
  CHECK(said(OutputFormat::las, places({0.1F, 0.3F})) ==
        Sentences{"Positions are rounded to steps of 1e-09 units."});

  const auto with_steps = [](const std::vector<Surfel>& surfels) {
    PointWriteInfo info = plain_info(surfels);
    info.text["las.header"] = R"({"scale":[0.25,0.01,0.5],"offset":[0.125,0,0]})";
    return said(OutputFormat::las, info, surfels);
  };
  CHECK(with_steps({{.position = {1.125, 0.07, 2.5}}}).empty());
  CHECK(with_steps({{.position = {1.25, 0.07, 2.5}}}) ==
        Sentences{"Positions are rounded to steps of 0.5 units."});
}

TEST_CASE("rounding: normals and colours that survive are not said to be rounded",
          "[io][writers]") {
  std::vector<Surfel> surfels(1);
  PointWriteInfo info = plain_info(surfels);
  info.has_normals = true;
  surfels[0].normal = {0, 0, -1};
  CHECK(said(OutputFormat::ptc, info, surfels).empty());
  surfels[0].normal = {0.6F, -0.8F, 0};
  CHECK(said(OutputFormat::ptc, info, surfels) ==
        Sentences{"Normals are rounded to 16 bits for each of two angles."});

  info.has_normals = false;
  info.has_albedo = true;
  surfels[0].albedo = {0, 1, 1};
  CHECK(said(OutputFormat::las, info, surfels).empty());
  surfels[0].albedo = {0, 0.25F, 1};
  CHECK(said(OutputFormat::las, info, surfels) ==
        Sentences{"Colours are rounded to 16 bits on the sRGB curve."});
}

TEST_CASE(
    "rounding: values of a channel that its type in the file holds are not said to be rounded",
    "[io][writers]") {
  using enum ChannelType;
  using enum OutputFormat;
  constexpr std::uint32_t kEdge = 1U << 24;
  CHECK(
      said_of<std::uint32_t>(ptc, {.type = u32}, {0, kEdge - 1, kEdge, kEdge + 2, ~0xffU}).empty());
  CHECK(said_of<std::uint32_t>(ptc, {.type = u32}, {kEdge + 1}) ==
        Sentences{"Integers of the channel c are rounded from 2^24 on."});
  CHECK(said_of<std::int32_t>(ptc, {.type = i32}, {-(1 << 24), 1 << 30}).empty());
  CHECK(said_of<std::int32_t>(ptc, {.type = i32}, {-(1 << 24) - 1}).size() == 1);
  CHECK(said_of(ptc, {.type = f64}, {0.5, -3.0, std::nan("")}).empty());
  for (const OutputFormat format : {ptc, bgeo}) {
    CHECK(said_of(format, {.type = f64}, {0.1}) ==
          Sentences{"The channel c is rounded from double to float."});
  }
  CHECK(said_of<std::uint32_t>(bgeo, {.type = u32}, {0x7fff'ffff}).empty());
  CHECK(said_of<std::uint32_t>(bgeo, {.type = u32}, {0x8000'0000}).size() == 1);
  for (const OutputFormat format : {ply, pcd}) {
    CHECK(said_of<std::uint64_t>(format, {.type = u64}, {1ULL << 63, (1ULL << 53) - 1}).empty());
    CHECK(said_of<std::uint64_t>(format, {.type = u64}, {(1ULL << 53) + 1}).size() == 1);
    CHECK(said_of<std::int64_t>(format, {.type = i64}, {-(1LL << 53) - 1}).size() == 1);
  }
  const Channel scaled{.type = i64, .scale = 0.001};
  CHECK(said_of<std::int64_t>(xyz, scaled, {-123'456'789'012}).empty());
  CHECK(said_of<std::int64_t>(xyz, scaled, {1LL << 62}).size() == 1);
  CHECK(said_of<std::uint8_t>(las, {.name = "return_number", .type = u8}, {1, 15}).empty());
  CHECK(said_of<std::uint8_t>(las, {.name = "return_number", .type = u8}, {1, 16}) ==
        Sentences{"Values of the channel return_number above 15 become 15."});
  CHECK(said_of<std::int64_t>(las, {.name = "gps_time", .type = i64}, {5}).empty());
  CHECK(said_of<std::int64_t>(las, {.name = "gps_time", .type = i64}, {(1LL << 53) + 1}).size() ==
        1);
}
