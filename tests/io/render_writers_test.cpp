// The formats of programs that render or process points: PCD, ptc and bgeo, byte by byte.
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/point_survey.h"
#include "engine/io/cloud/points.h"
#include "tests/io/files.h"
#include "tests/io/writer_inputs.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

namespace {

std::string behind(const std::string& bytes, const std::string& end) {
  return bytes.substr(bytes.find(end) + end.size());
}

}  // namespace

TEST_CASE("pcd writer: the header names all fields with bytes and kinds", "[io][writers][pcd]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = full_info(surfels);
  info.channels = {{.name = "class", .type = ChannelType::u8},
                   {.name = "number", .type = ChannelType::i64},
                   {.name = "sky", .type = ChannelType::half, .components = 3}};
  std::vector<std::byte> rows;
  for (int i = 0; i < 2; ++i) {
    append_value(rows, static_cast<std::uint8_t>(40 + i));
    append_value(rows, std::int64_t{-7} - i);
    for (const std::uint16_t half : std::initializer_list<std::uint16_t>{0x3c00, 0x4000, 0x0000})
      append_value(rows, half);
  }
  write_points(scratch / "a.pcd", OutputFormat::pcd, info, surfels, rows);
  const std::string bytes = slurp(scratch / "a.pcd");
  const std::string header =
      "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
      "FIELDS x y z normal_x normal_y normal_z rgb radius radiance_r radiance_g radiance_b "
      "albedo_r albedo_g albedo_b emission_r emission_g emission_b class number sky_r sky_g sky_b\n"
      "SIZE 4 4 4 4 4 4 4 4 4 4 4 4 4 4 4 4 4 1 8 4 4 4\n"
      "TYPE F F F F F F F F F F F F F F F F F U F F F F\n"
      "COUNT 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1\n"
      "WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA binary\n";
  REQUIRE_THAT(bytes, StartsWith(header));
  const std::string second = behind(bytes, header).substr(17 * 4 + 1 + 8 + 12);
  // sRGB of 0.25 is 0.537099, of 255 the 137th; the last byte of a colour is blue
  CHECK(second == raw(11.0F) + raw(19.5F) + raw(0.25F) + raw(0.6F) + raw(-0.8F) + raw(0.0F) +
                      raw(0x0089ff00U) + raw(1.5F) + raw(1.0F) + raw(2.0F) + raw(0.125F) +
                      raw(0.25F) + raw(1.0F) + raw(0.0F) + raw(0.0F) + raw(1.0F) + raw(3.0F) +
                      raw(std::uint8_t{41}) + raw(-8.0) + raw(1.0F) + raw(2.0F) + raw(0.0F));
}

TEST_CASE("pcd writer: the viewpoint of a PCD is written again, and a damaged one is not",
          "[io][writers][pcd]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = plain_info(surfels);
  const auto viewpoint = [&](const char* text) {
    info.text["pcd.viewpoint"] = text;
    write_points(scratch / "a.pcd", OutputFormat::pcd, info, surfels);
    const std::string bytes = slurp(scratch / "a.pcd");
    const std::size_t at = bytes.find("VIEWPOINT ") + 10;
    return bytes.substr(at, bytes.find('\n', at) - at);
  };
  CHECK(viewpoint("1.5 -2 1e+30 0.1 0 1 0") == "1.5 -2 1e+30 0.1 0 1 0");
  const PointFile file = open_points(scratch / "a.pcd");
  CHECK(file.info.text.at("pcd.viewpoint") == "1.5 -2 1e+30 0.1 0 1 0");
  CHECK(file.info.scanners == std::vector{glm::dvec3(1.5, -2, 1e30)});
  for (const char* bad : {"", "1 2 3 4 5 6", "1 2 3 nan 5 6 7", "1 2 3 4 5 6 x"})
    CHECK(viewpoint(bad) == "0 0 0 1 0 0 0");
}

TEST_CASE("pcd writer: points that lie in a grid row by row are organised, no others",
          "[io][writers][pcd]") {
  const test::TemporaryDirectory scratch;
  using Cells = std::vector<std::array<std::uint32_t, 2>>;  // row and column of each point
  const auto lines = [&](const Cells& cells) {
    const std::vector<Surfel> surfels = surfels_of(static_cast<int>(cells.size()));
    PointWriteInfo info = plain_info(surfels);
    info.channels = {{.name = "row", .type = ChannelType::u32},
                     {.name = "id", .type = ChannelType::u8},
                     {.name = "column", .type = ChannelType::u32}};
    std::vector<std::byte> rows;
    for (const auto& [row, column] : cells) {
      append_value(rows, row);
      append_value(rows, std::uint8_t{7});
      append_value(rows, column);
    }
    PointSurvey survey(OutputFormat::pcd, info.channels);
    CHECK_FALSE(survey.empty());
    survey.add(std::span(rows).first(9));
    survey.add(std::span(rows).subspan(9));
    survey.finish(info);
    write_points(scratch / "a.pcd", OutputFormat::pcd, info, surfels, rows);
    const std::string bytes = slurp(scratch / "a.pcd");
    const auto line = [&](const char* word) {
      const std::size_t at = bytes.find(word);
      return bytes.substr(at, bytes.find('\n', at) - at) + "; ";
    };
    return line("FIELDS") + line("WIDTH") + line("HEIGHT");
  };
  const Cells whole{{0, 0}, {0, 1}, {0, 2}, {1, 0}, {1, 1}, {1, 2}};
  CHECK(lines(whole) == "FIELDS x y z id; WIDTH 3; HEIGHT 2; ");
  CHECK(lines({{0, 0}, {1, 0}}) == "FIELDS x y z id; WIDTH 1; HEIGHT 2; ");
  const auto is_plain = [&](const Cells& cells) {
    CHECK(lines(cells) ==
          "FIELDS x y z row id column; WIDTH " + std::to_string(cells.size()) + "; HEIGHT 1; ");
  };
  for (std::size_t hole = 0; hole < whole.size(); ++hole) {
    Cells some = whole;
    some.erase(some.begin() + static_cast<std::ptrdiff_t>(hole));
    is_plain(some);
    Cells swapped = whole;
    std::swap(swapped[hole], swapped[(hole + 1) % whole.size()]);
    is_plain(swapped);
  }
  is_plain({{0, 0}, {0, 1}, {0, 2}});                    // no row but the first
  is_plain({{0, 0}, {1, 0}, {0, 1}, {1, 1}});            // column by column
  is_plain({{0, 0}, {0, 1}, {0, 2}, {1, 0}, {1, 1}});    // the last row is short
  is_plain({{4'000'000'000U, 4'000'000'000U}, {0, 1}});  // anything
}

TEST_CASE("pcd writer: a row of -1 is none of a grid", "[io][writers][pcd]") {
  GridCheck check;
  check.add(0, ~std::uint64_t{0}, 0);
  check.add(1, 0, 1);
  check.add(2, 1, 0);
  check.add(3, 1, 1);
  CHECK_FALSE(check.grid());
}

TEST_CASE("pcd writer: positions are floats near the origin and doubles in a national grid",
          "[io][writers][pcd]") {
  const test::TemporaryDirectory scratch;
  std::vector<Surfel> surfels = surfels_of(2);
  write_points(scratch / "a.pcd", OutputFormat::pcd, plain_info(surfels), surfels);
  CHECK_THAT(slurp(scratch / "a.pcd"), Contains("\nSIZE 4 4 4\n"));
  CHECK_THAT(losses(OutputFormat::pcd, plain_info(surfels)).at(0), Contains("rounded to float"));
  for (Surfel& surfel : surfels) surfel.position.x += 637'000.015'625;
  write_points(scratch / "b.pcd", OutputFormat::pcd, plain_info(surfels), surfels);
  const std::string bytes = slurp(scratch / "b.pcd");
  CHECK_THAT(bytes, Contains("\nSIZE 8 8 8\n"));
  CHECK(behind(bytes, "DATA binary\n") ==
        raw(637'010.015'625) + raw(20.5) + raw(0.0) + raw(637'011.015'625) + raw(19.5) + raw(0.25));
  CHECK_THAT(losses(OutputFormat::pcd, plain_info(surfels)).at(0),
             StartsWith("Positions are doubles, since floats would move points by up to 0.031 "));
}

TEST_CASE("pcd writer: a colour of 8 bits is one field, one of 16 bits keeps its own too",
          "[io][writers][pcd]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {stored_colour(ChannelType::u8)};
  std::vector<std::byte> rows;
  for (const std::uint8_t v : std::initializer_list<std::uint8_t>{1, 128, 255})
    append_value(rows, v);
  write_points(scratch / "a.pcd", OutputFormat::pcd, info, surfels, rows);
  CHECK_THAT(slurp(scratch / "a.pcd"), Contains("\nFIELDS x y z rgb\n"));
  CHECK(number_at<std::uint32_t>(behind(slurp(scratch / "a.pcd"), "binary\n"), 24) == 0x0180ff);

  info.channels = {stored_colour(ChannelType::u16)};
  std::vector<std::byte> wide;
  for (const std::uint16_t v : std::initializer_list<std::uint16_t>{0, 257, 65535})
    append_value(wide, v);
  write_points(scratch / "b.pcd", OutputFormat::pcd, info, surfels, wide);
  const std::string bytes = slurp(scratch / "b.pcd");
  CHECK_THAT(bytes, Contains("\nFIELDS x y z rgb rgb_r rgb_g rgb_b\nSIZE 8 8 8 4 2 2 2\n"));
  CHECK(behind(bytes, "binary\n").substr(24) == raw(0x0001ffU) + raw(std::uint16_t{0}) +
                                                    raw(std::uint16_t{257}) +
                                                    raw(std::uint16_t{65535}));
  // A channel that would repeat the field of the colour gets another name
  PointWriteInfo other = plain_info(surfels);
  other.has_albedo = true;
  other.channels = {{.name = "rgb", .type = ChannelType::u8}};
  write_points(scratch / "d.pcd", OutputFormat::pcd, other, surfels, std::vector<std::byte>(1));
  CHECK_THAT(slurp(scratch / "d.pcd"), Contains("rgb albedo_r albedo_g albedo_b rgb_\n"));
  // The albedo knows that the fields of 16 bits hold bytes
  info.has_albedo = true;
  write_points(scratch / "c.pcd", OutputFormat::pcd, info, surfels, wide);
  CHECK(number_at<std::uint32_t>(behind(slurp(scratch / "c.pcd"), "binary\n"), 24) == 0x89ff00);
}

TEST_CASE("pcd writer: occlusion is shown as a grey, light is compressed below white",
          "[io][writers][pcd]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.has_albedo = true;
  info.channels = {{.name = "occlusion", .type = ChannelType::f32},
                   {.name = "light", .type = ChannelType::f32, .components = 3}};
  const auto shown = [&](const char* from, float occlusion, float light) {
    std::vector<std::byte> rows;
    for (const float v : {occlusion, light, light, light}) append_value(rows, v);
    info.colour_from = from;
    write_points(scratch / "a.pcd", OutputFormat::pcd, info, surfels, rows);
    return number_at<std::uint32_t>(behind(slurp(scratch / "a.pcd"), "binary\n"), 24);
  };
  CHECK(shown("occlusion", 0, 0) == 0xffffff);
  CHECK(shown("occlusion", 1, 0) == 0x000000);
  CHECK(shown("occlusion", 0.75F, 0) == 0x898989);  // sRGB of 1/4
  CHECK(shown("occlusion", -3, 0) == 0xffffff);
  CHECK(shown("occlusion", std::nanf(""), 0) == 0x000000);
  CHECK(shown("light", 0, 0) == 0x000000);
  CHECK(shown("light", 0, 1.0F / 3) == 0x898989);  // 1/3 over 4/3
  CHECK(shown("light", 0, 1e30F) == 0xffffff);
  CHECK(shown("light", 0, -1) == 0x000000);
  CHECK_THAT(slurp(scratch / "a.pcd"), Contains("rgb albedo_r albedo_g albedo_b occlusion"));
}

TEST_CASE("ptc writer: the header and the points lie where the format has them",
          "[io][writers][ptc]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = full_info(surfels);
  info.channels = {{.name = "segment", .type = ChannelType::u8},
                   {.name = "flow", .type = ChannelType::f32, .components = 2},
                   {.name = "bent", .components = 3, .role = ChannelRole::direction},
                   {.name = "up", .components = 3, .role = ChannelRole::vector},
                   {.name = "sky", .components = 3, .role = ChannelRole::colour}};
  std::vector<std::byte> rows;
  for (int i = 0; i < 2; ++i) {
    append_value(rows, static_cast<std::uint8_t>(7 + i));
    append_value(rows, 1.5F);
    append_value(rows, -2.5F);
    for (int k = 0; k < 9; ++k) append_value(rows, static_cast<std::uint16_t>(0x3c00 + k));
  }
  write_points(scratch / "a.ptc", OutputFormat::ptc, info, surfels, rows);
  const std::string bytes = slurp(scratch / "a.ptc");
  const std::string identity = [] {
    std::string text;
    for (int i = 0; i < 16; ++i) text += raw(i % 5 == 0 ? 1.0F : 0.0F);
    return text;
  }();
  const std::string header =
      "pptc" + raw(0U) + raw(2.0) + raw(10.0F) + raw(19.5F) + raw(0.0F) + raw(11.0F) + raw(20.5F) +
      raw(0.25F) + identity + identity + raw(640.0F) + raw(480.0F) + raw(1.0F) + raw(10U) +
      raw(22U) +
      "float _area\ncolor _radiosity\ncolor _albedo\ncolor _emission\nfloat segment\n"
      "float flow_0\nfloat flow_1\nnormal bent\nvector up\ncolor sky\n";
  REQUIRE(bytes.substr(0, header.size()) == header);
  // The normal (0.6, -0.8, 0): atan2(0.6, -0.8) is 2.498092 or 0.397584 turns, z is in the middle
  std::string second = raw(11.0F) + raw(19.5F) + raw(0.25F) + raw(std::uint16_t{58823}) +
                       raw(std::uint16_t{32768}) + raw(1.5F) + raw(4.5F) + raw(1.0F) + raw(3.0F) +
                       raw(3.125F) + raw(0.25F) + raw(1.0F) + raw(0.0F) + raw(0.0F) + raw(1.0F) +
                       raw(3.0F) + raw(8.0F) + raw(1.5F) + raw(-2.5F);
  for (int k = 0; k < 9; ++k) second += raw(1.0F + static_cast<float>(k) * 0x1p-10F);
  CHECK(bytes.substr(header.size() + second.size()) == second);
}

TEST_CASE("ptc writer: what is reflected, emitted and coloured comes back apart",
          "[io][writers][ptc]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(3);
  PointWriteInfo info = full_info(surfels);
  write_points(scratch / "a.ptc", OutputFormat::ptc, info, surfels);
  const PointFile file = open_points(scratch / "a.ptc");
  CHECK(file.info.has_albedo);
  CHECK(file.info.has_emission);
  std::vector<Surfel> back(4);
  REQUIRE(file.source->next(back) == 3);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    CHECK(back[i].radiance == surfels[i].radiance);
    CHECK(back[i].albedo == surfels[i].albedo);
    CHECK(back[i].emission == surfels[i].emission);
  }
  // An area that the points had in a PTC stays
  info.channels = {{.name = "_area", .type = ChannelType::f32}};
  std::vector<std::byte> rows;
  for (const float area : {3.0F, 4.0F, 5.0F}) append_value(rows, area);
  write_points(scratch / "b.ptc", OutputFormat::ptc, info, surfels, rows);
  const PointFile again = open_points(scratch / "b.ptc");
  REQUIRE(again.info.channels.size() == 1);
  CHECK(again.info.channels[0].name == "_area");
  REQUIRE(again.source->next(back) == 3);
  CHECK(std::ranges::equal(again.source->attributes(), rows));
}

TEST_CASE("ptc writer: normals read back within the steps of their angles", "[io][writers][ptc]") {
  const test::TemporaryDirectory scratch;
  std::vector<Surfel> surfels;
  for (int i = 0; i <= 40; ++i) {
    for (int k = 0; k <= 20; ++k) {
      const double turn = std::numbers::pi * (i - 20) / 20, z = -1 + 0.1 * k;
      const double ring = std::sqrt(std::max(0.0, 1 - z * z));
      surfels.push_back({.normal = {ring * std::sin(turn), ring * std::cos(turn), z}});
    }
  }
  surfels.push_back({});  // a point without a normal
  PointWriteInfo info = plain_info(surfels);
  info.has_normals = true;
  write_points(scratch / "a.ptc", OutputFormat::ptc, info, surfels);
  const std::string bytes = slurp(scratch / "a.ptc");
  const std::size_t begin = bytes.size() - 20 * surfels.size();
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const auto phi = number_at<std::uint16_t>(bytes, begin + 20 * i + 12);
    const auto height = number_at<std::uint16_t>(bytes, begin + 20 * i + 14);
    const bool missing = phi == 65535 && height == 65535;
    CHECK(missing == (i + 1 == surfels.size()));
    if (missing) continue;
    const double turn = 2 * std::numbers::pi * (phi / 65535.0 - 0.5), z = height / 32767.5 - 1;
    const double ring = std::sqrt(std::max(0.0, 1 - z * z));
    const glm::dvec3 n(surfels[i].normal);
    CHECK(std::abs(n.z - z) < 2e-5);
    // Near the poles a step of z is a wide ring
    CHECK(std::abs(n.x - ring * std::sin(turn)) < 6e-3);
    CHECK(std::abs(n.y - ring * std::cos(turn)) < 6e-3);
  }
}

TEST_CASE("bgeo writer: the header and the points are those of version 5, big-endian",
          "[io][writers][bgeo]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = full_info(surfels);
  info.channels = {{.name = "id", .type = ChannelType::u32},
                   {.name = "wind", .components = 3, .role = ChannelRole::vector},
                   {.name = "pair", .type = ChannelType::i8, .components = 2}};
  std::vector<std::byte> rows;
  for (const std::uint32_t id : std::initializer_list<std::uint32_t>{5U, 0xffffffffU}) {
    append_value(rows, id);
    for (const std::uint16_t half : std::initializer_list<std::uint16_t>{0x3c00, 0xc000, 0x0000})
      append_value(rows, half);
    append_value(rows, std::int8_t{-1});
    append_value(rows, std::int8_t{100});
  }
  write_points(scratch / "a.bgeo", OutputFormat::bgeo, info, surfels, rows);
  const std::string bytes = slurp(scratch / "a.bgeo");
  REQUIRE(bytes.substr(0, 5) == "BgeoV");
  std::size_t at = 5;
  for (const std::uint32_t v : std::initializer_list<std::uint32_t>{5, 2, 0, 0, 0, 8, 0, 0, 0}) {
    CHECK(big_at<std::uint32_t>(bytes, at) == v);
    at += 4;
  }
  struct Attribute {
    std::string name;
    std::uint16_t numbers;
    std::uint32_t kind;
  };
  for (const Attribute& a : std::vector<Attribute>{{"N", 3, 5},
                                                   {"Cd", 3, 0},
                                                   {"pscale", 1, 0},
                                                   {"radiance", 3, 0},
                                                   {"emission", 3, 0},
                                                   {"id", 1, 1},
                                                   {"wind", 3, 5},
                                                   {"pair", 2, 1}}) {
    INFO(a.name);
    REQUIRE(big_at<std::uint16_t>(bytes, at) == a.name.size());
    CHECK(bytes.substr(at + 2, a.name.size()) == a.name);
    at += 2 + a.name.size();
    CHECK(big_at<std::uint16_t>(bytes, at) == a.numbers);
    CHECK(big_at<std::uint32_t>(bytes, at + 2) == a.kind);
    at += 6;
    CHECK(bytes.substr(at, 4 * a.numbers) == std::string(4 * a.numbers, '\0'));
    at += 4 * a.numbers;
  }
  const std::vector<float> second = {11, 19.5F, 0.25F, 1, 0.6F,   -0.8F, 0, 0.25F, 1,
                                     0,  1.5F,  1,     2, 0.125F, 0,     1, 3};
  at += 4 * (second.size() + 6);
  for (const float v : second) {
    CHECK(big_at<float>(bytes, at) == v);
    at += 4;
  }
  CHECK(big_at<std::int32_t>(bytes, at) == 2'147'483'647);  // cut
  CHECK(big_at<float>(bytes, at + 4) == 1);
  CHECK(big_at<float>(bytes, at + 8) == -2);
  CHECK(big_at<float>(bytes, at + 12) == 0);
  CHECK(big_at<std::int32_t>(bytes, at + 16) == -1);
  CHECK(big_at<std::int32_t>(bytes, at + 20) == 100);
  CHECK(bytes.substr(at + 24) == std::string("\0\xff", 2));
}

TEST_CASE("bgeo writer: a colour that is not known gives way to the albedo",
          "[io][writers][bgeo]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = plain_info(surfels);
  info.has_albedo = true;
  info.channels = {{.name = "rgb",
                    .type = ChannelType::f32,
                    .components = 3,
                    .role = ChannelRole::colour,
                    .colour_space = ColourSpace::rec709,
                    .no_value = 0x7fc00000}};
  std::vector<std::byte> rows;
  for (const float v : {0.5F, 0.125F, 1.0F}) append_value(rows, v);
  for (int i = 0; i < 3; ++i) append_value(rows, std::uint32_t{0x7fc00000});
  write_points(scratch / "a.bgeo", OutputFormat::bgeo, info, surfels, rows);
  std::vector<Surfel> back(3);
  REQUIRE(open_points(scratch / "a.bgeo").source->next(back) == 2);
  CHECK(back[0].albedo == glm::vec3(0.5F, 0.125F, 1));
  CHECK(back[1].albedo == surfels[1].albedo);
  CHECK(unknown_losses(OutputFormat::bgeo, info) ==
        std::vector<std::string>{"Points without a colour of their own get that of their albedo."});
}

TEST_CASE("bgeo writer: more points than its count can say are refused", "[io][writers][bgeo]") {
  const test::TemporaryDirectory scratch;
  const PointWriteInfo info{.count = std::uint64_t{1} << 31};
  CHECK_THROWS_AS(create_points(scratch / "a.bgeo", OutputFormat::bgeo, info), RequestError);
  CHECK(scratch.listing().empty());
  CHECK_NOTHROW(create_points(scratch / "a.bgeo", OutputFormat::bgeo, {.count = 0x7fffffff}));
  CHECK(scratch.listing().empty());
}
