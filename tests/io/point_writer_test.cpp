// What all writers of points have in common, and the columns of PLY and XYZ.
#include <algorithm>
#include <array>
#include <limits>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/image/srgb.h"
#include "format/bytes.h"
#include "tests/io/files.h"
#include "tests/io/writer_inputs.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Catch::Matchers::Equals;

namespace {

constexpr std::array kFormats = {OutputFormat::bgeo, OutputFormat::las, OutputFormat::pcd,
                                 OutputFormat::ply,  OutputFormat::ptc, OutputFormat::usda,
                                 OutputFormat::usdc, OutputFormat::xyz};

Channel channel(const char* name, ChannelType type, std::uint8_t components = 1,
                ChannelRole role = ChannelRole::value) {
  return {.name = name, .type = type, .components = components, .role = role};
}

// Returns the field that the RequestError thrown by `call` names.
template <typename Call>
std::string refused_field(const Call& call) {
  try {
    call();
  } catch (const RequestError& error) {
    return error.field();
  }
  return {};
}

}  // namespace

TEST_CASE("point writers: a wrong number of points leaves the target as it was", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(5);
  for (const OutputFormat format : kFormats) {
    INFO(static_cast<int>(format));
    const auto path = scratch.file("a", "old");
    for (const std::size_t given : {0U, 4U, 5U}) {
      PointWriteInfo info = full_info(surfels);
      info.count = given == 5 ? 3 : 5;  // too few come, or too many
      const auto writer = create_points(path, format, info);
      writer->write(std::span(surfels).first(given), {});
      CHECK_THROWS_AS(writer->finish(), std::invalid_argument);
    }
    CHECK(slurp(path) == "old");
    CHECK(scratch.listing() == "a");
    write_points(path, format, full_info(surfels), surfels);
    CHECK(slurp(path) != "old");
    CHECK(scratch.listing() == "a");
  }
}

TEST_CASE("point writers: rows of another length than the channels say are refused",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(3);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {channel("a", ChannelType::u16), channel("b", ChannelType::f32, 3)};
  for (const OutputFormat format : kFormats) {
    const auto writer = create_points(scratch / "a", format, info);
    for (const std::size_t bytes : {0U, 3U * 14 - 1, 3U * 14 + 1}) {
      const std::vector<std::byte> rows(bytes);
      CHECK_THROWS_AS(writer->write(surfels, rows), std::invalid_argument);
    }
  }
  CHECK(scratch.listing().empty());
}

TEST_CASE("point writers: the same points in other blocks give the same bytes", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(40'000);  // more than one buffer
  PointWriteInfo info = full_info(surfels);
  info.channels = {channel("a", ChannelType::u32)};
  std::vector<std::byte> rows;
  for (std::uint32_t i = 0; i < 40'000; ++i) append_value(rows, i);
  for (const OutputFormat format : kFormats) {
    INFO(static_cast<int>(format));
    write_points(scratch / "whole", format, info, surfels, rows);
    const auto writer = create_points(scratch / "pieces", format, info);
    for (std::size_t i = 0; i < surfels.size(); i += 7) {
      const std::size_t count = std::min<std::size_t>(7, surfels.size() - i);
      writer->write(std::span(surfels).subspan(i, count),
                    std::span(rows).subspan(4 * i, 4 * count));
    }
    writer->finish();
    CHECK(slurp(scratch / "whole") == slurp(scratch / "pieces"));
  }
}

TEST_CASE("point writers: a file without points is a file", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  PointWriteInfo info;
  info.has_normals = info.has_albedo = true;
  info.channels = {channel("a", ChannelType::f64, 2)};
  for (const OutputFormat format : kFormats) {
    INFO(static_cast<int>(format));
    write_points(scratch / "a", format, info, {});
    CHECK(slurp(scratch / "a").size() > 10);
    static_cast<void>(losses(format, info));
  }
}

TEST_CASE("point writers: the ending of a name chooses the format", "[io][writers]") {
  CHECK(output_format("a.bgeo") == OutputFormat::bgeo);
  CHECK(output_format("a.LAS") == OutputFormat::las);
  CHECK(output_format("a.pcd") == OutputFormat::pcd);
  CHECK(output_format("dir.las/a.ply") == OutputFormat::ply);
  CHECK(output_format("a.ptc") == OutputFormat::ptc);
  CHECK(output_format("a.usd") == OutputFormat::usdc);
  CHECK(output_format("a.usda") == OutputFormat::usda);
  CHECK(output_format("a.usdc") == OutputFormat::usdc);
  CHECK(output_format("a.xyz") == OutputFormat::xyz);
  CHECK(output_format("a.txt") == OutputFormat::xyz);
  CHECK_FALSE(output_format("a.ptcx"));
  CHECK_FALSE(output_format("a.e57"));
  CHECK_FALSE(output_format("las"));
  CHECK(refused_field([] { static_cast<void>(output_format("a.laz")); }) == "target");
  CHECK_THROWS_WITH(output_format("a.laz"), Contains(".las"));
}

TEST_CASE("point writers: a colour from a channel needs the channel, and a format with colours",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {channel("occlusion", ChannelType::half), channel("pair", ChannelType::half, 2)};
  const std::vector<std::byte> rows(6);
  for (const OutputFormat format : kFormats) {
    INFO(static_cast<int>(format));
    const auto field_for = [&](const char* name) {
      info.colour_from = name;
      return refused_field([&] { write_points(scratch / "a", format, info, surfels, rows); });
    };
    const bool shows = format != OutputFormat::ptc && format != OutputFormat::xyz;
    CHECK(field_for("occlusion") == (shows ? "" : "colour_from"));
    CHECK(field_for("pair") == "colour_from");
    CHECK(field_for("none") == "colour_from");
    CHECK(field_for("").empty());
  }
}

TEST_CASE("point writers: channels of a later version's type are left out, and that is said",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {
      {.name = "later", .type = static_cast<ChannelType>(200), .components = 3, .size = 2},
      channel("seen", ChannelType::u8)};
  std::vector<std::byte> rows(6, std::byte{0xee});
  rows.push_back(std::byte{77});
  for (const OutputFormat format : kFormats) {
    INFO(static_cast<int>(format));
    write_points(scratch / "a", format, info, surfels, rows);
    CHECK(slurp(scratch / "a").find("later") == std::string::npos);
    const std::vector<std::string> sentences = losses(format, info);
    REQUIRE_FALSE(sentences.empty());
    CHECK_THAT(sentences.back(), Contains("channel later is left out"));
  }
  write_points(scratch / "a", OutputFormat::ply, info, surfels, rows);
  CHECK(slurp(scratch / "a").back() == 77);
}

TEST_CASE("point writers: numbers that stand for not known are named where a file does not say so",
          "[io][writers]") {
  PointWriteInfo info = plain_info(surfels_of(1));
  info.channels = {channel("class", ChannelType::u8),   channel("angle", ChannelType::i16),
                   channel("id", ChannelType::u64),     channel("time", ChannelType::f64),
                   channel("height", ChannelType::f32), channel("known", ChannelType::u8)};
  const std::array<std::uint64_t, 5> bits{0xff, 0x8000, ~std::uint64_t{0}, 0x7ff8000000000000,
                                          0xc61c3c00};
  for (std::size_t i = 0; i < bits.size(); ++i) info.channels[i].no_value = bits[i];
  for (const OutputFormat format : kFormats) {
    const std::vector<std::string> sentences = unknown_losses(format, info);
    if (format == OutputFormat::las) {
      CHECK(sentences.empty());  // the descriptions of extra bytes say it
    } else {
      CHECK(sentences == std::vector<std::string>{
                             "The file does not say that these stand for \"not known\": class 255, "
                             "angle -32768, id 18446744073709551615, height -9999."});
    }
    for (const std::string& sentence : sentences) {
      const std::vector<std::string> all = losses(format, info);
      CHECK(std::ranges::find(all, sentence) != all.end());
    }
  }
}

TEST_CASE("point writers: where the stored colour is not known, viewers show the albedo",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {channel("rgb", ChannelType::u8, 3)};
  info.channels[0].colour_space = ColourSpace::srgb;
  info.channels[0].no_value = 0xff;
  write_points(scratch / "a", OutputFormat::ply, info, surfels,
               std::vector<std::byte>(3, std::byte{0xff}));
  CHECK(slurp(scratch / "a").ends_with(std::string("\x89\xff\0", 3)));  // sRGB of 1/4, 1 and 0
  for (const OutputFormat format : {OutputFormat::las, OutputFormat::ply, OutputFormat::pcd}) {
    CHECK(
        unknown_losses(format, info) ==
        std::vector<std::string>{"Points without a colour of their own get that of their albedo."});
  }
}

TEST_CASE("point writers: a colour of 16 bits comes back to the last bit, whatever the format",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const float rounding = GENERATE(0.0F, 1 / 510.0F);  // of the albedo, as in a container
  constexpr std::size_t kPoints = 3000;
  std::vector<Surfel> surfels = surfels_of(static_cast<int>(kPoints));
  std::vector<std::byte> rows;
  std::vector<std::array<std::uint16_t, 3>> colours(kPoints);
  for (std::size_t i = 0; i < kPoints; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      colours[i][k] = static_cast<std::uint16_t>((i * 3 + k) * 7919 % 65536);
      append_value(rows, colours[i][k]);
      surfels[i].albedo[static_cast<int>(k)] =
          static_cast<float>(srgb_to_linear(colours[i][k] / 65535.0));
    }
  }
  PointWriteInfo info = plain_info(surfels);
  info.has_albedo = true;
  info.channels = {stored_colour(ChannelType::u16)};
  struct Case {
    const char* name;
    OutputFormat format;
    bool keeps_channel;  // else the albedo gives the colour back
  };
  for (const Case& c :
       {Case{"a.bgeo", OutputFormat::bgeo, false}, Case{"a.pcd", OutputFormat::pcd, true},
        Case{"a.ply", OutputFormat::ply, true}, Case{"a.ptc", OutputFormat::ptc, false}}) {
    CAPTURE(c.name);
    std::vector<Surfel> rounded = surfels;
    for (Surfel& surfel : rounded)
      surfel.albedo = glm::max(surfel.albedo - glm::vec3(rounding), glm::vec3(0));
    write_points(scratch / c.name, c.format, info, rounded, rows);
    const PointFile file = open_points(scratch / c.name);
    std::vector<Surfel> back(kPoints + 1);
    REQUIRE(file.source->next(back) == kPoints);
    if (c.keeps_channel) {
      REQUIRE(file.info.channels.size() == 1);
      CHECK(file.info.channels[0].name == "rgb");
      CHECK(file.info.channels[0].type == ChannelType::u16);
      CHECK(std::ranges::equal(file.source->attributes(), rows));
      continue;
    }
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < colours.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto light = static_cast<double>(back[i].albedo[static_cast<int>(k)]);
        wrong += std::lround(65535 * linear_to_srgb(light)) == colours[i][k] ? 0U : 1U;
      }
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("point writers: bytes of a colour in wider fields are written as a colour of bytes",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {stored_colour(ChannelType::u16, kByteScale)};
  std::vector<std::byte> rows;
  for (const std::uint16_t v : std::initializer_list<std::uint16_t>{1, 128, 255})
    append_value(rows, v);
  write_points(scratch / "a", OutputFormat::ply, info, surfels, rows);
  const std::string bytes = slurp(scratch / "a");
  CHECK_THAT(bytes, Contains("double z\nproperty uchar red\nproperty uchar green\n"
                             "property uchar blue\nend_header\n"));
  CHECK_THAT(bytes, EndsWith("\x01\x80\xff"));
  info.channels[0].no_value = 1;
  CHECK(unknown_losses(OutputFormat::ply, info) ==
        std::vector<std::string>{"Points without a colour of their own get that of their albedo."});
}

TEST_CASE("point writers: a surface's colour with a scale is shown with white at 1",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {channel("paint", ChannelType::u8, 3, ChannelRole::colour)};
  info.channels[0].colour_space = ColourSpace::srgb;
  info.channels[0].scale = 1 / 5.0;
  info.colour_from = "paint";
  write_points(scratch / "a", OutputFormat::ply, info, surfels,
               {std::byte{5}, std::byte{1}, std::byte{0}});
  CHECK(slurp(scratch / "a").ends_with(std::string("\xff\x33\0\x05\x01\0", 6)));
}

TEST_CASE("point writers: losses tell what is rounded, by how much, and what is missing",
          "[io][writers]") {
  PointWriteInfo info = plain_info(surfels_of(2));
  info.bounds.add(glm::dvec3(650'000, 0, 0));
  CHECK(losses(OutputFormat::ply, info).empty());
  CHECK(losses(OutputFormat::xyz, info).empty());
  info.channels = {channel("id", ChannelType::u64),
                   channel("time", ChannelType::f64),
                   channel("small", ChannelType::u16),
                   {.name = "angle", .type = ChannelType::i16, .scale = 0.006}};
  info.text["crs"] = "GEOGCS[]";
  const auto said = [&](OutputFormat format) {
    std::string text;
    for (const std::string& sentence : losses(format, info)) text += sentence + "\n";
    return text;
  };
  const std::string scale =
      "The file does not say that a value v of the channel angle means 0.006 v + 0.\n";
  const std::string crs = "The file does not name its coordinate reference system.\n";
  CHECK_THAT(said(OutputFormat::xyz), Equals(crs));
  CHECK_THAT(said(OutputFormat::ply),
             Equals("Integers of the channel id are rounded from 2^53 on.\n" + scale + crs));
  // 650,000 lies between 2^19 and 2^20, where floats are 2^-4 apart.
  CHECK_THAT(said(OutputFormat::ptc),
             Equals("Positions are rounded to float, by up to 0.031 units.\n"
                    "Integers of the channel id are rounded from 2^24 on.\n"
                    "The channel time is rounded from double to float.\n" +
                    scale + crs));
  CHECK_THAT(said(OutputFormat::bgeo), Contains("Integers of the channel id that do not fit"));
  CHECK_THAT(said(OutputFormat::las), Equals("Positions are rounded to steps of 0.001 units.\n"));
}

TEST_CASE("point writers: a PLY has each channel in its own type", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  std::vector<std::byte> rows;
  const auto add = [&](const char* name, ChannelType type, auto value) {
    info.channels.push_back(channel(name, type));
    append_value(rows, value);
  };
  add("a", ChannelType::u8, std::uint8_t{200});
  add("b", ChannelType::i8, std::int8_t{-100});
  add("c", ChannelType::u16, std::uint16_t{60'000});
  add("d", ChannelType::i16, std::int16_t{-30'000});
  add("e", ChannelType::u32, std::uint32_t{4'000'000'000});
  add("f", ChannelType::i32, std::int32_t{-2'000'000'000});
  add("g", ChannelType::u64, std::uint64_t{1} << 53 | 1);  // a tie, which goes to the even one
  add("h", ChannelType::i64, std::int64_t{-5});
  add("i", ChannelType::half, std::uint16_t{0x3c01});  // 1 + 2^-10
  add("j", ChannelType::f32, 0.1F);
  add("k", ChannelType::f64, 0.1);
  write_points(scratch / "a.ply", OutputFormat::ply, info, surfels, rows);
  const std::string bytes = slurp(scratch / "a.ply");
  CHECK_THAT(bytes, Contains("element vertex 1\nproperty double x\nproperty double y\n"
                             "property double z\nproperty uchar a\nproperty char b\n"
                             "property ushort c\nproperty short d\nproperty uint e\n"
                             "property int f\nproperty double g\nproperty double h\n"
                             "property float i\nproperty float j\nproperty double k\n"
                             "end_header\n"));
  CHECK(bytes.substr(bytes.find("end_header\n") + 11) ==
        raw(10.0) + raw(20.5) + raw(0.0) + raw(std::uint8_t{200}) + raw(std::int8_t{-100}) +
            raw(std::uint16_t{60'000}) + raw(std::int16_t{-30'000}) +
            raw(std::uint32_t{4'000'000'000}) + raw(std::int32_t{-2'000'000'000}) + raw(0x1p53) +
            raw(-5.0) + raw(1.0F + 0x1p-10F) + raw(0.1F) + raw(0.1));
  CHECK(open_points(scratch / "a.ply").info.count == 1);
}

TEST_CASE("point writers: a PLY has those numbers of a surfel that are worth writing",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(2);
  const std::string all =
      "property float nx\nproperty float ny\nproperty float nz\nproperty float radius\n"
      "property float radiance_r\nproperty float radiance_g\nproperty float radiance_b\n"
      "property float albedo_r\nproperty float albedo_g\nproperty float albedo_b\n"
      "property float emission_r\nproperty float emission_g\nproperty float emission_b\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  write_points(scratch / "a.ply", OutputFormat::ply, full_info(surfels), surfels);
  CHECK_THAT(slurp(scratch / "a.ply"), Contains("property double z\n" + all + "end_header\n"));
  PointFile file = open_points(scratch / "a.ply");
  std::vector<Surfel> back(3);
  REQUIRE(file.source->next(back) == 2);
  CHECK(back[1].position == surfels[1].position);
  CHECK(back[1].normal == surfels[1].normal);
  CHECK(back[1].radiance == surfels[1].radiance);
  CHECK(back[1].emission == surfels[1].emission);
  CHECK(back[1].albedo == surfels[1].albedo);
  CHECK(back[1].radius == surfels[1].radius);

  PointWriteInfo some = plain_info(surfels);
  some.has_radius = true;
  write_points(scratch / "b.ply", OutputFormat::ply, some, surfels);
  CHECK_THAT(slurp(scratch / "b.ply"),
             Contains("property double z\nproperty float radius\nend_header\n"));
  file = open_points(scratch / "b.ply");
  CHECK_FALSE(file.info.has_normals);
  CHECK_FALSE(file.info.has_albedo);
  REQUIRE(file.source->next(back) == 2);
  CHECK(back[1].radius == surfels[1].radius);
}

TEST_CASE("point writers: components of directions and vectors are x, y and z", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {channel("bent", ChannelType::u8, 3, ChannelRole::direction),
                   channel("flow", ChannelType::u8, 3, ChannelRole::vector),
                   channel("my_normals", ChannelType::u8, 3),
                   channel("sky.x", ChannelType::u8, 3, ChannelRole::colour),
                   channel("pair", ChannelType::u8, 2)};
  write_points(scratch / "a.ply", OutputFormat::ply, info, surfels, std::vector<std::byte>(14));
  std::string expected;
  for (const char* name :
       {"bent_x", "bent_y", "bent_z", "flow_x", "flow_y", "flow_z", "my_normals_x", "my_normals_y",
        "my_normals_z", "sky_x_r", "sky_x_g", "sky_x_b", "pair_0", "pair_1"}) {
    expected += std::string("property uchar ") + name + "\n";
  }
  CHECK_THAT(slurp(scratch / "a.ply"), Contains("property double z\n" + expected + "end_header"));
}

TEST_CASE("point writers: numbers of an XYZ read back to the same bits", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  std::vector<Surfel> surfels = surfels_of(2);
  surfels[1].position = {0.1, 1e-300, -637'291.123'456'789};
  surfels[1].radius = 0.1F;
  PointWriteInfo info = full_info(surfels);
  info.emits = info.has_albedo = false;
  write_points(scratch / "a.xyz", OutputFormat::xyz, info, surfels);
  CHECK_THAT(slurp(scratch / "a.xyz"),
             Equals("# x y z nx ny nz radius radiance_r radiance_g radiance_b\n"
                    "10 20.5 0 0 0 1 0.5 0 0 0.125\n"
                    "0.1 1e-300 -637291.123456789 0.6 -0.8 0 0.1 1 2 0.125\n"));
  PointFile file = open_points(scratch / "a.xyz");
  std::vector<Surfel> back(3);
  REQUIRE(file.source->next(back) == 2);
  CHECK(back[1].position == surfels[1].position);
  CHECK(back[1].normal == surfels[1].normal);
  CHECK(back[1].radius == surfels[1].radius);
}

TEST_CASE("point writers: an XYZ has a column for each component of a channel", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.has_albedo = true;
  info.emits = true;
  info.channels = {channel("id", ChannelType::u64), channel("x", ChannelType::i8),
                   channel("sky", ChannelType::half, 3), channel("t", ChannelType::f64)};
  std::vector<std::byte> rows;
  append_value(rows, std::numeric_limits<std::uint64_t>::max());
  append_value(rows, std::int8_t{-3});
  for (const std::uint16_t half : std::initializer_list<std::uint16_t>{0x3c00, 0x0001, 0x7c00})
    append_value(rows, half);
  append_value(rows, 0.1);
  write_points(scratch / "a.xyz", OutputFormat::xyz, info, surfels, rows);
  CHECK_THAT(slurp(scratch / "a.xyz"),
             Equals("# x y z albedo_r albedo_g albedo_b emission_r emission_g emission_b id x_ "
                    "sky_r sky_g sky_b t\n"
                    "10 20.5 0 0.25 1 0 0 0 3 18446744073709551615 -3 1 5.9604645e-08 inf 0.1\n"));
}

TEST_CASE("point writers: text has what scaled values mean, and NaN where they are not known",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {
      {.name = "a", .type = ChannelType::i16, .no_value = 0x8000, .scale = 0.1, .offset = -3},
      {.name = "b", .type = ChannelType::u8, .scale = 0.125},
      {.name = "rgb",
       .type = ChannelType::u16,
       .components = 3,
       .role = ChannelRole::colour,
       .colour_space = ColourSpace::srgb,
       .scale = kByteScale},
      {.name = "wide", .type = ChannelType::i64, .scale = 0.5}};
  std::vector<std::byte> rows;
  for (const std::int16_t a : std::initializer_list<std::int16_t>{696, -32768}) {
    append_value(rows, a);
    append_value(rows, std::uint8_t{3});
    for (const std::uint16_t v : std::initializer_list<std::uint16_t>{255, 7, 0})
      append_value(rows, v);
    append_value(rows, std::int64_t{-3});
  }
  write_points(scratch / "a.xyz", OutputFormat::xyz, info, surfels, rows);
  CHECK_THAT(slurp(scratch / "a.xyz"), Equals("# x y z a b rgb_r rgb_g rgb_b wide\n"
                                              "10 20.5 0 66.6 0.375 255 7 0 -1.5\n"
                                              "11 19.5 0.25 nan 0.375 255 7 0 -1.5\n"));
  CHECK(losses(OutputFormat::xyz, info) ==
        std::vector<std::string>{
            "Values of the channel wide, which has a scale, are rounded to 15 digits."});
}
