// Clouds from XYZ text.
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>
#include <zlib.h>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "tests/io/clouds.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;

namespace {

std::vector<Surfel> read_all(const std::filesystem::path& path, std::size_t block = 2) {
  PointFile file = open_points(path);
  std::vector<Surfel> all;
  std::vector<Surfel> some(block);
  while (const std::size_t count = file.source->next(some)) {
    all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return all;
}

std::string fault(const test::TemporaryDirectory& scratch, const std::string& text) {
  const auto path = scratch.file("a.xyz", text);
  return refusal([&] { static_cast<void>(read_all(path)); });
}

}  // namespace

TEST_CASE("xyz: lines of 3, 6, 7 and 10 values are read", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto info = [&](const std::string& text) {
    return open_points(scratch.file("a.xyz", text)).info;
  };
  CHECK_FALSE(info("1 2 3").count.has_value());
  CHECK_FALSE(info("1 2 3").has_normals);
  CHECK((info("1 2 3 0 0 1").has_normals && !info("1 2 3 0 0 1").has_radius));
  CHECK((info("1 2 3 0 0 1 4").has_radius && !info("1 2 3 0 0 1 4").has_radiance));
  CHECK(info("1 2 3 0 0 1 4 5 6 7").has_radiance);
  const auto surfels = read_all(scratch.file(
      "a.xyz",
      "# a comment\n\n 10000000.001\t2 3  0 0 -2 4 5 6 7 # here too\r\n+1 .5 1e1 1 0 0 0 0 0 0"));
  REQUIRE(surfels.size() == 2);
  CHECK(surfels[0].position == glm::dvec3(10000000.001, 2, 3));
  CHECK(surfels[0].normal == glm::vec3(0, 0, -1));
  CHECK(surfels[0].radius == 4);
  CHECK(surfels[0].radiance == glm::vec3(5, 6, 7));
  CHECK(surfels[0].albedo == glm::vec3(0.5F));
  CHECK(surfels[1].position == glm::dvec3(1, 0.5, 10));
}

TEST_CASE("xyz: a file without points gives none", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const char* text : {"", "\n\n", "# nothing"}) {
    CHECK(read_all(scratch.file("a.xyz", text)).empty());
  }
}

TEST_CASE("xyz: an invalid line is reported by its number", "[io][points]") {
  const test::TemporaryDirectory scratch;
  CHECK_THAT(fault(scratch, "1 2\n"),
             EndsWith("line 1: 2 values, but lines of XYZ have at least x, y and z"));
  CHECK_THAT(fault(scratch, "1 2 3\n\n1 2 3 0 0 1\n"),
             EndsWith("line 3: 6 values, but the first line has 3"));
  CHECK_THAT(fault(scratch, "1 2 3 4 5\n1 2 3 4"),
             EndsWith("line 2: 4 values, but the first line has 5"));
  CHECK_THAT(fault(scratch, "x y z\n1 2 3 4\n"),
             EndsWith("line 2: 4 values, but the line of names has 3"));
  std::string wide;
  for (int i = 0; i < 257; ++i) wide += "1 ";
  CHECK_THAT(fault(scratch, wide), EndsWith("line 1: the line has more than 256 values"));
  CHECK_THAT(fault(scratch, "1 2 z\n"), EndsWith("line 1: column 3: 'z' is not a number"));
  CHECK_THAT(fault(scratch, "1 2 3\nX Y Z\n"), EndsWith("line 2: column 1: 'X' is not a number"));
  CHECK_THAT(fault(scratch, "X Y A\n1 2 3\n"),
             EndsWith("line 1: the line has neither values nor names with x, y and z"));
  CHECK_THAT(fault(scratch, "x y z\nx y z\n1 2 3\n"),
             EndsWith("line 2: column 1: 'x' is not a number"));
  CHECK_THAT(fault(scratch, "1,,3\n"), EndsWith("line 1: column 2: a value is missing"));
  CHECK_THAT(fault(scratch, "1 2 3 4\n1 2 3 four\n"),
             EndsWith("line 2: column 4: 'four' is not a number"));
  CHECK_THAT(fault(scratch, "1,2,3,4\n1,2,3,\n"),
             EndsWith("line 2: 3 values, but the first line has 4"));
  CHECK_THAT(fault(scratch, "1 2 inf\n"), EndsWith("line 1: point 0: the position is not finite"));
  CHECK_THAT(
      fault(scratch, "1 2 3 0 0 1 -4\n"),
      EndsWith("point 0: the radius is negative, not a number or beyond the range of float"));
  CHECK_THAT(
      fault(scratch, "1 2 3 0 0 1 4 1 1 -1\n"),
      EndsWith("point 0: the radiance is negative, not a number or beyond the range of float"));
}

TEST_CASE("xyz: decimal commas are refused by name", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const char* text :
       {"1,5;2,5;3,5\n", "1;2;3,5\n", "x;y;z\n1;2;3,5\n", "1,5 2,5 3,5\n", "1,5\t2,5\t3,5\n",
        "x y z\n1,5 2,5 3,5\n", "x;y;z;label\n1,5;2,5;3,5;tree\n", "x;y;z;i\n1;2;3;4,5\n",
        "x,y,z\n\"1,5\",\"2\",\"3\"\n"}) {
    INFO(text);
    CHECK_THAT(fault(scratch, text), Contains(": numbers with a decimal comma are not read"));
  }
}

TEST_CASE("xyz: columns of text are left out and named", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto check = [&](const std::string& text, const std::string& note) {
    INFO(text);
    const auto path = scratch.file("a.csv", text);
    const PointFileInfo info = open_points(path).info;
    REQUIRE_FALSE(info.notes.empty());
    CHECK(info.notes.front() == note);
    REQUIRE(info.channels.size() == 1);
    CHECK(info.channels[0].name == "intensity");
    const auto surfels = read_all(path);
    REQUIRE(surfels.size() == 2);
    CHECK(surfels[1].position == glm::dvec3(4, 5, 6));
  };
  const std::string named = "Column 4, 'label', has no numbers and is left out.";
  const std::string last = "Column 5, 'label', has no numbers and is left out.";
  check("x,y,z,label,i\n1,2,3,tree,7\n4,5,6,house,8\n", named);
  check("x;y;z;label;i\r\n1;2;3;tree;7\r\n4;5;6;;8\r\n", named);
  check("\xEF\xBB\xBFx,y,z,label,i\n1,2,3,\"a, b\",7\n4,5,6,\"c; d\",8\n", named);
  check("x,y,z,i,label\n1,2,3,7,tree\n4,5,6,8,\n", last);
  check("x,y,z,i,label\n1,2,3,7,\n4,5,6,8,tree\n", last);
  check("# x y z label i\n1 2 3 tree 7\n4 5 6 \"big house\" 8\n", named);
  check("x,y,z,label,i\n\"1\",\"2\",\"3\",\"tree\",\"7\"\n\"4\",\"5\",\"6\",\"house\",\"8\"\n",
        named);
  check("1 2 3 tree 7\n4 5 6 house 8\n", "Column 4 has no numbers and is left out.");
}

TEST_CASE("xyz: separators and comments of many programs are read", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const char* text :
       {"1 2.5 -3\n4 5 6\n", "1,2.5,-3\n4,5,6\n", "1;2.5;-3\n4;5;6\n", "1\t2.5\t-3\r\n4\t5\t6",
        " 1 , 2.5 , -3 \n4 , 5,6,\n", "// a\n1 2.5 -3 // b\n#\n4 5 6 # c d e\n",
        "X,Y,Z\n1,2.5,-3\n4,5,6", "\"X\",\"Y\",\"Z\"\n1 2.5 -3\n4 5 6\n",
        "\xEF\xBB\xBFx;y;z\n1;2.5;-3\n4;5;6\n", "//X Y Z\n1 2.5 -3\n4 5 6\n"}) {
    INFO(text);
    for (const char* name : {"a.xyz", "a.csv", "a.asc", "a.txt"}) {
      const Cloud cloud = read_cloud(scratch.file(name, text));
      REQUIRE(cloud.surfels.size() == 2);
      CHECK(cloud.surfels[0].position == glm::dvec3(1, 2.5, -3));
      CHECK(cloud.surfels[1].position == glm::dvec3(4, 5, 6));
      CHECK(cloud.info.channels.empty());
    }
  }
}

TEST_CASE("xyz: names decide what the columns are", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto read = [&](const std::string& text) {
    return read_cloud(scratch.file("a.txt", text));
  };
  const Cloud compare =
      read("//X Y Z R G B Intensity Nx Ny Nz\n1 2 3 255 0 1 -7.5 0 0 2\n4 5 6 0 0 0 1 0 0 0\n");
  CHECK(compare.names() == "rgb intensity");
  CHECK(compare.value(0, "rgb", 0) == 255);
  CHECK(compare.value(0, "rgb", 2) == 1);
  CHECK(compare.channel("rgb").type == ChannelType::u8);
  CHECK(compare.value(0, "intensity") == -7.5);
  CHECK(compare.channel("intensity").type == ChannelType::f64);
  CHECK(compare.surfels[0].normal == glm::vec3(0, 0, 1));
  CHECK(compare.surfels[1].normal == glm::vec3(0));
  CHECK(compare.surfels[0].albedo.x == 1);
  const Cloud csv = read("intensity,z,y,x,GPS Time\n9,3,2,1,1e9\n");
  CHECK(csv.names() == "intensity gps_time");
  CHECK(csv.surfels[0].position == glm::dvec3(1, 2, 3));
  CHECK(csv.value(0, "gps_time") == 1e9);
  // A comment that does not fit the values is only a comment.
  CHECK(read("# x y z\n1 2 3 0 0 1\n").info.has_normals);
  CHECK(read("# x y z q\n1 2 3 9\n").names() == "q");
  // A name that occurs twice is one of the surfel, then a channel.
  CHECK(read("x y z x\n1 2 3 9\n").value(0, "x") == 9);
  const Cloud wide = read("x y z r g b\n1 2 3 65535 0 256\n");
  CHECK(wide.channel("rgb").type == ChannelType::u16);
  CHECK(wide.surfels[0].albedo.x == 1);
  CHECK(wide.notes() == "Colours are taken as 16-bit values, because some exceed 255.");
  const Cloud shares = read("x y z Rf Gf Bf\n1 2 3 1 0.5 0\n");
  CHECK(static_cast<double>(shares.surfels[0].albedo.y) ==
        Approx(std::pow((0.5 + 0.055) / 1.055, 2.4)));
  CHECK(shares.channel("rgb").colour_space == ColourSpace::srgb);
  const Cloud linear = read("x y z r g b\n1 2 3 1 0.5 0\n");
  CHECK(linear.surfels[0].albedo.y == 0.5F);
  const Cloud strange = read("x y z r g b\n1 2 3 1000000 -0.5 0\n");
  CHECK_FALSE(strange.info.has_albedo);
  CHECK(strange.value(0, "red") == 1000000);
}

TEST_CASE("xyz: without names the number of columns and their values decide", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto read = [&](const std::string& text) {
    return read_cloud(scratch.file("a.xyz", text));
  };
  const auto has_note = [](const Cloud& cloud, const std::string& text) {
    return cloud.notes() == "The file does not name its columns; " + text;
  };
  const Cloud four = read("1 2 3 0.5\n");
  CHECK(four.value(0, "intensity") == 0.5);
  CHECK(has_note(four, "the fourth is taken as intensity."));
  const Cloud five = read("1 2 3 4 5\n");
  CHECK(five.names() == "column_4 column_5");
  CHECK(five.value(0, "column_5") == 5);
  CHECK(has_note(five, "columns 4 to 5 are kept as numbers without a meaning."));
  // Six columns: the length of what may be a normal is within 2 % of 1, or not.
  CHECK(read("1 2 3 0 0.99 0\n").info.has_normals);
  CHECK(read("1 2 3 0 1 0\n1 2 3 0 0 0\n").surfels[1].normal == glm::vec3(0));
  const Cloud colours = read("1 2 3 0 1 0\n1 2 3 255 128 0\n");
  CHECK_FALSE(colours.info.has_normals);
  CHECK(colours.value(1, "rgb", 0) == 255);
  CHECK(has_note(
      colours, "columns 4 to 6 are taken as 8-bit colours, because they are integers up to 255."));
  CHECK(read("1 2 3 0 0.5 2.5\n").info.has_normals);
  CHECK(read("1 2 3 256 0 0\n").info.has_normals);
  CHECK(has_note(read("1 2 3 0 0 1\n"), "columns 4 to 6 are taken as normals."));
  CHECK(read_cloud(scratch.file("a.xyzn", "1 2 3 255 128 0\n")).info.has_normals);
  // Seven: a radius as ever, unless the values are those of intensity and colours.
  CHECK(read("1 2 3 0 0 1 4\n").info.has_radius);
  CHECK(read("1 2 3 0.5 0.5 0.5 4\n").info.has_radius);
  const Cloud semantic = read("1 2 3 -1024 255 0 7\n");
  CHECK(semantic.value(0, "intensity") == -1024);
  CHECK(semantic.value(0, "rgb", 2) == 7);
  // Nine: colours and normals in either order.
  for (const char* text : {"1 2 3 255 0 7 0 0 1\n", "1 2 3 0 0 1 255 0 7\n"}) {
    const Cloud nine = read(text);
    CHECK(nine.surfels[0].normal == glm::vec3(0, 0, 1));
    CHECK(nine.value(0, "rgb", 0) == 255);
  }
  CHECK(read("1 2 3 4 5 6 7 8 9\n").names() ==
        "column_4 column_5 column_6 column_7 column_8 column_9");
  CHECK(read("1 2 3 4 5 6 7 8 9 10 11\n").value(0, "column_11") == 11);
}

TEST_CASE("xyz: a colour that does not fit the first lines is refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  std::string text = "x y z r g b\n";
  for (int i = 0; i < 100; ++i) text += "1 2 3 4 5 6\n";
  CHECK_THAT(
      fault(scratch, text + "1 2 3 4 5 256\n"),
      EndsWith("line 102: the colour is not an integer of 8 bits, as those of the first lines"));
  CHECK(fault(scratch, text + "1 2 3 4 5 255\n").empty());
}

TEST_CASE("xyz: a point with a NaN is left out, in gzip files, too", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const Cloud cloud = read_cloud(scratch.file("a.xyz", "nan 0 0 1\n1 2 3 4\n0 0 NaN 5\n"));
  CHECK(cloud.left_out == 2);
  REQUIRE(cloud.surfels.size() == 1);
  CHECK(cloud.value(0, "intensity") == 4);
  const auto path = scratch.path() / "b.csv.gz";
  gzFile file = gzopen(path.c_str(), "wb");
  gzputs(file, "x,y,z\n1,2,3\n");
  gzclose(file);
  CHECK(read_cloud(path).surfels.at(0).position == glm::dvec3(1, 2, 3));
}

TEST_CASE("xyz: every truncation gives points or a refusal that names the file", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = "0.5 1.5 2.5 0 0 1 0.25\n1 2 3 1 0 0 4\n";
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::string text = fault(scratch, whole.substr(0, size));
    CHECK((text.empty() || text.starts_with((scratch.path() / "a.xyz").string())));
  }
}

TEST_CASE("xyz: a line longer than the buffer is read, one above 64 MiB is refused",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string blanks(700'000, ' ');
  CHECK(read_all(scratch.file("a.xyz", "1 2" + blanks + "3\n4 5 6\n")).size() == 2);
  CHECK_THAT(fault(scratch, std::string((std::size_t{1} << 26) + 10, ' ') + "1 2 3\n"),
             EndsWith("a line or record has more than 64 MiB"));
}
