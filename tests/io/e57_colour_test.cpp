// Colours from E57: limits, types and the curve.
#include <cmath>

#include <catch2/catch.hpp>

#include "engine/io/cloud/points.h"
#include "tests/io/e57_file.h"
#include "tests/io/files.h"

using namespace ptc;
using test::Cloud;
using test::e57_bits;
using test::e57_field;
using test::e57_packet;
using test::E57File;

namespace {

std::string coloured(const std::string& type) {
  std::string xml;
  for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"}) {
    xml += e57_field(name, "Integer minimum=\"0\" maximum=\"0\"");  // takes no bits
  }
  for (const char* name : {"colorRed", "colorGreen", "colorBlue"}) xml += e57_field(name, type);
  return xml;
}

std::string limits(const std::string& low, const std::string& high) {
  std::string xml;
  for (const std::string name : {"Red", "Green", "Blue"}) {
    xml += "<color" + name + "Minimum type=\"Float\">" + low + "</color" + name + "Minimum><color" +
           name + "Maximum type=\"Float\">" + high + "</color" + name + "Maximum>";
  }
  return "<colorLimits type=\"Structure\">" + xml + "</colorLimits>";
}

std::string packet(const std::vector<std::string>& colours) {
  std::vector<std::string> streams(3);
  streams.insert(streams.end(), colours.begin(), colours.end());
  return e57_packet(streams);
}

// Reads records with three streams of colours.
Cloud read(const std::string& type, const std::string& more, std::size_t count,
           const std::vector<std::string>& colours, const std::string& elements = {}) {
  const test::TemporaryDirectory scratch;
  E57File file;
  file.scan(coloured(type) + more, count, packet(colours), elements);
  return test::read_e57(scratch.file("a.e57", file.bytes()));
}

// The linear value of a share of full colour, by the curve of IEC 61966-2-1.
float linear(double share) {
  return static_cast<float>(share <= 0.04045 ? share / 12.92
                                             : std::pow((share + 0.055) / 1.055, 2.4));
}

constexpr const char* kByte = "Integer minimum=\"0\" maximum=\"255\"";

}  // namespace

TEST_CASE("e57: colours of 8 bits are sRGB, with limits or without", "[io][e57]") {
  for (const std::string& elements : {std::string(), limits("0", "255"), limits("0", "0")}) {
    const Cloud cloud =
        read(kByte, "", 2, {std::string("\xff\0", 2), "\x80\x01", "\x05\x0a"}, elements);
    CHECK(cloud.info.has_albedo);
    REQUIRE(cloud.surfels.size() == 2);
    CHECK(cloud.surfels[0].albedo == glm::vec3(1, linear(128 / 255.0), linear(5 / 255.0)));
    CHECK(cloud.surfels[1].albedo == glm::vec3(0, linear(1 / 255.0), linear(10 / 255.0)));
    const Channel& rgb = cloud.channel("rgb");
    CHECK(rgb.type == ChannelType::u8);
    CHECK(rgb.components == 3);
    CHECK(rgb.role == ChannelRole::colour);
    CHECK(rgb.colour_space == ColourSpace::srgb);
    CHECK(rgb.scale == 1);
    CHECK(rgb.offset == 0);
    CHECK(cloud.value<std::uint8_t>(0, "rgb", 0) == 255);
    CHECK(cloud.value<std::uint8_t>(1, "rgb", 2) == 10);
  }
}

TEST_CASE("e57: a table of colours gives what the curve gives", "[io][e57]") {
  std::string bytes;
  std::vector<std::uint64_t> words;
  for (std::uint64_t i = 0; i < 1000; ++i) {
    bytes += static_cast<char>(i * 7);
    words.push_back(i * 65);
  }
  const Cloud eight = read(kByte, "", 1000, {bytes, bytes, bytes});
  const std::string packed = e57_bits(words, 16);
  const Cloud sixteen =
      read("Integer minimum=\"0\" maximum=\"65535\"", "", 1000, {packed, packed, packed});
  for (std::size_t i = 0; i < 1000; ++i) {
    CHECK(eight.surfels[i].albedo.x == linear(static_cast<double>(i * 7 % 256) / 255));
    CHECK(sixteen.surfels[i].albedo.y == linear(static_cast<double>(i * 65) / 65535));
  }
  CHECK(sixteen.channel("rgb").type == ChannelType::u16);
}

TEST_CASE("e57: stored colours are scaled by their limits", "[io][e57]") {
  // 8 bits of colour in 16-bit fields, as some programs write them.
  const Cloud wide =
      read("Integer minimum=\"0\" maximum=\"65535\"", "", 1,
           {raw(std::uint16_t{51}), raw(std::uint16_t{255}), raw(std::uint16_t{300})},
           limits("0", "255"));
  CHECK(wide.surfels[0].albedo == glm::vec3(linear(0.2), 1, 1));  // above the limit: as the limit
  CHECK(wide.channel("rgb").type == ChannelType::u16);
  CHECK(wide.channel("rgb").scale == kByteScale);
  CHECK(wide.value<std::uint16_t>(0, "rgb", 2) == 300);
  const Cloud ten =
      read("Integer minimum=\"0\" maximum=\"1023\"", "", 1,
           {raw(std::uint16_t{1023}), raw(std::uint16_t{0}), raw(std::uint16_t{341})});
  CHECK(ten.surfels[0].albedo == glm::vec3(1, 0, linear(341.0 / 1023)));
  CHECK(ten.channel("rgb").scale == 1.0 / 1023);
  const Cloud floats = read("Float precision=\"single\"", "", 1, {raw(0.5F), raw(NAN), raw(1.0F)});
  CHECK(floats.surfels[0].albedo == glm::vec3(0.5F));  // not a number: no colour
  CHECK(floats.channel("rgb").type == ChannelType::f32);
  const Cloud shifted = read("Float", "", 1, {raw(10.0), raw(20.0), raw(15.0)}, limits("10", "20"));
  CHECK(shifted.surfels[0].albedo == glm::vec3(0, 1, linear(0.5)));
  CHECK(shifted.channel("rgb").scale == Approx(0.1));
  CHECK(shifted.channel("rgb").offset == Approx(-1));
  const Cloud narrow = read(kByte, "", 1, {"\x7f", "\x40", "\xff"}, limits("0", "127"));
  CHECK(narrow.surfels[0].albedo == glm::vec3(1, linear(64.0 / 127), 1));
  CHECK(narrow.channel("rgb").scale == 1.0 / 127);  // white is 1, not 255
  CHECK(narrow.channel("rgb").role == ChannelRole::colour);
  const Cloud tiny = read("Float", "", 1, {raw(0.0), raw(0.0), raw(0.0)}, limits("0", "5e-324"));
  CHECK(tiny.channel("rgb").scale == 1);
  const Cloud huge = read("ScaledInteger minimum=\"0\" maximum=\"255\" scale=\"1e-300\"", "", 1,
                          {"\x01", "\x02", "\x03"}, limits("0", "1e308"));
  CHECK(huge.channel("rgb").scale == 1e-300);  // not 0, as a product of both would be
}

TEST_CASE("e57: a colour whose limits its channel cannot state is no colour there", "[io][e57]") {
  // White is 1, but without a scale it would be 255.
  const Cloud cloud = read(kByte, "", 1, {"\x01", std::string(1, '\0'), "\x01"}, limits("0", "1"));
  CHECK(cloud.surfels[0].albedo == glm::vec3(1, 0, 1));
  const Channel& rgb = cloud.channel("rgb");
  CHECK(rgb.type == ChannelType::u8);
  CHECK(rgb.scale == 1);
  CHECK(rgb.role == ChannelRole::value);
  CHECK(rgb.colour_space == ColourSpace::none);
  CHECK(cloud.value<std::uint8_t>(0, "rgb", 0) == 1);
  CHECK(cloud.info.notes ==
        std::vector<std::string>{"Channel rgb has the numbers of the file without their limits."});
}

TEST_CASE("e57: a point may have no colour", "[io][e57]") {
  const Cloud cloud =
      read(kByte, e57_field("isColorInvalid", "Integer minimum=\"0\" maximum=\"1\""), 2,
           {"\xff\xff", "\xff\xff", "\xff\xff", e57_bits({1, 0}, 1)});
  CHECK(cloud.surfels[0].albedo == glm::vec3(0.5F));
  CHECK(cloud.surfels[1].albedo == glm::vec3(1));
  CHECK(cloud.value<std::uint8_t>(0, "rgb") == 255);
  CHECK(cloud.value<std::uint8_t>(0, "is_color_invalid") == 1);
  CHECK(cloud.value<std::uint8_t>(1, "is_color_invalid") == 0);
}

TEST_CASE("e57: scans may have other colours or none", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  E57File file;
  const std::string plain = "Integer minimum=\"0\" maximum=\"65535\"";
  file.scan(coloured(kByte), 1, packet({"\xff", "\x33", std::string(1, '\0')}), limits("0", "255"));
  file.scan(coloured(plain), 1,
            packet({raw(std::uint16_t{65535}), raw(std::uint16_t{13107}), raw(std::uint16_t{0})}),
            limits("0", "65535"));
  const std::string bare = coloured(kByte);
  file.scan(bare.substr(0, bare.find("<colorRed")), 1, packet({}));
  const Cloud cloud = test::read_e57(scratch.file("a.e57", file.bytes()));
  REQUIRE(cloud.surfels.size() == 3);
  for (std::size_t i = 0; i < 2; ++i)
    CHECK(cloud.surfels[i].albedo == glm::vec3(1, linear(0.2), 0));
  CHECK(cloud.surfels[2].albedo == glm::vec3(0.5F));
  CHECK(cloud.channel("rgb").type == ChannelType::u16);
  CHECK(cloud.channel("rgb").scale == 1);
  CHECK(cloud.channel("rgb").role == ChannelRole::value);
  CHECK(cloud.value<std::uint16_t>(0, "rgb", 1) == 51);
  CHECK(cloud.value<std::uint16_t>(1, "rgb", 1) == 13107);
  CHECK(cloud.value<std::uint16_t>(2, "rgb", 1) == 0);
  const std::vector<std::string> notes = {
      "Channel rgb has the numbers of the file without their limits.",
      "Channel rgb is 0 where a scan has no colours."};
  CHECK(cloud.info.notes == notes);
}
