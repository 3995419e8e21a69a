// Clouds from LAS.
#include <cmath>
#include <limits>
#include <map>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/las_crs.h"
#include "tests/io/files.h"
#include "tests/io/las_files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using test::las_fault;
using test::las_point;
using test::las_vlr;
using test::LasCloud;
using test::LasFile;
using test::read_las;

namespace {

std::string replaced(std::string bytes, std::size_t at, const std::string& by) {
  return bytes.replace(at, by.size(), by);
}

// Point i as its format has it, and the row that a reader returns.
struct MadePoint {
  std::string record;
  std::string row;
};

MadePoint make_point(unsigned format, int i) {
  const auto u8 = [](int value) { return raw(static_cast<std::uint8_t>(value)); };
  const auto u16 = [](int value) { return raw(static_cast<std::uint16_t>(value)); };
  // Choose the fields.
  const bool late = format >= 6;
  const int number = 1 + i % 3;
  const int count = 3;
  const int direction = i & 1;
  const int edge = i >> 1 & 1;
  const int classification = late ? 200 + i : 20 + i % 8;
  const int flags = late ? (i * 5) % 16 : i % 8;
  const int channel = i % 4;

  // Write those that share bytes apart, and the others as they are.
  MadePoint point;
  point.record = raw(1000 * i - 3) + raw(-7 * i) + raw(i) + u16(60000 + i);
  point.row = u16(60000 + i) + u8(number) + u8(count) + u8(direction) + u8(edge) +
              u8(classification) + u8(flags);
  std::string rest;
  if (late) {
    point.record += u8(number | count << 4) +
                    u8(flags | channel << 4 | direction << 6 | edge << 7) + u8(classification);
    point.row += u8(channel);
    rest = u8(77) + raw(static_cast<std::int16_t>(-3000 * i)) + u16(40000 + i);
  } else {
    point.record +=
        u8(number | count << 3 | direction << 6 | edge << 7) + u8(classification | flags << 5);
    rest = raw(static_cast<std::int8_t>(-9 * i)) + u8(77) + u16(40000 + i);
  }
  if (format != 0 && format != 2) rest += raw(1e9 / 3 + i);
  if (format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10)
    rest += u16(256 * i) + u16(65535) + u16(i);
  if (format == 8 || format == 10) rest += u16(12345 + i);
  if (format == 4 || format == 5 || format == 9 || format == 10) {
    rest += u8(3) + raw(std::uint64_t{1} << 40) + raw(std::uint32_t{256}) + raw(1.5F) + raw(0.25F) +
            raw(-0.5F) + raw(static_cast<float>(i));
  }
  point.record += rest;
  point.row += rest;
  return point;
}

constexpr std::array<unsigned, 11> kFormatBytes = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};

LasFile make_file(unsigned format, int points) {
  LasFile file;
  file.minor = format >= 6 ? 4 : format >= 4 ? 3 : 2;
  file.format = format;
  file.record_bytes = kFormatBytes[format];
  file.points = static_cast<std::uint64_t>(points);
  for (int i = 0; i < points; ++i) file.records += make_point(format, i).record;
  return file;
}

std::vector<std::string> channel_names(const PointFileInfo& info) {
  std::vector<std::string> names;
  for (const Channel& channel : info.channels) names.push_back(channel.name);
  return names;
}

}  // namespace

TEST_CASE("las: every field of every point format is a channel", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  for (unsigned format = 0; format <= 10; ++format) {
    INFO("format " << format);
    const LasCloud cloud = read_las(scratch, make_file(format, 20).bytes());
    REQUIRE(cloud.surfels.size() == 20);
    CHECK(cloud.info.count == 20);
    std::string rows;
    for (int i = 0; i < 20; ++i) {
      rows += make_point(format, i).row;
      const Surfel& s = cloud.surfels[static_cast<std::size_t>(i)];
      CHECK(s.position == glm::dvec3((1000.0 * i - 3) * 0.01, -7.0 * i * 0.01, i * 0.01));
      CHECK(s.normal == glm::vec3(0));
    }
    CHECK((cloud.rows == rows));
    std::size_t bytes = 0;
    for (const Channel& channel : cloud.info.channels)
      bytes += channel.component_bytes() * channel.components;
    CHECK(bytes * 20 == rows.size());
    CHECK_FALSE(cloud.info.has_normals);
    CHECK(cloud.info.text.at("up") == "z");
  }
}

TEST_CASE("las: the channels of formats 3 and 10 have these names, types, roles and units",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  const PointFileInfo old = read_las(scratch, make_file(3, 1).bytes()).info;
  CHECK(channel_names(old) == std::vector<std::string>{"intensity", "return_number",
                                                       "number_of_returns", "scan_direction",
                                                       "edge_of_flight_line", "classification",
                                                       "class_flags", "scan_angle", "user_data",
                                                       "point_source_id", "gps_time", "rgb"});
  const PointFileInfo late = read_las(scratch, make_file(10, 1).bytes()).info;
  CHECK(channel_names(late) ==
        std::vector<std::string>{"intensity", "return_number", "number_of_returns",
                                 "scan_direction", "edge_of_flight_line", "classification",
                                 "class_flags", "scanner_channel", "user_data", "scan_angle",
                                 "point_source_id", "gps_time", "rgb", "nir", "wave_descriptor",
                                 "wave_offset", "wave_bytes", "wave_return", "wave_direction"});
  CHECK(old.channels[5].role == ChannelRole::label);
  CHECK(old.channels[6].role == ChannelRole::label);
  CHECK(old.channels[7].type == ChannelType::i8);
  CHECK(old.channels[7].unit == "deg");
  CHECK(old.channels[10].role == ChannelRole::time);
  CHECK(old.channels[10].unit == "s");
  CHECK(old.channels[11].role == ChannelRole::colour);
  CHECK(old.channels[11].components == 3);
  CHECK(old.channels[11].colour_space == ColourSpace::srgb);
  CHECK(late.channels[9].type == ChannelType::i16);
  CHECK(late.channels[9].scale == 0.006);
  CHECK(late.channels[18].role == ChannelRole::vector);
  CHECK(late.notes.size() == 1);  // about waveforms
}

TEST_CASE("las: a position is the stored number times the scale plus the offset, in doubles",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file;
  file.points = 3;
  file.scale = {0.001, 1e-7, 0.3};
  file.offset = {4'321'000.125, -93.5, 0.1};
  constexpr std::array<std::int32_t, 3> kStored = {2147483647, -2147483647 - 1, 12345};
  for (const std::int32_t value : kStored) file.records += las_point(value, value, value);
  const LasCloud cloud = read_las(scratch, file.bytes());
  REQUIRE(cloud.surfels.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<std::size_t>(axis);
      volatile const double product = static_cast<double>(kStored[i]) * file.scale[k];
      CHECK(cloud.surfels[i].position[axis] == product + file.offset[k]);
    }
  }
}

TEST_CASE("las: versions 1.0 to 1.5 are read, others refused", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  for (unsigned minor = 0; minor <= 6; ++minor) {
    LasFile file = make_file(1, 5);
    file.minor = minor;
    const std::string text = las_fault(scratch, file.bytes());
    CHECK(text == (minor <= 5 ? "" : "offset 24: LAS version 1.6 is not supported"));
  }
  CHECK(las_fault(scratch, replaced(make_file(1, 5).bytes(), 24, "\2")) ==
        "offset 24: LAS version 2.2 is not supported");
}

TEST_CASE(
    "las: version 1.4 may count its points in the old field alone, but not in both fields "
    "differently",
    "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  const std::string late = make_file(6, 5).bytes();
  const std::string both = replaced(late, 107, raw(std::uint32_t{5}));
  CHECK(las_fault(scratch, both).empty());
  const std::string old = replaced(both, 247, raw(std::uint64_t{0}));
  CHECK(read_las(scratch, old).surfels.size() == 5);
  CHECK(las_fault(scratch, replaced(late, 107, raw(std::uint32_t{4}))) ==
        "offset 247: the header counts 5 points here and 4 in its old field");
}

TEST_CASE("las: a count of 0 is an empty cloud", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  for (const unsigned format : {0U, 2U, 10U}) {
    const LasCloud cloud = read_las(scratch, make_file(format, 0).bytes());
    CHECK(cloud.surfels.empty());
    CHECK(cloud.info.count == 0);
  }
}

TEST_CASE("las: every proper prefix of a file is refused", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file = make_file(7, 3);
  file.vlrs = {las_vlr("someone", 1, "payload")};
  file.evlrs = {las_vlr("someone", 2, "payload", true)};
  const std::string whole = file.bytes();
  CHECK(las_fault(scratch, whole).empty());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::string text = las_fault(scratch, whole.substr(0, size));
    CHECK_THAT(text, Catch::StartsWith("offset "));
  }
}

TEST_CASE("las: a file with fewer or more points than its header counts is refused",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = make_file(0, 3).bytes();
  const auto counting = [&](std::uint32_t count) { return replaced(whole, 107, raw(count)); };
  CHECK(las_fault(scratch, counting(4)) ==
        "offset 287: the header counts 4 points of 20 bytes, but only 3 lie before this place");
  CHECK(las_fault(scratch, counting(2)) ==
        "offset 267: the header counts 2 points, but 20 bytes follow them");
  CHECK(las_fault(scratch, counting(0)) ==
        "offset 227: the header counts 0 points, but 60 bytes follow them");
  CHECK(las_fault(scratch, whole + std::string(19, 'x')).empty());  // less than a point
  CHECK(las_fault(scratch, whole + std::string(20, 'x')) ==
        "offset 287: the header counts 3 points, but 20 bytes follow them");
  LasFile late = make_file(6, 3);
  late.evlrs = {las_vlr("someone", 2, "payload", true)};
  CHECK(las_fault(scratch, late.bytes()).empty());
  late.points = 4;
  CHECK_THAT(las_fault(scratch, late.bytes()), Contains("but only 3 lie before this place"));
  const std::string huge =
      replaced(make_file(6, 3).bytes(), 247, raw(std::numeric_limits<std::uint64_t>::max()));
  CHECK_THAT(las_fault(scratch, huge), Contains("the header counts 18446744073709551615 points"));
}

TEST_CASE("las: headers that break a rule are refused by offset", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file = make_file(0, 3);
  file.vlrs = {las_vlr("someone", 1, "payload")};
  const std::string whole = file.bytes();
  const auto changed = [&](std::size_t at, const std::string& by) {
    return las_fault(scratch, replaced(whole, at, by));
  };
  CHECK(changed(0, "lasf") == "offset 0: not a LAS file");
  CHECK(changed(94, raw(std::uint16_t{226})) ==
        "offset 94: the LAS header has 226 bytes, but version 1.2 has 227");
  CHECK(changed(96, raw(std::uint32_t{226})) == "offset 96: the points begin inside the header");
  CHECK(changed(96, raw(std::uint32_t{100'000})) == "offset 348: the file ends before its points");
  CHECK(changed(100, raw(std::uint32_t{2})) ==
        "offset 288: a record's header goes on past the points");
  CHECK(changed(247, raw(std::uint16_t{8})) == "offset 227: record 1 goes on past the points");
  CHECK(changed(104, "\x0b") == "offset 104: point format 11 is not supported");
  CHECK(changed(104, "\x40") == "offset 104: point format 64 is not supported");
  CHECK(changed(104, "\x80") ==
        "offset 104: the points are compressed, but there is no laszip record");
  CHECK(changed(105, raw(std::uint16_t{19})) ==
        "offset 105: point records have 19 bytes, but point format 0 needs 20");
  CHECK(changed(105, raw(std::uint16_t{2049})) ==
        "offset 105: point records of more than 2048 bytes are not supported");
  for (const double bad : {0.0, std::nan(""), HUGE_VAL})
    CHECK(changed(139, raw(bad)) == "offset 139: a scale of coordinates is 0 or not a number");
  CHECK(changed(171, raw(HUGE_VAL)) == "offset 171: an offset of coordinates is not a number");
  CHECK_THAT(changed(131, raw(1e308)), Contains("offset 288: point 0: the position is not finite"));

  LasFile late = make_file(6, 1);
  late.evlrs = {las_vlr("someone", 2, "payload", true)};
  const std::string extended = late.bytes();
  CHECK(las_fault(scratch, replaced(extended, 235, raw(std::uint64_t{100}))) ==
        "offset 235: the extended records begin before the points or after the end of the file");
  CHECK(las_fault(scratch, replaced(extended, 243, raw(std::uint32_t{2}))) ==
        "offset 472: a record's header goes on past the end of the file");
  CHECK(las_fault(scratch, replaced(extended, 405 + 20, raw(~std::uint64_t{0}))) ==
        "offset 405: record 2 goes on past the end of the file");
}

TEST_CASE("las: colours that are all at most 255 have 8 bits, others 16", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  const auto with_colours = [&](std::uint16_t red, std::uint16_t green) {
    LasFile file;
    file.format = 2;
    file.record_bytes = 26;
    file.points = 2;
    file.records = las_point(1, 2, 3) + raw(red) + raw(green) + raw(std::uint16_t{0}) +
                   las_point(1, 2, 3) + raw(std::uint16_t{0}) + raw(green) + raw(red);
    return read_las(scratch, file.bytes());
  };
  const auto bits = [](const LasCloud& cloud) {
    return nlohmann::json::parse(cloud.info.text.at("las.header"))["colour_bits"].get<int>();
  };
  const LasCloud narrow = with_colours(255, 128);
  CHECK(bits(narrow) == 8);
  CHECK(narrow.info.has_albedo);
  CHECK(narrow.surfels[0].albedo.x == 1);
  CHECK(static_cast<double>(narrow.surfels[0].albedo.y) == Approx(0.2158605));
  CHECK(narrow.surfels[0].albedo.z == 0);
  REQUIRE(narrow.info.notes.size() == 1);
  CHECK_THAT(narrow.info.notes[0], Contains("8 bits"));
  const LasCloud wide = with_colours(256, 65535);
  CHECK(bits(wide) == 16);
  CHECK(static_cast<double>(wide.surfels[0].albedo.x) == Approx(256.0 / 65535 / 12.92));
  CHECK(wide.surfels[0].albedo.y == 1);
  CHECK(wide.info.notes.empty());
  const LasCloud black = with_colours(0, 0);
  CHECK(bits(black) == 0);
  CHECK_FALSE(black.info.has_albedo);
  CHECK(black.surfels[0].albedo == glm::vec3(0.5F));
  CHECK(black.rows.substr(black.rows.size() - 6) == std::string(6, '\0'));
}

TEST_CASE("las: a colour that contradicts the sample of the points ends the reading",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  constexpr std::size_t kPoints = 200'000;
  LasFile file;
  file.format = 2;
  file.record_bytes = 26;
  file.points = kPoints;
  file.records.resize(kPoints * 26);
  // 17 places of 8192 points each are looked at, every 11764 points: point 10'000 is not.
  const std::size_t place = 10'000 * 26 + 20;
  const auto with_colour = [&](std::size_t at, std::uint16_t red) {
    LasFile changed = file;
    changed.records.replace(at, 2, raw(red));
    return changed;
  };
  CHECK_THAT(las_fault(scratch, with_colour(place, 1).bytes()),
             Contains("point 10000: the point has a colour, but all points that were looked at"));
  file.records[20] = 1;
  CHECK(las_fault(scratch, with_colour(place, 255).bytes()).empty());
  CHECK_THAT(las_fault(scratch, with_colour(place, 256).bytes()),
             Contains("offset 260227: point 10000: a colour is above 255"));
  CHECK(las_fault(scratch, with_colour(8191 * 26 + 20, 256).bytes()).empty());
  CHECK(las_fault(scratch, with_colour((kPoints - 11'764) * 26 + 20, 256).bytes()).empty());
}
