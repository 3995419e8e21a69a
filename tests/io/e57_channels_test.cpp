// Channels of E57 files: names, types and values of the fields beyond the surfel.
#include <bit>
#include <cmath>
#include <limits>
#include <map>

#include <catch2/catch.hpp>

#include "tests/io/e57_file.h"
#include "tests/io/files.h"

using namespace ptc;
using test::Cloud;
using test::e57_bits;
using test::e57_field;
using test::e57_packet;
using test::E57File;
using test::read_e57;

namespace {

template <typename T>
std::string numbers(const std::vector<T>& values) {
  std::string bytes;
  for (const T value : values) bytes += raw(value);
  return bytes;
}

const std::string kXyz = test::e57_xyz();

}  // namespace

TEST_CASE("e57: integers of every width have the smallest type that holds their range",
          "[io][e57]") {
  using Type = ChannelType;
  struct Case {
    std::int64_t low, high;
    Type type;
  };
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  const std::vector<Case> cases = {
      {0, 1, Type::u8},           {0, 255, Type::u8},          {7, 7, Type::u8},
      {-1, 0, Type::i8},          {-128, 127, Type::i8},       {-1, 128, Type::i16},
      {0, 256, Type::u16},        {65535, 65535, Type::u16},   {-129, 0, Type::i16},
      {-32768, 32767, Type::i16}, {0, 65536, Type::u32},       {-32769, 5, Type::i32},
      {0, 4294967295, Type::u32}, {-1, 2147483648, Type::i64}, {0, 4294967296, Type::u64},
      {0, kMost, Type::u64},      {kLeast, kMost, Type::i64},  {kLeast, kLeast, Type::i64},
      {-5, 1000000007, Type::i32}};
  for (const Case& c : cases) {
    INFO(c.low << " to " << c.high);
    const auto span = static_cast<std::uint64_t>(c.high) - static_cast<std::uint64_t>(c.low);
    const auto width = static_cast<unsigned>(std::bit_width(span));
    const std::vector<std::uint64_t> stored = {0, span, span / 2, span, 0, span / 3};
    const Cloud cloud =
        test::read_e57_scan(e57_field("x:Odd", "Integer minimum=\"" + std::to_string(c.low) +
                                                   "\" maximum=\"" + std::to_string(c.high) + "\""),
                            stored.size(), {e57_bits(stored, width)});
    REQUIRE(cloud.info.channels.size() == 1);
    CHECK(cloud.info.channels[0].type == c.type);
    CHECK_FALSE(cloud.info.channels[0].no_value);
    const std::size_t bytes = channel_bytes(c.type);
    REQUIRE(cloud.rows.size() == stored.size() * bytes);
    for (std::size_t i = 0; i < stored.size(); ++i) {
      const std::uint64_t whole = stored[i] + static_cast<std::uint64_t>(c.low);
      CHECK(cloud.bits(i, cloud.info.channels[0].name) ==
            whole << (64 - 8 * bytes) >> (64 - 8 * bytes));
    }
  }
}

TEST_CASE("e57: an integer without limits has 64 bits", "[io][e57]") {
  const Cloud cloud = test::read_e57_scan(e57_field("a", "Integer"), 2,
                                          {numbers<std::uint64_t>({std::uint64_t{1} << 63, 0})});
  CHECK(cloud.channel("a").type == ChannelType::i64);
  CHECK(cloud.value<std::int64_t>(0, "a") == 0);
  CHECK(cloud.value<std::int64_t>(1, "a") == std::numeric_limits<std::int64_t>::min());
}

TEST_CASE("e57: spherical coordinates beside Cartesian ones are channels", "[io][e57]") {
  const Cloud cloud = test::read_e57_scan(
      test::e57_fields({"sphericalAzimuth", "sphericalElevation", "sphericalRange"}, "Float"), 1,
      {raw(1.5), raw(0.25), raw(8.0)});
  CHECK(cloud.surfels[0].position == glm::dvec3(0, 10, 20));
  CHECK(cloud.value<double>(0, "spherical_azimuth") == 1.5);
  CHECK(cloud.value<double>(0, "spherical_elevation") == 0.25);
  CHECK(cloud.value<double>(0, "spherical_range") == 8);
}

TEST_CASE("e57: a channel is not known where a scan lacks its field", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string byte = "Integer minimum=\"0\" maximum=\"255\"";
  E57File file;
  file.scan(kXyz + e57_field("a", byte), 1, test::e57_xyz_packet(1, {"\x07"}));
  file.scan(e57_field("q", "Float"), 0, "");  // without records; its fields do not count
  file.scan(e57_field("b", "Integer minimum=\"-1\" maximum=\"0\"") + kXyz, 1, [] {
    std::vector<std::string> streams = test::e57_xyz_streams(1);
    streams.insert(streams.begin(), std::string(1, '\0'));
    return e57_packet(streams);
  }());
  const Cloud cloud = read_e57(scratch.file("a.e57", file.bytes()));
  CHECK(cloud.info.channels.size() == 3);
  CHECK(cloud.channel("a").type == ChannelType::u16);
  CHECK(cloud.channel("a").no_value == 0xffffU);
  CHECK(cloud.value<std::uint16_t>(0, "a") == 7);
  CHECK(cloud.value<std::uint16_t>(1, "a") == 0xffff);
  CHECK(cloud.channel("b").type == ChannelType::i8);
  CHECK(cloud.channel("b").no_value == 0x80U);
  CHECK(cloud.value<std::uint8_t>(0, "b") == 0x80);
  CHECK(cloud.value<std::int8_t>(1, "b") == -1);
  CHECK(cloud.value<std::uint16_t>(0, "scan") == 0);
  CHECK(cloud.value<std::uint16_t>(1, "scan") == 2);
  REQUIRE(cloud.info.notes.size() == 2);
  CHECK(cloud.info.notes[0] == "Channel a is not known where a scan has no a.");
}

TEST_CASE("e57: a channel holds the values of a field in every scan", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string byte = "Integer minimum=\"0\" maximum=\"255\"";
  const auto scaled = [](const char* low, const char* high, const char* scale) {
    return std::string("ScaledInteger minimum=\"") + low + "\" maximum=\"" + high + "\" scale=\"" +
           scale + "\"";
  };
  E57File file;
  file.scan(kXyz + e57_field("mixed", "Float precision=\"single\"") + e57_field("wider", byte) +
                e57_field("same", scaled("0", "9", "0.5")) +
                e57_field("other", scaled("0", "9", "2")) +
                e57_field("single", "Float precision=\"single\""),
            1, test::e57_xyz_packet(1, {raw(0.25F), "\xff", "\x03", "\x09", raw(1.5F)}));
  file.scan(kXyz + e57_field("mixed", byte) +
                e57_field("wider", "Integer minimum=\"-1\" maximum=\"-1\"") +
                e57_field("same", scaled("-200", "55", "0.5")) +
                e57_field("other", scaled("0", "9", "3")),
            1, test::e57_xyz_packet(1, {"\xc8", "", std::string(1, '\0'), "\x09"}));
  const Cloud cloud = read_e57(scratch.file("a.e57", file.bytes()));
  REQUIRE(cloud.surfels.size() == 2);
  CHECK(cloud.channel("mixed").type == ChannelType::f64);
  CHECK(cloud.value<double>(0, "mixed") == 0.25);
  CHECK(cloud.value<double>(1, "mixed") == 200);
  CHECK(cloud.channel("wider").type == ChannelType::i16);
  CHECK(cloud.value<std::int16_t>(0, "wider") == 255);
  CHECK(cloud.value<std::int16_t>(1, "wider") == -1);
  CHECK(cloud.channel("same").type == ChannelType::i16);
  CHECK(cloud.channel("same").scale == 0.5);
  CHECK(cloud.value<std::int16_t>(0, "same") == 3);
  CHECK(cloud.value<std::int16_t>(1, "same") == -200);
  CHECK(cloud.channel("other").type == ChannelType::f64);
  CHECK(cloud.value<double>(0, "other") == 18);
  CHECK(cloud.value<double>(1, "other") == 27);
  CHECK(cloud.channel("single").type == ChannelType::f32);
  CHECK(cloud.value<float>(0, "single") == 1.5F);
  CHECK(std::isnan(cloud.value<float>(1, "single")));
  CHECK(cloud.bits(1, "single") == cloud.channel("single").no_value);
  CHECK_FALSE(cloud.channel("mixed").no_value);
}

TEST_CASE("e57: what the file calls invalid is not known in the channel", "[io][e57]") {
  const std::string flag = "Integer minimum=\"0\" maximum=\"1\"";
  const Cloud cloud =
      test::read_e57_scan(e57_field("intensity", "Integer minimum=\"0\" maximum=\"255\"") +
                              e57_field("isIntensityInvalid", flag) +
                              e57_field("timeStamp", "Float precision=\"single\"") +
                              e57_field("isTimeStampInvalid", flag),
                          3,
                          {"\x01\xff\x03", e57_bits({1, 0, 0}, 1),
                           numbers<float>({0.5F, 1.5F, 2.5F}), e57_bits({0, 1, 0}, 1)});
  CHECK(cloud.info.channels.size() == 2);
  CHECK(cloud.channel("intensity").type == ChannelType::u16);
  CHECK(cloud.value<std::uint16_t>(0, "intensity") == 0xffff);
  CHECK(cloud.channel("intensity").no_value == 0xffffU);
  CHECK(cloud.value<std::uint16_t>(1, "intensity") == 255);
  CHECK(cloud.value<std::uint16_t>(2, "intensity") == 3);
  CHECK(cloud.channel("time_stamp").type == ChannelType::f64);
  CHECK(cloud.channel("time_stamp").role == ChannelRole::time);
  CHECK(cloud.channel("time_stamp").unit == "s");
  CHECK(cloud.value<double>(0, "time_stamp") == 0.5);
  CHECK(std::isnan(cloud.value<double>(1, "time_stamp")));
  CHECK(cloud.bits(1, "time_stamp") == cloud.channel("time_stamp").no_value);
}

TEST_CASE("e57: returns are counted from 1, rows and columns from 0", "[io][e57]") {
  const std::string small = "Integer minimum=\"0\" maximum=\"15\"";
  const Cloud cloud = test::read_e57_scan(
      test::e57_fields({"rowIndex", "columnIndex", "returnIndex", "returnCount"}, small), 2,
      {"\x21", "\x43", "\x10", "\x22"});
  CHECK(cloud.value<std::uint8_t>(1, "row") == 2);
  CHECK(cloud.value<std::uint8_t>(0, "column") == 3);
  CHECK(cloud.value<std::uint8_t>(1, "return_number") == 1);
  CHECK(cloud.channel("return_number").offset == 1);
  CHECK(cloud.channel("row").offset == 0);
  CHECK(cloud.value<std::uint8_t>(0, "number_of_returns") == 2);
  for (const Channel& channel : cloud.info.channels) CHECK(channel.role == ChannelRole::label);
}

TEST_CASE("e57: fields may have names that channels have already", "[io][e57]") {
  const Cloud cloud = test::read_e57_scan(test::e57_fields({"rowIndex", "row", "x:row", "Row"},
                                                           "Integer minimum=\"0\" maximum=\"255\""),
                                          1, {"\x01", "\x02", "\x03", "\x04"});
  REQUIRE(cloud.info.channels.size() == 4);
  std::map<std::string, std::uint64_t> values;
  for (const Channel& channel : cloud.info.channels) {
    values[channel.name] = cloud.bits(0, channel.name);
  }
  CHECK(values.size() == 4);
  CHECK(values.at("row") == 1);
}
