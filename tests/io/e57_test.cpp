// Clouds from E57: what is in a file comes out of the reader.
#include <bit>
#include <cmath>
#include <limits>
#include <map>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "tests/io/e57_file.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using test::Cloud;
using test::e57_bits;
using test::e57_field;
using test::e57_packet;
using test::E57File;
using test::read_e57;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

template <typename T>
std::string numbers(const std::vector<T>& values) {
  std::string bytes;
  for (const T value : values) bytes += raw(value);
  return bytes;
}

const std::string kXyz = test::e57_xyz();

std::string pose(const std::string& rotation, const std::string& translation) {
  return "<pose type=\"Structure\">" + rotation + translation + "</pose>";
}

constexpr const char* kMove =
    "<translation type=\"Structure\"><x type=\"Float\">100</x><y type=\"Float\">200</y>"
    "<z type=\"Float\"/></translation>";

}  // namespace

TEST_CASE("e57: coordinates of every type are those of the file", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  E57File file;
  file.scan(kXyz, 2,
            e57_packet({numbers<double>({0.1, 1e300}), numbers<double>({-2, 3}),
                        numbers<double>({1e-300, -0.0})}));
  file.scan(
      test::e57_fields({"cartesianX", "cartesianY", "cartesianZ"}, "Float precision=\"single\""), 1,
      e57_packet({raw(0.1F), raw(-1e30F), raw(7.0F)}));
  const std::string scaled =
      "ScaledInteger minimum=\"-1048576\" maximum=\"1048575\" scale=\"1e-6\" offset=\"5\"";
  file.scan(e57_field("cartesianX", scaled) + e57_field("cartesianY", scaled) +
                e57_field("cartesianZ", "Integer minimum=\"-4\" maximum=\"3\""),
            2,
            e57_packet({e57_bits({0, 2097151}, 21), e57_bits({1048576, 1048577}, 21),
                        e57_bits({0, 7}, 3)}));
  const Cloud cloud = read_e57(scratch.file("a.e57", file.bytes()));
  REQUIRE(cloud.surfels.size() == 5);
  CHECK(cloud.info.count == 5);
  CHECK(cloud.surfels[0].position == glm::dvec3(0.1, -2, 1e-300));
  CHECK(cloud.surfels[1].position == glm::dvec3(1e300, 3, -0.0));
  CHECK(cloud.surfels[2].position ==
        glm::dvec3(static_cast<double>(0.1F), static_cast<double>(-1e30F), 7));
  CHECK(cloud.surfels[3].position == glm::dvec3(-1048576 * 1e-6 + 5, 5, -4));
  CHECK(cloud.surfels[4].position == glm::dvec3(1048575 * 1e-6 + 5, 1e-6 + 5, 3));
  CHECK_FALSE(cloud.info.has_normals);
  CHECK_FALSE(cloud.info.has_albedo);
  CHECK(cloud.surfels[0].albedo == glm::vec3(0.5F));
}

TEST_CASE("e57: spherical coordinates are turned into Cartesian ones", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const double quarter = std::acos(0.0);
  E57File file;
  file.scan(
      test::e57_fields({"sphericalAzimuth", "sphericalElevation", "sphericalRange"}, "Float") +
          e57_field("sphericalInvalidState", "Integer minimum=\"0\" maximum=\"2\""),
      4,
      e57_packet({numbers<double>({0, quarter, 0, 1}), numbers<double>({0, 0, quarter, 1}),
                  numbers<double>({2, 3, 4, 5}), e57_bits({0, 0, 0, 2}, 2)}));
  const Cloud cloud = read_e57(scratch.file("a.e57", file.bytes()));
  REQUIRE(cloud.surfels.size() == 3);
  CHECK(glm::length(cloud.surfels[0].position - glm::dvec3(2, 0, 0)) < 1e-15);
  CHECK(glm::length(cloud.surfels[1].position - glm::dvec3(0, 3, 0)) < 1e-15);
  CHECK(glm::length(cloud.surfels[2].position - glm::dvec3(0, 0, 4)) < 1e-15);
  CHECK(cloud.info.channels.empty());
  CHECK(cloud.info.scanners == std::vector<glm::dvec3>{glm::dvec3(0)});
  CHECK(cloud.left_out == 1);
  CHECK(cloud.info.count == 4);
}

TEST_CASE("e57: points without a place are left out, and their rows with them", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  E57File file;
  file.scan(kXyz + e57_field("cartesianInvalidState", "Integer minimum=\"0\" maximum=\"2\"") +
                e57_field("rowIndex", "Integer minimum=\"0\" maximum=\"15\""),
            6,
            e57_packet({numbers<double>({0, 1, 2, kNan, 4, 5}),
                        numbers<double>({0, 1, 2, 3, kNan, 5}), numbers<double>({0, 1, 2, 3, 4, 5}),
                        e57_bits({1, 0, 2, 0, 0, 0}, 2), e57_bits({9, 10, 11, 12, 13, 14}, 4)}));
  for (const std::size_t block : {1UL, 2UL, 100UL}) {
    const Cloud cloud = read_e57(scratch.file("a.e57", file.bytes()), block);
    REQUIRE(cloud.surfels.size() == 2);
    CHECK(cloud.surfels[0].position == glm::dvec3(1));
    CHECK(cloud.surfels[1].position == glm::dvec3(5));
    CHECK(cloud.value<std::uint8_t>(0, "row") == 10);
    CHECK(cloud.value<std::uint8_t>(1, "row") == 14);
    CHECK(cloud.left_out == 4);
    CHECK(cloud.info.count == 6);
  }
}

TEST_CASE("e57: poses move points, turn normals and say where the scanners stood", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string with_normals = kXyz + test::e57_fields({"s:normalX", "s:normalY", "s:normalZ"},
                                                           "Float precision=\"single\"");
  // A quarter turn about z takes x to y. The quaternion is not normalised.
  const std::string turn =
      "<rotation type=\"Structure\"><w type=\"Float\">2</w><x type=\"Float\"/><y type=\"Float\"/>"
      "<z type=\"Float\">2</z></rotation>";
  E57File file;
  file.scan(
      with_normals, 4,
      test::e57_xyz_packet(4, {numbers<float>({3, 0, NAN, 0}), numbers<float>({0, 0, 0, 0.6F}),
                               numbers<float>({0, 0, 1, 0.8F})}),
      pose(turn, kMove));
  file.scan(kXyz, 1, test::e57_xyz_packet(1, {}), pose("", kMove));
  file.scan(kXyz, 1, test::e57_xyz_packet(1, {}), pose("", ""));
  const Cloud cloud = read_e57(scratch.file("a.e57", file.bytes()));
  REQUIRE(cloud.surfels.size() == 6);
  CHECK(cloud.info.has_normals);
  CHECK(glm::length(cloud.surfels[0].position - glm::dvec3(90, 200, 20)) < 1e-13);
  CHECK(glm::length(cloud.surfels[1].position - glm::dvec3(89, 201, 21)) < 1e-13);
  CHECK(glm::length(cloud.surfels[0].normal - glm::vec3(0, 1, 0)) < 1e-6F);
  CHECK(cloud.surfels[1].normal == glm::vec3(0));
  CHECK(cloud.surfels[2].normal == glm::vec3(0));
  CHECK(glm::length(cloud.surfels[3].normal - glm::vec3(-0.6F, 0, 0.8F)) < 1e-6F);
  CHECK(cloud.surfels[4].position == glm::dvec3(100, 210, 20));
  CHECK(cloud.surfels[4].normal == glm::vec3(0));
  CHECK(cloud.surfels[5].position == glm::dvec3(0, 10, 20));
  const std::vector<glm::dvec3> places = {{100, 200, 0}, {100, 200, 0}, {0, 0, 0}};
  CHECK(cloud.info.scanners == places);
  CHECK(cloud.channel("scan").type == ChannelType::u16);
  CHECK(cloud.channel("scan").role == ChannelRole::label);
  for (std::size_t i = 0; i < 6; ++i) {
    CHECK(cloud.value<std::uint16_t>(i, "scan") == (i < 4 ? 0 : i - 3));
  }
}

TEST_CASE("e57: scanners are not known when a scan of Cartesian points has no pose", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  E57File file;
  file.scan(kXyz, 1, test::e57_xyz_packet(1, {}), pose("", kMove));
  file.scan(kXyz, 1, test::e57_xyz_packet(1, {}));
  CHECK(read_e57(scratch.file("a.e57", file.bytes())).info.scanners.empty());
}

TEST_CASE("e57: bytestreams may run ahead of each other across packets", "[io][e57]") {
  // 100 records: x in one packet, y in ten, z after them; 13-bit integers are cut anywhere.
  const test::TemporaryDirectory scratch;
  const std::vector<std::string> xyz = test::e57_xyz_streams(100);
  std::vector<std::uint64_t> stored;
  for (std::uint64_t i = 0; i < 100; ++i) stored.push_back(i * 83 % 8192);
  const std::string bits = e57_bits(stored, 13);
  for (const std::size_t cut : {1UL, 3UL, 80UL, 799UL}) {
    std::string packets = e57_packet({xyz[0], "", "", ""});
    for (std::size_t at = 0; at < 800; at += cut) {
      packets +=
          e57_packet({"", xyz[1].substr(at, cut), "", bits.substr(std::min(at, bits.size()), cut)});
      packets += std::string("\x02\0\x03\0", 4);                       // an empty packet
      packets += std::string("\0\0\x0f\0", 4) + std::string(12, 'i');  // an index packet
    }
    for (std::size_t at = 0; at < 800; at += 17)
      packets += e57_packet({"", "", xyz[2].substr(at, 17), ""});
    E57File file;
    file.scan(kXyz + e57_field("a", "Integer minimum=\"0\" maximum=\"8191\""), 100, packets);
    const Cloud cloud = read_e57(scratch.file("a.e57", file.bytes()), 64);
    REQUIRE(cloud.surfels.size() == 100);
    for (std::size_t i = 0; i < 100; ++i) {
      const auto n = static_cast<double>(i);
      CHECK(cloud.surfels[i].position == glm::dvec3(n, 10 + n, 20 + n));
      CHECK(cloud.value<std::uint16_t>(i, "a") == stored[i]);
    }
  }
}

TEST_CASE("e57: blocks and pages end anywhere without a change to the points", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  std::vector<std::uint64_t> stored;
  for (std::uint64_t i = 0; i < 1500; ++i) stored.push_back(i);
  const std::string packets = test::e57_xyz_packet(1500, {e57_bits(stored, 11)});
  for (const std::size_t page : {64UL, 128UL, 1024UL, 65536UL, 1UL << 20}) {
    E57File file(page);
    file.scan(kXyz + e57_field("a", "Integer minimum=\"0\" maximum=\"2047\""), 1500, packets);
    const auto path = scratch.file("a.e57", file.bytes());
    for (const std::size_t block : {1UL, 511UL, 512UL, 513UL, 5000UL}) {
      const Cloud cloud = read_e57(path, block);
      REQUIRE(cloud.surfels.size() == 1500);
      bool equal = true;
      for (std::size_t i = 0; i < 1500; ++i) {
        equal = equal && cloud.surfels[i].position.z == static_cast<double>(20 + i) &&
                cloud.value<std::uint16_t>(i, "a") == i;
      }
      CHECK(equal);
    }
  }
}

TEST_CASE("e57: a compressor may start anew where all records are complete", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string field = e57_field("a", "Integer minimum=\"0\" maximum=\"31\"");
  const std::vector<std::string> xyz = test::e57_xyz_streams(5);
  const auto piece = [&](std::size_t from, std::size_t count, const std::string& bits, char flags) {
    return e57_packet({xyz[0].substr(8 * from, 8 * count), xyz[1].substr(8 * from, 8 * count),
                       xyz[2].substr(8 * from, 8 * count), bits},
                      flags);
  };
  E57File file;
  file.scan(kXyz + field, 5,
            piece(0, 3, e57_bits({1, 2, 3}, 5), 1) + piece(3, 2, e57_bits({4, 5}, 5), 1));
  const Cloud cloud = read_e57(scratch.file("a.e57", file.bytes()));
  REQUIRE(cloud.surfels.size() == 5);
  for (std::size_t i = 0; i < 5; ++i) CHECK(cloud.value<std::uint8_t>(i, "a") == i + 1);
  E57File bad;
  bad.scan(kXyz + field, 5, piece(0, 3, e57_bits({1, 2, 3, 4, 5}, 5), 1) + piece(3, 2, "", 1));
  CHECK_THROWS_WITH(read_e57(scratch.file("b.e57", bad.bytes())),
                    Contains("starts the compressor anew before a record is complete"));
}

TEST_CASE("e57: fields of text are passed over", "[io][e57]") {
  const Cloud cloud = test::read_e57_scan(
      e57_field("remark", "String") + e57_field("a", "Integer minimum=\"0\" maximum=\"255\""), 2,
      {"\x04hi\x02"
       "a",
       "\x08\x09"});
  CHECK(cloud.info.channels.size() == 1);
  CHECK(cloud.value<std::uint8_t>(1, "a") == 9);
  CHECK(cloud.info.notes ==
        std::vector<std::string>{"Fields of points that hold text are not read."});
}

TEST_CASE("e57: facts about the file are texts and notes", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string start =
      "<acquisitionStart type=\"Structure\"><dateTimeValue type=\"Float\">1.25e+9</dateTimeValue>"
      "</acquisitionStart>";
  E57File file;
  file.root(
      "<coordinateMetadata type=\"String\"><![CDATA[\n PROJCS[\"a]]]><![CDATA[]>\"] ]]>"
      "</coordinateMetadata><images2D><vectorChild/><vectorChild/></images2D>");
  file.scan(kXyz, 1, test::e57_xyz_packet(1, {}), start);
  const PointFileInfo info = read_e57(scratch.file("a.e57", file.bytes())).info;
  CHECK(info.text.at("crs") == "PROJCS[\"a]]>\"]");
  CHECK(info.text.at("up") == "z");
  CHECK(info.text.at("metres_per_unit") == "1");
  CHECK(std::stod(info.text.at("time")) == 1.25e9);
  CHECK(info.notes == std::vector<std::string>{"The pictures in the file (2) are not read."});
  E57File bad;
  bad.root("<coordinateMetadata type=\"String\">\xff</coordinateMetadata>");
  CHECK(read_e57(scratch.file("b.e57", bad.bytes())).info.text.count("crs") == 0);
}

TEST_CASE("e57: a file without scans has no points", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const Cloud cloud = read_e57(scratch.file("a.e57", E57File().bytes()));
  CHECK(cloud.surfels.empty());
  CHECK(cloud.info.count == 0);
  CHECK(cloud.info.channels.empty());
}
