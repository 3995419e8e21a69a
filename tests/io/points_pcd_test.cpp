// Clouds from PCD, and the decompression of LZF.
#include <array>
#include <cmath>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/lzf.h"
#include "tests/io/clouds.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

// A header for points x y z (float), id (u16), v (3 doubles).
std::string header(int width, int height, const std::string& data) {
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z id v\n"
         "SIZE 4 4 4 2 8\nTYPE F F F U F\nCOUNT 1 1 1 1 3\nWIDTH " +
         std::to_string(width) + "\nHEIGHT " + std::to_string(height) +
         "\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS " + std::to_string(width * height) + "\nDATA " + data +
         "\n";
}

constexpr std::size_t kPointBytes = 38;

std::string point(int i, bool hole = false) {
  const auto f = static_cast<float>(i);
  return raw(hole ? std::nanf("") : f) + raw(f + 1) + raw(f + 2) +
         raw(static_cast<std::uint16_t>(i + 40000)) + raw(i + 0.5) + raw(i + 0.25) + raw(i + 0.125);
}

std::string points(int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += point(i, i == 2);
  return all;
}

// Puts the fields of packed points one after another.
std::string columns(const std::string& packed) {
  std::string all;
  std::size_t at = 0;
  for (const std::size_t bytes : std::array<std::size_t, 5>{4, 4, 4, 2, 24}) {
    for (std::size_t i = at; i < packed.size(); i += kPointBytes) all += packed.substr(i, bytes);
    at += bytes;
  }
  return all;
}

// Compresses into runs of up to 32 bytes as they are.
std::string as_literals(const std::string& bytes) {
  std::string packed;
  for (std::size_t at = 0; at < bytes.size(); at += 32) {
    const std::string run = bytes.substr(at, 32);
    packed += static_cast<char>(run.size() - 1) + run;
  }
  return packed;
}

std::string compressed(const std::string& lzf, std::size_t bytes) {
  return raw(static_cast<std::uint32_t>(lzf.size())) + raw(static_cast<std::uint32_t>(bytes)) + lzf;
}

std::string compressed_file(int width, int height) {
  const std::string data = columns(points(width * height));
  return header(width, height, "binary_compressed") + compressed(as_literals(data), data.size());
}

void check_points(const Cloud& cloud, int count) {
  CHECK(cloud.left_out == 1);  // point 2
  REQUIRE(cloud.surfels.size() == static_cast<std::size_t>(count) - 1);
  CHECK(cloud.channel("id").type == ChannelType::u16);
  CHECK(cloud.channel("v").type == ChannelType::f64);
  CHECK(cloud.channel("v").components == 3);
  for (int i = 0; i < count; ++i) {
    if (i == 2) continue;
    const std::size_t at = static_cast<std::size_t>(i < 2 ? i : i - 1);
    CHECK(cloud.surfels[at].position == glm::dvec3(i, i + 1, i + 2));
    CHECK(cloud.value(at, "id") == i + 40000);
    CHECK(cloud.value(at, "v", 0) == i + 0.5);
    CHECK(cloud.value(at, "v", 2) == i + 0.125);
  }
}

// Decompresses a file of LZF, in reads of `step` bytes.
std::string unpack(const std::filesystem::path& path, std::size_t bytes, std::size_t step) {
  const InputFile file(path);
  LzfReader reader(file, 0, file.size());
  std::string all(bytes, '?');
  for (std::size_t at = 0; at < bytes; at += step) {
    const std::size_t count = std::min(step, bytes - at);
    reader.read(std::as_writable_bytes(std::span(all.data() + at, count)));
  }
  CHECK(reader.at_end());
  return all;
}

}  // namespace

TEST_CASE("pcd: ascii, binary and compressed give the same points", "[io][points]") {
  const test::TemporaryDirectory scratch;
  std::string text = header(5, 1, "ascii");
  for (int i = 0; i < 5; ++i) {
    const auto number = [&](double v) { return std::to_string(v) + " "; };
    text += (i == 2 ? "nan " : number(i)) + number(i + 1) + number(i + 2) +
            std::to_string(i + 40000) + " " + number(i + 0.5) + number(i + 0.25) +
            number(i + 0.125) + "\n";
  }
  for (const std::string& bytes :
       {text, header(5, 1, "binary") + points(5), compressed_file(5, 1)}) {
    for (std::size_t block = 1; block <= 6; ++block) {
      const Cloud cloud = read_cloud(scratch.file("a.pcd", bytes), block);
      check_points(cloud, 5);
      CHECK(cloud.names() == "id v");
      CHECK(cloud.info.scanners == std::vector<glm::dvec3>{glm::dvec3(1, 2, 3)});
      CHECK(cloud.info.text.at("up") == "z");
    }
  }
}

TEST_CASE("pcd: a grid has rows and columns", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const std::string& bytes : {header(2, 3, "binary") + points(6), compressed_file(2, 3)}) {
    const Cloud cloud = read_cloud(scratch.file("a.pcd", bytes));
    check_points(cloud, 6);
    CHECK(cloud.names() == "id v row column");
    CHECK(cloud.channel("row").type == ChannelType::u32);
    const std::array<int, 5> places = {0, 1, 3, 4, 5};
    for (std::size_t i = 0; i < 5; ++i) {
      CHECK(cloud.value(i, "row") == places[i] / 2);
      CHECK(cloud.value(i, "column") == places[i] % 2);
    }
  }
}

TEST_CASE("pcd: a compressed file of many blocks is read column by column", "[io][points]") {
  const test::TemporaryDirectory scratch;
  constexpr int kCount = 20000;  // 760 KB: several blocks of records
  const Cloud cloud = read_cloud(scratch.file("a.pcd", compressed_file(kCount, 1)), 1000);
  REQUIRE(cloud.surfels.size() == kCount - 1);
  for (const int i : {3, 6898, 6899, 13797, kCount - 1}) {
    const auto at = static_cast<std::size_t>(i - 1);
    CHECK(cloud.surfels[at].position.x == i);
    CHECK(cloud.value(at, "v", 1) == i + 0.25);
  }
}

TEST_CASE("pcd: packed colours are taken apart, whatever their type", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto read = [&](const std::string& name, const std::string& type) {
    return read_cloud(
        scratch.file("a.pcd", "VERSION .7\nFIELDS x y z " + name + "\nSIZE 4 4 4 4\nTYPE F F F " +
                                  type + "\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA binary\n" +
                                  raw(1.0F) + raw(2.0F) + raw(3.0F) + raw(0x40ff0180U)));
  };
  for (const char* type : {"F", "U", "I"}) {
    const Cloud cloud = read("rgb", type);
    CHECK(cloud.names() == "rgb");
    CHECK(cloud.value(0, "rgb", 0) == 255);
    CHECK(cloud.value(0, "rgb", 1) == 1);
    CHECK(cloud.value(0, "rgb", 2) == 128);
    CHECK(cloud.surfels[0].albedo.x == 1);
    CHECK(cloud.info.scanners.empty());
  }
  CHECK(read("rgba", "U").value(0, "alpha") == 64);
  // In text, a float stands for its bits: 4.2108e+06 is 0x4a8080e0.
  const Cloud text = read_cloud(
      scratch.file("b.pcd",
                   "VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nWIDTH 1\nHEIGHT 1\n"
                   "POINTS 1\nDATA ascii\n1 2 3 4.2108e+06\n"));
  CHECK(text.value(0, "rgb", 0) == 128);
  CHECK(text.value(0, "rgb", 2) == 224);
}

TEST_CASE("pcd: normals, curvature, labels and old headers are read", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const Cloud cloud = read_cloud(scratch.file(
      "a.pcd",
      "VERSION .5\nCOLUMNS x y z normal_x normal_y normal_z curvature label big\n"
      "SIZE 4 4 4 4 4 4 4 4 8\nTYPE F F F F F F F U U\nPOINTS 3\nDATA ascii\n"
      "1 2 3 0 0 2 0.5 7 18446744073709551615\n4 5 6 nan nan nan nan 8 0\n7 8 9 0 0 0 1 9 1\n"));
  REQUIRE(cloud.surfels.size() == 3);
  CHECK(cloud.names() == "curvature label big");
  CHECK(cloud.surfels[0].normal == glm::vec3(0, 0, 1));
  CHECK(cloud.surfels[1].normal == glm::vec3(0));
  CHECK(cloud.surfels[2].normal == glm::vec3(0));
  CHECK(cloud.value(0, "curvature") == 0.5);
  CHECK(std::isnan(cloud.value(1, "curvature")));
  CHECK(cloud.channel("label").role == ChannelRole::label);
  std::uint64_t big = 0;
  std::memcpy(&big, cloud.rows.data() + 8, sizeof big);
  CHECK(big == UINT64_MAX);
}

TEST_CASE("pcd: padding and descriptors are passed over", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string fields =
      "VERSION 0.6\nFIELDS x _ y z wide vfh _\nSIZE 4 1 4 4 4 4 2\nTYPE F U F F F F U\n"
      "COUNT 1 3 1 1 16 17 1\nWIDTH 1\nHEIGHT 1\nDATA ";
  const std::string binary = fields + "binary\n" + raw(1.0F) + "abc" + raw(2.0F) + raw(3.0F) +
                             std::string(60, '\0') + raw(7.0F) + std::string(68, 'v') + "zz";
  std::string text = fields + "ascii\n1 1 2 3 2 3";
  for (int i = 0; i < 15; ++i) text += " 0";
  text += " 7";
  for (int i = 0; i < 17; ++i) text += " 5";
  text += " 9\n";
  for (const std::string& bytes : {binary, text}) {
    const Cloud cloud = read_cloud(scratch.file("a.pcd", bytes));
    CHECK(cloud.surfels.at(0).position == glm::dvec3(1, 2, 3));
    CHECK(cloud.names() == "wide");
    CHECK(cloud.value(0, "wide", 15) == 7);
    CHECK(cloud.notes() == "The field 'vfh' has 17 numbers in each point and is left out.");
  }
}

TEST_CASE("pcd: a header that breaks a rule is refused by line", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto fault = [&](const std::string& text) { return cloud_fault(scratch, "a.pcd", text); };
  const auto with = [](std::string from, const std::string& to) {
    std::string text = header(1, 1, "binary");
    return text.replace(text.find(from), from.size(), to) + point(0);
  };
  CHECK(fault(with("id v", "id v")).empty());
  CHECK(fault("VERSION 0.7\n") == "line 1: the PCD header has no end");
  CHECK(fault(with("VERSION 0.7", "VERSION 0.8")) ==
        "line 2: the PCD version is not 0.5, 0.6 or 0.7");
  CHECK(fault(with("SIZE", "SISE")) ==
        "line 4: the line does not begin with a keyword of a PCD header");
  CHECK(fault(with("SIZE 4 4 4 2 8", "SIZE 4 4 4 2")) ==
        "line 11: FIELDS, SIZE, TYPE and COUNT of a PCD header must have as many values");
  CHECK(fault(with("SIZE 4 4 4 2 8", "SIZE 4 4 4 2 3")) == "line 11: PCD has no type F of 3 bytes");
  CHECK(fault(with("F F F U F", "F F F U Q")) == "line 11: PCD has no type Q of 8 bytes");
  CHECK(fault(with("COUNT 1 1 1 1 3", "COUNT 1 1 1 1 0")) ==
        "line 11: the PCD field 'v' has no numbers");
  CHECK(fault(with("COUNT 1 1 1 1 3", "COUNT 1 1 1 1 999999999999")) ==
        "line 11: a PCD point takes more than 1 MiB");
  CHECK(fault(with("COUNT 1 1 1 1 3", "COUNT 1 1 1 1 -3")) ==
        "line 6: a value in the PCD header is not a count");
  CHECK(fault(with("POINTS 1", "POINTS 2")) ==
        "line 11: POINTS of the PCD header is not WIDTH times HEIGHT");
  CHECK(fault(with("WIDTH 1\nHEIGHT 1", "WIDTH 9223372036854775807\nHEIGHT 4")) ==
        "line 11: WIDTH times HEIGHT of the PCD header is too large");
  CHECK(fault(with("VIEWPOINT 1 2 3", "VIEWPOINT 1 2")) ==
        "line 9: a PCD viewpoint must have seven finite numbers");
  CHECK(fault(with("DATA binary", "DATA base64")) ==
        "line 11: the data of a PCD file must be ascii, binary or binary_compressed");
  CHECK(fault(with("x y z", "a b c")) == "the PCD points have no x, y and z");
  CHECK_THAT(
      fault(with("WIDTH 1\nHEIGHT 1", "WIDTH 1000000\nHEIGHT 1000000") + std::string(9, ' ')),
      Contains("POINTS of the PCD header"));
  std::string huge = with("WIDTH 1", "WIDTH 1000000");
  huge.replace(huge.find("POINTS 1"), 8, "POINTS 1000000");
  CHECK_THAT(fault(huge),
             Contains("the PCD header counts 1000000 points, more than the file can hold"));
}

TEST_CASE("pcd: every truncation of binary and compressed files is refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const std::string& whole : {header(3, 1, "binary") + points(3),
                                   header(3, 2, "binary") + points(6), compressed_file(3, 1)}) {
    REQUIRE(cloud_fault(scratch, "a.pcd", whole).empty());
    for (std::size_t size = 1; size < whole.size(); ++size) {
      INFO(size);
      CHECK_FALSE(cloud_fault(scratch, "a.pcd", whole.substr(0, size)).empty());
    }
  }
}

TEST_CASE("pcd: less than a page of zeros may follow the points, nothing else", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const std::string& whole : {header(3, 1, "binary") + points(3), compressed_file(3, 1)}) {
    const auto fault = [&](const std::string& rest) {
      return cloud_fault(scratch, "a.pcd", whole + rest);
    };
    const std::string rule =
        "offset " + std::to_string(whole.size()) + ": the file has more data than its header says";
    CHECK(fault(std::string(4096, '\0')).empty());
    CHECK(fault(std::string(4097, '\0')) == rule);
    CHECK(fault("x") == rule);
    CHECK(fault(std::string(100, '\0') + "x") == rule);
  }
  const std::string text =
      "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nDATA ascii\n";
  CHECK(cloud_fault(scratch, "a.pcd", text + "1 2 3\n\n \n").empty());
  CHECK(cloud_fault(scratch, "a.pcd", text + "1 2 3\n4 5 6\n") ==
        "line 8: the file has more data than its header says");
  CHECK(cloud_fault(scratch, "a.pcd", text + "1.0000 2\n") ==
        "line 7: a value of field 'z' is missing");
  CHECK(cloud_fault(scratch, "a.pcd", text + "1 2 3 4\n") ==
        "line 7: the line has more values than the PCD has fields");
  CHECK(cloud_fault(scratch, "a.pcd", text + "1 2 c\n") ==
        "line 7: a value of field 'z' is not of its type");
}

TEST_CASE("pcd: compressed data of another size than the header says are refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string data = columns(points(3));
  const std::string lzf = as_literals(data);
  const std::string head = header(3, 1, "binary_compressed");
  const auto fault = [&](const std::string& rest) {
    return cloud_fault(scratch, "a.pcd", head + rest);
  };
  CHECK(fault(compressed(lzf, data.size())).empty());
  CHECK_THAT(fault(compressed(lzf, data.size() - 1)),
             Contains("the LZF data have another size than the points of the header"));
  CHECK_THAT(fault(compressed(lzf + std::string(2, '\0'), data.size())),
             Contains("damaged LZF data: they go on behind the last point"));
  CHECK_THAT(fault(compressed(as_literals(data.substr(1)), data.size())),
             Contains("damaged LZF data: they end too early"));
  CHECK_THAT(
      cloud_fault(scratch, "a.pcd",
                  header(300, 1, "binary_compressed") + compressed("\x1f", 300 * kPointBytes)),
      Contains("the LZF data cannot stand for so many bytes"));
  CHECK_THAT(fault(raw(0xffffffffU) + raw(static_cast<std::uint32_t>(data.size())) + lzf),
             Contains("the LZF data end too early"));
}

TEST_CASE("lzf: runs and matches of every form are decompressed in pieces of any size",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  using namespace std::string_literals;
  // "abc", then 3 + 2 bytes from 3 back, 9 + 2 + 250 from 1 back, "Z" once, and 3 from 262 back.
  const std::string packed =
      "\x02"s + "abc" + "\x60\x02" + "\xe0\xfc" + "\0"s + "\0"s + "Z" + "\x21\x05";
  const std::string expected =
      "abc"
      "abcab" +
      std::string(261, 'b') + "Z" +
      (std::string("abcabcab") + std::string(261, 'b')).substr(8 + 261 + 1 - 262, 3);
  const auto path = scratch.file("a", packed);
  for (std::size_t step = 1; step <= expected.size(); ++step)
    CHECK(unpack(path, expected.size(), step) == expected);
}

TEST_CASE("lzf: a match may reach back 8192 bytes and no farther than the data", "[io][points]") {
  const test::TemporaryDirectory scratch;
  std::string data;
  for (int i = 0; i < 8192; ++i) data += static_cast<char>(i * 7 + i / 256);
  // 0x3f 0xff: 1 + 2 bytes from 8192 back.
  const auto path = scratch.file("a", as_literals(data) + "\x3f\xff");
  CHECK(unpack(path, data.size() + 3, 1000) == data + data.substr(0, 3));
  const auto far = scratch.file("b", as_literals(data.substr(1)) + "\x3f\xff");
  CHECK_THROWS_WITH(unpack(far, data.size() + 2, 1000),
                    Contains("damaged LZF data: a match begins before the data"));
}
