// Clouds from PLY.
#include <algorithm>
#include <cmath>
#include <functional>

#include <catch2/catch.hpp>
#include <zlib.h>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/text/text.h"
#include "tests/io/clouds.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;

namespace {

std::vector<Surfel> read_all(const std::filesystem::path& path, std::size_t block = 7) {
  PointFile file = open_points(path);
  std::vector<Surfel> all;
  std::vector<Surfel> some(block);
  while (const std::size_t count = file.source->next(some)) {
    all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return all;
}

// A cloud of three points with every property of a point; the same values in each encoding.
constexpr std::string_view kProperties =
    "property double x\nproperty double y\nproperty double z\n"
    "property float nx\nproperty float ny\nproperty float nz\nproperty float radius\n"
    "property float radiance_r\nproperty float radiance_g\nproperty float radiance_b\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty short extra\n";

template <typename T>
std::string stored(T value, bool big) {
  std::string bytes = raw(value);
  if (big) std::ranges::reverse(bytes);
  return bytes;
}

std::string header(std::string_view format, std::string_view elements) {
  return "ply\nformat " + std::string(format) + " 1.0\ncomment made by hand\nobj_info none\n" +
         std::string(elements) + "end_header\n";
}

std::string binary_cloud(bool big) {
  std::string text = header(big ? "binary_big_endian" : "binary_little_endian",
                            "element vertex 3\n" + std::string(kProperties));
  for (int i = 0; i < 3; ++i) {
    for (const double p : {1e7 + i + 0.001, -i - 0.25, 3.0}) text += stored(p, big);
    for (const float n : {0.0F, 0.0F, 2.0F}) text += stored(n, big);
    text += stored(0.5F, big);
    for (const float r : {1.5F, 0.25F, 0.0F}) text += stored(r, big);
    for (const int c : {0, 128, 255}) text += stored(static_cast<std::uint8_t>(c), big);
    text += stored(std::int16_t{-7}, big);
  }
  return text;
}

std::string ascii_cloud() {
  std::string text = header("ascii", "element vertex 3\n" + std::string(kProperties));
  for (int i = 0; i < 3; ++i) {
    text += std::to_string(10000000 + i) + ".001 " + std::to_string(-i - 0.25) +
            " 3 0 0 2 0.5 1.5 0.25 0 0 128 255 -7\n";
  }
  return text;
}

void check_cloud(const std::vector<Surfel>& surfels) {
  REQUIRE(surfels.size() == 3);
  for (int i = 0; i < 3; ++i) {
    const Surfel& s = surfels[static_cast<std::size_t>(i)];
    CHECK(s.position == glm::dvec3(1e7 + i + 0.001, -i - 0.25, 3));
    CHECK(s.normal == glm::vec3(0, 0, 1));
    CHECK(s.radius == 0.5F);
    CHECK(s.radiance == glm::vec3(1.5F, 0.25F, 0));
    CHECK(s.albedo.x == 0);
    CHECK(static_cast<double>(s.albedo.y) == Approx(0.2158605));
    CHECK(s.albedo.z == 1);
  }
}

std::string gzipped(const std::filesystem::path& path, const std::string& bytes) {
  gzFile file = gzopen(path.c_str(), "wb");
  gzwrite(file, bytes.data(), static_cast<unsigned>(bytes.size()));
  gzclose(file);
  return slurp(path);
}

// Returns the error for a cloud of these lines, without the path.
std::string fault(const test::TemporaryDirectory& scratch, const std::string& bytes) {
  const auto path = scratch.file("fault.ply", bytes);
  std::string text = refusal([&] { static_cast<void>(read_all(path)); });
  const std::string prefix = path.string() + ": ";
  return text.starts_with(prefix) ? text.substr(prefix.size()) : text;
}

std::string one_point(std::string_view properties, std::string_view values) {
  return header("ascii", "element vertex 1\n" + std::string(properties)) + std::string(values) +
         "\n";
}

constexpr std::string_view kXyz = "property float x\nproperty float y\nproperty float z\n";

}  // namespace

TEST_CASE("ply: ascii, both binary orders, CRLF headers and gzip give the same points",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  check_cloud(read_all(scratch.file("a.ply", ascii_cloud())));
  check_cloud(read_all(scratch.file("b.ply", binary_cloud(false))));
  check_cloud(read_all(scratch.file("c.PLY", binary_cloud(true))));
  std::string crlf = ascii_cloud();
  for (std::size_t at = 0; (at = crlf.find('\n', at)) != std::string::npos; at += 2) {
    crlf.replace(at, 1, "\r\n");
  }
  check_cloud(read_all(scratch.file("d.ply", crlf)));
  std::string binary = binary_cloud(false);
  const std::size_t data = binary.find("end_header\n") + 11;
  for (std::size_t at = 0; (at = binary.find('\n', at)) < data + 20;) {
    if (at >= binary.find("end_header\n") + 11) break;
    binary.replace(at, 1, "\r\n");
    at += 2;
  }
  check_cloud(read_all(scratch.file("e.ply", binary)));
  gzipped(scratch.path() / "f.ply.gz", binary_cloud(false));
  check_cloud(read_all(scratch.path() / "f.ply.gz"));
}

TEST_CASE("ply: the points do not depend on the size of the requested blocks", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.file("a.ply", binary_cloud(false));
  for (std::size_t block = 1; block <= 4; ++block) check_cloud(read_all(path, block));
  PointFile file = open_points(path);
  CHECK(file.source->next({}) == 0);
  std::vector<Surfel> all(3);
  CHECK(file.source->next(all) == 3);
  check_cloud(all);
  CHECK(file.source->next(all) == 0);
  CHECK(file.source->next(all) == 0);
}

TEST_CASE("ply: the header is known before the points are read", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const PointFileInfo full = open_points(scratch.file("a.ply", binary_cloud(false))).info;
  CHECK(full.count == 3);
  CHECK((full.has_normals && full.has_radius && full.has_radiance && full.has_albedo));
  const auto bare = scratch.file("b.ply", one_point(kXyz, "1 2 3"));
  const PointFileInfo info = open_points(bare).info;
  CHECK(info.count == 1);
  CHECK_FALSE((info.has_normals || info.has_radius || info.has_radiance || info.has_albedo));
  const Surfel surfel = read_all(bare).at(0);
  CHECK(surfel.position == glm::dvec3(1, 2, 3));
  CHECK(surfel.normal == glm::vec3(0));
  CHECK(surfel.radius == 0);
  CHECK(surfel.radiance == glm::vec3(0));
  CHECK(surfel.albedo == glm::vec3(0.5F));
}

TEST_CASE("ply: colours are sRGB as integers and linear as floats", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto albedo = [&](const std::string& type, const std::string& value,
                          const char* prefix = "") {
    std::string properties(kXyz);
    for (const char* name : {"red", "green", "blue"}) {
      properties += "property " + type + " " + prefix + name + "\n";
    }
    const auto path =
        scratch.file("a.ply", one_point(properties, "0 0 0 " + value + " " + value + " " + value));
    const glm::vec3 colour = read_all(path).at(0).albedo;
    CHECK(colour.x == colour.y);
    CHECK(colour.x == colour.z);
    return static_cast<double>(colour.x);
  };
  CHECK(albedo("uchar", "255") == 1);
  CHECK(albedo("uchar", "10", "diffuse_") == Approx(10 / 255.0 / 12.92));
  CHECK(albedo("char", "127") == Approx(std::pow((127 / 255.0 + 0.055) / 1.055, 2.4)));
  CHECK(albedo("int", "200") == Approx(std::pow((200 / 255.0 + 0.055) / 1.055, 2.4)));
  CHECK(albedo("ushort", "65535") == 1);
  CHECK(albedo("ushort", "32896") == Approx(0.2158605));  // 128 * 257
  CHECK(albedo("ushort", "128") == Approx(0.2158605));    // bytes in wider fields
  CHECK(albedo("ushort", "256") == Approx(256 / 65535.0 / 12.92));
  CHECK(albedo("float", "0.25") == 0.25);
}

TEST_CASE("ply: the largest colour of a file decides whether its fields hold bytes",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto albedo_of_first = [&](const char* second) {
    const std::string header =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
        "property float z\nproperty ushort red\nproperty ushort green\nproperty ushort blue\n"
        "end_header\n";
    const auto path =
        scratch.file("a.ply", header + "0 0 0 255 255 255\n1 0 0 0 " + second + " 0\n");
    const Cloud cloud = read_cloud(path);
    CHECK(cloud.value(0, "rgb", 1) == 255);
    CHECK(cloud.info.notes.size() == (cloud.surfels[0].albedo.x == 1 ? 1 : 0));
    return static_cast<double>(cloud.surfels[0].albedo.x);
  };
  CHECK(albedo_of_first("255") == 1);
  CHECK(albedo_of_first("256") == Approx(255 / 65535.0 / 12.92));
}

TEST_CASE("ply: other names for normals and radius are recognised", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto path =
      scratch.file("a.ply", one_point(std::string(kXyz) +
                                          "property float normal_x\nproperty float normal_y\n"
                                          "property float normal_z\nproperty float scalar_radius\n",
                                      "0 0 0 0 3e-30 4e-30 7"));
  const Surfel surfel = read_all(path).at(0);
  CHECK(surfel.normal.y == Approx(0.6F));
  CHECK(surfel.normal.z == Approx(0.8F));
  CHECK(surfel.radius == 7);
}

TEST_CASE("ply: elements before and after the vertices are skipped, lists included",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string elements =
      "element camera 2\nproperty float a\nproperty double b\n"
      "element face 2\nproperty list uchar int vertex_indices\nproperty uchar flag\n"
      "element empty 9\nelement vertex 1\n" +
      std::string(kXyz) + "element edge 1\nproperty list ushort float w\n";
  const auto ascii = scratch.file(
      "a.ply", header("ascii", elements) + "1 2\n3 4\n3 0 0 0 1\n0 5\n\n7 8 9\n2 1.5 -1\n\n");
  CHECK(read_all(ascii).at(0).position == glm::dvec3(7, 8, 9));
  std::string data = header("binary_little_endian", elements) + std::string(24, 'c');
  data += "\x02" + raw(1) + raw(2) + "f" + std::string(1, '\0') + "f";
  data += raw(7.0F) + raw(8.0F) + raw(9.0F) + raw<std::uint16_t>(1) + raw(0.0F);
  CHECK(read_all(scratch.file("b.ply", data)).at(0).position == glm::dvec3(7, 8, 9));
}

TEST_CASE("ply: a point that breaks a rule is reported with its place", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string normals =
      std::string(kXyz) + "property float nx\nproperty float ny\nproperty float nz\n";
  const std::string with_radius = std::string(kXyz) + "property float radius\n";
  CHECK_THAT(fault(scratch, one_point(normals, "0 0 0 nan 0 1")),
             EndsWith("the normal is not finite"));
  CHECK_THAT(fault(scratch, one_point(normals, "0 0 0 0 inf 1")),
             EndsWith("the normal is not finite"));
  for (const char* p : {"0 inf 0", "0 0 -inf", "0 1e999 0"}) {
    CHECK_THAT(fault(scratch, one_point(kXyz, p)), EndsWith("point 0: the position is not finite"));
  }
  for (const char* r : {"-1", "nan", "inf", "1e39"}) {
    CHECK_THAT(fault(scratch, one_point(with_radius, std::string("0 0 0 ") + r)),
               EndsWith("the radius is negative, not a number or beyond the range of float"));
  }
  const std::string colours =
      std::string(kXyz) + "property float red\nproperty float green\nproperty float blue\n";
  for (const char* c : {"0 0 -0.1", "nan 0 0", "0 1.01 0"}) {
    CHECK_THAT(fault(scratch, one_point(colours, std::string("0 0 0 ") + c)),
               EndsWith("the colour is out of range"));
  }
  std::string binary = binary_cloud(false);
  const std::size_t record = (binary.size() - binary.find("end_header\n") - 11) / 3;
  const std::size_t second = binary.size() - 2 * record;
  binary.replace(second + 36, 4, raw(-1.0F));  // radius of the second point
  CHECK(fault(scratch, binary) ==
        "offset " + std::to_string(second) +
            ": point 1: the radius is negative, not a number or beyond the range of float");
}

TEST_CASE("ply: headers that break a rule are refused by line", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string good = "ply\nformat ascii 1.0\nelement vertex 1\n" + std::string(kXyz);
  const auto refused = [&](const std::string& text) { return fault(scratch, text); };
  CHECK(refused("") == "offset 0: not a PLY file");
  CHECK(refused("plyx\n") == "offset 0: not a PLY file");
  CHECK(refused("ply\n") == "line 1: the PLY header has no end");
  CHECK(refused("ply\nelement vertex 1\n") == "line 2: a PLY header must begin with its format");
  CHECK(refused("ply\nformat ascii 2.0\n") == "line 2: the PLY version is not 1.0");
  CHECK(refused("ply\nformat EBCDIC 1.0\n") == "line 2: a PLY header must begin with its format");
  CHECK(refused(good) == "line 6: the PLY header has no end");
  CHECK(refused(good + "propertie float a\n") ==
        "line 7: the line does not begin with a keyword of a PLY header");
  CHECK(refused(good + "property float\n") == "line 7: a property has no name");
  CHECK(refused(good + "property half a\n") == "line 7: a property has an unknown type");
  CHECK(refused(good + "property float x\n") == "line 7: two properties have the same name");
  CHECK(refused(good + "property list float int a\n") ==
        "line 7: the length of a list must have an integer type");
  CHECK(refused(good + "element vertex 1\n") == "line 7: two elements have the same name");
  CHECK(refused(good + "element face\n") == "line 7: an element needs a name and a count");
  CHECK(refused(good + "element face -1\n") == "line 7: an element needs a name and a count");
  CHECK(refused("ply\nformat ascii 1.0\nproperty float x\n") ==
        "line 3: a property precedes the first element");
  CHECK(refused(good + "property int64 a\n") ==
        "line 7: a property has the type int64, which PLY has not");
  CHECK(refused(good + "property list uchar uint64 a\n") ==
        "line 7: a property has the type uint64, which PLY has not");
  CHECK(refused(good + "property float nx\nend_header\n0 0 0 0\n") ==
        "the PLY vertices do not have all of nx, ny and nz");
  CHECK(refused("ply\nformat ascii 1.0\nend_header\n") == "the PLY file has no vertices");
  CHECK(refused("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n") ==
        "the PLY vertices have no x, y and z");
  CHECK(refused(good + "comment " + std::string(2'000'000, 'c') + "\nend_header\n") ==
        "line 7: the PLY header has more than 1 MiB");
}

TEST_CASE("ply: a count that the file cannot hold is refused when it is opened", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const char* format : {"ascii", "binary_little_endian"}) {
    for (const char* count : {"2", "4294967296", "9223372036854775807"}) {
      const auto path = scratch.file(
          "a.ply",
          header(format, "element vertex " + std::string(count) + "\n" + std::string(kXyz)) +
              "1 2 3 4 5 ");
      CHECK_THROWS_WITH(static_cast<void>(open_points(path)),
                        Contains("element 'vertex' has " + std::string(count) +
                                 " records, more than the file can hold"));
    }
  }
  CHECK_THAT(fault(scratch, header("ascii", "element vertex 1\n" + std::string(kXyz) +
                                                "element face 1000\nproperty list uchar int i\n") +
                                "1 2 3\n"),
             Contains("element 'face' has 1000 records"));
  CHECK_THAT(fault(scratch, header("ascii", "element vertex 99999999999999999999\n")),
             Contains("an element needs a name and a count"));
}

TEST_CASE("ply: every truncation of a binary file is refused with an offset", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const bool big : {false, true}) {
    const std::string whole = binary_cloud(big);
    const std::size_t data = whole.find("end_header\n") + 11;
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const std::string text = fault(scratch, whole.substr(0, size));
      CHECK_FALSE(text.empty());
      if (size >= data) CHECK_THAT(text, Contains("offset " + std::to_string(data)));
    }
  }
}

TEST_CASE("ply: a truncated list is refused at the place of the cut", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string whole =
      header("binary_little_endian", "element vertex 1\n" + std::string(kXyz) +
                                         "element face 1\nproperty list uint double i\n") +
      raw(1.0F) + raw(2.0F) + raw(3.0F) + raw(2U) + raw(0.0) + raw(1.0);
  CHECK(fault(scratch, whole).empty());
  for (std::size_t size = whole.size() - 20 + 4; size < whole.size(); ++size) {
    CHECK_THAT(fault(scratch, whole.substr(0, size)),
               Contains("the file ends too early: " + std::to_string(whole.size() - size) +
                        " bytes are missing"));
  }
  std::string negative = whole;
  negative.replace(negative.find("uint"), 4, "int ").replace(negative.size() - 20, 4, raw(-1));
  CHECK_THAT(fault(scratch, negative), Contains("a list has a negative length"));
  std::string huge = whole;
  huge.replace(huge.size() - 20, 4, raw(0xffffffffU));
  CHECK_THAT(fault(scratch, huge), Contains("a record has more than 64 MiB"));
}

TEST_CASE("ply: every truncation of an ascii file is refused, except inside its last word",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = ascii_cloud();
  for (std::size_t size = 0; size < whole.size() - 2; ++size) {
    CHECK_FALSE(fault(scratch, whole.substr(0, size)).empty());
  }
  CHECK(fault(scratch, whole.substr(0, whole.size() - 1)).empty());
}

TEST_CASE("ply: a gzip file with several members, padded or not, is read whole", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply.gz";
  const std::string cloud = binary_cloud(false);
  for (const std::size_t cut : {std::size_t{1}, cloud.size() / 2, cloud.size() - 1}) {
    const std::string members =
        gzipped(path, cloud.substr(0, cut)) + gzipped(path, cloud.substr(cut));
    for (const std::string padding : {"", "\1", "padding"})
      check_cloud(read_all(scratch.file("b.ply.gz", members + padding)));
  }
}

TEST_CASE("ply: a gzip file that unpacks to more than 64 MiB and 256 times its size is refused",
          "[io][ply]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply.gz";
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n";
  const std::string point = "1 2 3 0 0 1\n";
  gzipped(path, header + std::string(60 << 20, '\n') + point);
  CHECK(read_all(path).size() == 1);
  gzipped(path, header + std::string(100 << 20, '\n') + point);
  CHECK_THROWS_WITH(read_all(path), Contains("a.ply.gz: offset ") &&
                                        Contains("unpack to more than 256 times their size"));
}

TEST_CASE("ply: every truncation and every flipped byte of a gzip file is refused",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.ply.gz";
  const std::string whole = gzipped(path, binary_cloud(false));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto cut = scratch.file("cut.ply.gz", whole.substr(0, size));
    CHECK_THROWS_AS(read_all(cut), DataError);
  }
  for (std::size_t i = 10; i < whole.size(); ++i) {  // after the header, whose fields are free
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    CHECK_THROWS_AS(read_all(scratch.file("bad.ply.gz", damaged)), DataError);
  }
}

TEST_CASE("ply: bytes after the last element are refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string binary = binary_cloud(false);
  CHECK(fault(scratch, binary + "x") == "offset " + std::to_string(binary.size()) +
                                            ": the file has more data than its header says");
  CHECK(fault(scratch, ascii_cloud() + "\n \n").empty());
  CHECK_THAT(fault(scratch, ascii_cloud() + "1 2 3\n"),
             EndsWith("the file has more data than its header says"));
}

TEST_CASE("ply: a line of text must have exactly the values of its element", "[io][points]") {
  const test::TemporaryDirectory scratch;
  CHECK_THAT(fault(scratch, one_point(kXyz, "1 2 3 4")),
             EndsWith("the line has more values than element 'vertex'"));
  CHECK_THAT(fault(scratch, one_point(kXyz, "10000 2000 ")),
             EndsWith("the value of property 'z' is missing"));
  CHECK_THAT(fault(scratch, one_point(kXyz, "1 2 3x")), EndsWith("property 'z' is not a number"));
  CHECK_THAT(fault(scratch, one_point(kXyz, "1 - 3")), EndsWith("property 'y' is not a number"));
  const std::string integer = std::string(kXyz) + "property uchar c\n";
  for (const char* value : {"256", "-1", "1.5", "nan"}) {
    CHECK_THAT(fault(scratch, one_point(integer, std::string("1 2 3 ") + value)),
               EndsWith("property 'c' is not of its type"));
  }
  CHECK(fault(scratch, one_point(kXyz, "+1 .5 2.e1")).empty());
  CHECK(fault(scratch, one_point(kXyz, "1e-999 -0 \t 3 \r")).empty());
}

TEST_CASE("ply: a point without a place is left out and counted", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string data =
      header("binary_little_endian", "element vertex 5\n" + std::string(kXyz) +
                                         "property int id\nelement end 1\nproperty uchar c\n");
  const auto point = [](float x, float y, float z, int id) {
    return raw(x) + raw(y) + raw(z) + raw(id);
  };
  const float nan = std::nanf("");
  const std::string bytes = data + point(nan, 0, 0, 1) + point(1, 2, 3, 2) + point(0, nan, 0, 3) +
                            point(4, 5, 6, 4) + point(0, 0, nan, 5) + "c";
  for (std::size_t block = 1; block <= 6; ++block) {
    const Cloud cloud = read_cloud(scratch.file("a.ply", bytes), block);
    REQUIRE(cloud.surfels.size() == 2);
    CHECK(cloud.left_out == 3);
    CHECK(cloud.info.count == 5);
    CHECK(cloud.surfels[1].position == glm::dvec3(4, 5, 6));
    CHECK(cloud.value(0, "id") == 2);
    CHECK(cloud.value(1, "id") == 4);
  }
  CHECK(fault(scratch, bytes + "x") ==
        "offset " + std::to_string(bytes.size()) + ": the file has more data than its header says");
}

TEST_CASE("ply: a normal of zero length is unknown", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string normals =
      std::string(kXyz) + "property float nx\nproperty float ny\nproperty float nz\n";
  const Cloud cloud = read_cloud(scratch.file("a.ply", one_point(normals, "1 2 3 0 0 0")));
  CHECK(cloud.info.has_normals);
  CHECK(cloud.surfels.at(0).normal == glm::vec3(0));
  CHECK(cloud.surfels.at(0).position == glm::dvec3(1, 2, 3));
}

TEST_CASE("ply: properties beyond the surfel become channels of their types", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string properties =
      "property char a\nproperty uchar b\nproperty short c\nproperty ushort d\n"
      "property int e\nproperty uint f\nproperty float g\nproperty double h\n" +
      std::string(kXyz) +
      "property float scalar_Intensity\nproperty uchar Classification\n"
      "property double GpsTime\nproperty float f_dc_0\nproperty float quality\n";
  const std::string text = one_point(
      properties, "-128 255 -32768 65535 -2147483648 4294967295 0.1 0.1 1 2 3 0.5 6 1e9 -2 7");
  std::string records[2];
  for (const bool big : {false, true}) {
    records[big] = header(big ? "binary_big_endian" : "binary_little_endian",
                          "element vertex 1\n" + properties) +
                   stored(std::int8_t{-128}, big) + stored(std::uint8_t{255}, big) +
                   stored(std::int16_t{-32768}, big) + stored(std::uint16_t{65535}, big) +
                   stored(std::int32_t{-2147483647 - 1}, big) + stored(4294967295U, big) +
                   stored(0.1F, big) + stored(0.1, big) + stored(1.0F, big) + stored(2.0F, big) +
                   stored(3.0F, big) + stored(0.5F, big) + stored(std::uint8_t{6}, big) +
                   stored(1e9, big) + stored(-2.0F, big) + stored(7.0F, big);
  }
  for (const std::string& bytes : {text, records[0], records[1]}) {
    const Cloud cloud = read_cloud(scratch.file("a.ply", bytes));
    CHECK(cloud.names() == "a b c d e f g h intensity classification gps_time f_dc_0 quality");
    const std::vector<ChannelType> types = {ChannelType::i8,  ChannelType::u8,  ChannelType::i16,
                                            ChannelType::u16, ChannelType::i32, ChannelType::u32,
                                            ChannelType::f32, ChannelType::f64};
    for (std::size_t i = 0; i < types.size(); ++i) CHECK(cloud.info.channels[i].type == types[i]);
    CHECK(cloud.value(0, "a") == -128);
    CHECK(cloud.value(0, "b") == 255);
    CHECK(cloud.value(0, "c") == -32768);
    CHECK(cloud.value(0, "d") == 65535);
    CHECK(cloud.value(0, "e") == -2147483648.0);
    CHECK(cloud.value(0, "f") == 4294967295.0);
    CHECK(cloud.value(0, "g") == static_cast<double>(0.1F));
    CHECK(cloud.value(0, "h") == 0.1);
    CHECK(cloud.value(0, "intensity") == 0.5);
    CHECK(cloud.value(0, "classification") == 6);
    CHECK(cloud.channel("classification").role == ChannelRole::label);
    CHECK(cloud.value(0, "gps_time") == 1e9);
    CHECK(cloud.channel("gps_time").role == ChannelRole::time);
    CHECK(cloud.channel("gps_time").unit == "s");
    CHECK(cloud.value(0, "f_dc_0") == -2);
    CHECK(cloud.value(0, "quality") == 7);
    CHECK(cloud.surfels.at(0).position == glm::dvec3(1, 2, 3));
    CHECK(cloud.info.notes.empty());
  }
}

TEST_CASE("ply: text keeps the digits of positions that are declared as float", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const Cloud cloud = read_cloud(scratch.file("a.ply", one_point(kXyz, "1234567.891 0.1 -0.3")));
  CHECK(cloud.surfels.at(0).position == glm::dvec3(1234567.891, 0.1, -0.3));
}

TEST_CASE("ply: integer colours are kept in a channel with the bits of the file", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto read = [&](const std::string& type, const std::string& names, const char* values) {
    std::string properties(kXyz);
    Words words(names);
    for (std::string_view name = words.next(); !name.empty(); name = words.next()) {
      properties += "property " + type + " " + std::string(name) + "\n";
    }
    return read_cloud(scratch.file("a.ply", one_point(properties, std::string("0 0 0 ") + values)));
  };
  for (const char* names :
       {"red green blue alpha", "diffuse_red diffuse_green diffuse_blue alpha", "r g b alpha"}) {
    const Cloud cloud = read("uchar", names, "255 1 0 77");
    CHECK(cloud.names() == "rgb alpha");
    CHECK(cloud.info.has_albedo);
    const Channel& rgb = cloud.channel("rgb");
    CHECK((rgb.type == ChannelType::u8 && rgb.components == 3));
    CHECK((rgb.role == ChannelRole::colour && rgb.colour_space == ColourSpace::srgb));
    CHECK(cloud.value(0, "rgb", 0) == 255);
    CHECK(cloud.value(0, "rgb", 1) == 1);
    CHECK(cloud.value(0, "rgb", 2) == 0);
    CHECK(cloud.value(0, "alpha") == 77);
    CHECK(cloud.surfels[0].albedo.x == 1);
    CHECK(static_cast<double>(cloud.surfels[0].albedo.y) == Approx(1 / 255.0 / 12.92));
  }
  CHECK(read("ushort", "red green blue", "65535 1 0").channel("rgb").type == ChannelType::u16);
  // Floats lose nothing as albedo; r, g and b of floats may be anything.
  CHECK(read("float", "red green blue", "1 0.5 0").names().empty());
  const Cloud other = read("float", "r g b", "1.5 -2 0");
  CHECK(other.names() == "r g b");
  CHECK_FALSE(other.info.has_albedo);
  // Colours of several types cannot be one channel.
  const Cloud mixed = read_cloud(scratch.file(
      "b.ply", one_point(std::string(kXyz) +
                             "property uchar red\nproperty uchar green\nproperty char blue\n",
                         "0 0 0 255 0 127")));
  CHECK(mixed.names() == "red green blue");
  CHECK(mixed.info.has_albedo);
  CHECK(mixed.surfels[0].albedo.x == 1);
}

TEST_CASE("ply: lists of vertices and other elements are left out with a note", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string elements = "element vertex 2\nproperty uchar a\nproperty list uchar short l\n" +
                               std::string(kXyz) +
                               "property int b\nelement edge 1\nproperty int v\nelement face 1\n"
                               "property list uchar int i\nelement none 0\nproperty int v\n";
  const std::string text = header("ascii", elements) + "1 2 7 8 1 2 3 -4\n5 0 6 7 8 -9\n0\n1 0\n";
  const std::string binary = header("binary_little_endian", elements) + "\x01\x02" +
                             raw<std::int16_t>(7) + raw<std::int16_t>(8) + raw(1.0F) + raw(2.0F) +
                             raw(3.0F) + raw(-4) + "\x05" + std::string(1, '\0') + raw(6.0F) +
                             raw(7.0F) + raw(8.0F) + raw(-9) + raw(0) + "\x01" + raw(0);
  for (const std::string& bytes : {text, binary}) {
    const Cloud cloud = read_cloud(scratch.file("a.ply", bytes));
    CHECK(cloud.notes() ==
          "The property 'l' is a list and is left out.\n"
          "The element 'edge' with 1 records is left out.");
    CHECK(cloud.names() == "a b");
    REQUIRE(cloud.surfels.size() == 2);
    CHECK(cloud.surfels[0].position == glm::dvec3(1, 2, 3));
    CHECK(cloud.surfels[1].position == glm::dvec3(6, 7, 8));
    CHECK(cloud.value(0, "b") == -4);
    CHECK(cloud.value(1, "a") == 5);
    CHECK(cloud.value(1, "b") == -9);
  }
}

TEST_CASE("points: a file counts as a cloud by its ending and its header", "[io][points]") {
  const test::TemporaryDirectory scratch;
  CHECK(is_point_file(scratch.file("a.ply", one_point(kXyz, "1 2 3"))));
  const auto mesh = [&](const char* element) {
    return scratch.file("b.ply",
                        header("ascii", "element vertex 3\n" + std::string(kXyz) + element +
                                            "property list uchar int vertex_indices\n") +
                            "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  };
  CHECK_FALSE(is_point_file(mesh("element face 1\n")));
  CHECK_FALSE(is_point_file(mesh("element tristrips 1\n")));
  CHECK(is_point_file(mesh("element face 0\n")));
  CHECK(is_point_file("none.xyz"));
  CHECK(is_point_file("none.TXT"));
  CHECK_FALSE(is_point_file("none.obj"));
  CHECK_THROWS_AS(static_cast<void>(is_point_file(scratch.file("c.ply", "no"))), DataError);
  CHECK_THROWS_AS(static_cast<void>(is_point_file("none.ply")), std::system_error);
  CHECK_THROWS_AS(static_cast<void>(open_points(scratch.file("d.obj", "v 0 0 0\n"))), DataError);
}
