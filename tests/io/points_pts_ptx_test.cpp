// Clouds from PTS and scans from PTX.
#include <catch2/catch.hpp>
#include <zlib.h>

#include "tests/io/clouds.h"

using namespace ptc;
using Catch::Matchers::EndsWith;

namespace {

// A header of PTX: the size of the grid, the place of the scanner, axes, and a quarter turn about z
// with a move.
std::string ptx_header(int columns, int rows) {
  return std::to_string(columns) + "\n" + std::to_string(rows) +
         "\n10 20 30\n1 0 0\n0 1 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n100 200 300 1\n";
}

}  // namespace

TEST_CASE("pts: lines of 3, 4, 6 and 7 values are read, from all blocks", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto read = [&](const std::string& text) {
    return read_cloud(scratch.file("a.pts", text));
  };
  const Cloud full =
      read("2\n1.5 2 3 -2048 255 0 1\n4 5 6 2047 0 0 0\r\n\n0\n1\n7 8 9 0.5 1 2 3\n");
  CHECK(full.names() == "rgb intensity");
  REQUIRE(full.surfels.size() == 3);
  CHECK_FALSE(full.info.count.has_value());
  CHECK(full.info.text.at("up") == "z");
  CHECK(full.surfels[0].position == glm::dvec3(1.5, 2, 3));
  CHECK(full.surfels[0].albedo.x == 1);
  CHECK(full.value(0, "intensity") == -2048);
  CHECK(full.value(1, "intensity") == 2047);
  CHECK(full.value(2, "intensity") == 0.5);
  CHECK(full.value(2, "rgb", 1) == 2);
  CHECK(read("1\n1 2 3\n").names().empty());
  CHECK(read("1\n1 2 3 4\n").names() == "intensity");
  CHECK(read("1\n1 2 3 4 5 6\n").names() == "rgb");
  CHECK(read("0\n").surfels.empty());
  CHECK(read("").surfels.empty());
  // Without a count it is XYZ under another name.
  CHECK(read("1 2 3\n4 5 6\n").surfels.size() == 2);
}

TEST_CASE("pts: an invalid block is reported by its line", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto fault = [&](const std::string& text) { return cloud_fault(scratch, "a.pts", text); };
  CHECK(fault("2\n1 2 3\n") ==
        "line 2: the file ends too early: 1 points of the block are missing");
  CHECK(fault("1\n1 2 3\n4 5 6\n") ==
        "line 3: a block of PTS must begin with the number of its points, alone on a line");
  CHECK(fault("-1\n1 2 3\n").starts_with("line 1: a block of PTS must begin"));
  CHECK(fault("1\n1 2 3 4 5\n") == "line 2: 5 values, but lines of PTS have 3, 4, 6 or 7");
  CHECK(fault("2\n1 2 3\n1 2 3 4\n") == "line 3: the line has more values than the first");
  CHECK(fault("2\n1 2 3 4\n1 2 3\n") == "line 3: the line has fewer values than the first");
  CHECK(fault("1\n1 b 3\n") == "line 2: the value of y is not a number");
  CHECK(fault("1\n1 2 3 4 5 6 256\n") == "line 2: the value of blue is not an integer up to 255");
  CHECK(fault("1\n1 2 inf\n") == "line 2: point 0: the position is not finite");
  CHECK(fault("9223372036854775807\n1 2 3\n").starts_with("line 2: the file ends too early"));
}

TEST_CASE("pts: every file that ends within a point is refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = "2\n1 2 3 4 5 6 7\n1 2 3 4 5 6 7\n";
  for (std::size_t size = 2; size + 2 < whole.size(); ++size) {
    INFO(size);
    CHECK_FALSE(cloud_fault(scratch, "a.pts", whole.substr(0, size)).empty());
  }
  CHECK(cloud_fault(scratch, "a.pts", whole.substr(0, whole.size() - 1)).empty());
}

TEST_CASE("ptx: points are placed by the matrix of their scan", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string text = ptx_header(2, 3) +
                           "1 2 3 0.25 255 0 1\n4 5 6 0.5 0 0 0\n0 0 0 0.5 0 0 0\n"
                           "7 8 9 1 1 2 3\n0 0 0 0 0 0 0\n1 0 0 0 9 9 9\n" +
                           "\n1\r\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
                           "5 6 7 1\n1 1 1 0.125\n";
  const auto path = scratch.path() / "b.ptx.gz";
  gzFile file = gzopen(path.c_str(), "wb");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
  for (const auto& from : {scratch.file("a.ptx", text), scratch.file("unnamed", text), path}) {
    const Cloud cloud = read_cloud(from);
    CHECK(cloud.info.count == 7);
    CHECK(cloud.left_out == 2);
    REQUIRE(cloud.surfels.size() == 5);
    CHECK(cloud.names() == "rgb intensity scan row column");
    // x goes to y, y to -x.
    CHECK(cloud.surfels[0].position == glm::dvec3(98, 201, 303));
    CHECK(cloud.surfels[1].position == glm::dvec3(95, 204, 306));
    CHECK(cloud.surfels[4].position == glm::dvec3(6, 7, 8));
    CHECK(cloud.info.scanners ==
          std::vector<glm::dvec3>{glm::dvec3(10, 20, 30), glm::dvec3(5, 6, 7)});
    const std::vector<std::array<double, 3>> places = {
        {0, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 2, 1}, {1, 0, 0}};
    for (std::size_t i = 0; i < places.size(); ++i) {
      CHECK(cloud.value(i, "scan") == places[i][0]);
      CHECK(cloud.value(i, "row") == places[i][1]);
      CHECK(cloud.value(i, "column") == places[i][2]);
    }
    CHECK(cloud.value(0, "intensity") == 0.25);
    CHECK(cloud.value(2, "rgb", 2) == 3);
    CHECK(cloud.surfels[0].albedo.x == 1);
    CHECK(static_cast<double>(cloud.surfels[4].albedo.x) == Approx(0.5).margin(0.003));
    CHECK(cloud.notes() == "Scan 1 has no colours; its points are grey.");
    CHECK(cloud.info.text.at("up") == "z");
  }
}

TEST_CASE("ptx: scans without points and without colours are read", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const Cloud cloud =
      read_cloud(scratch.file("a.ptx", ptx_header(0, 5) + ptx_header(1, 1) + "1 2 3 0.5\n"));
  CHECK(cloud.names() == "intensity scan row column");
  CHECK(cloud.value(0, "scan") == 1);
  CHECK_FALSE(cloud.info.has_albedo);
  CHECK(cloud.info.scanners.size() == 2);
}

TEST_CASE("ptx: an invalid scan is reported by its line", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto fault = [&](const std::string& text) { return cloud_fault(scratch, "a.ptx", text); };
  const std::string good = ptx_header(1, 2);
  CHECK(fault("") == "the PTX file has no scan");
  CHECK(fault("a\n") ==
        "line 1: a scan must begin with its columns and rows, two lines of an integer");
  CHECK(fault("4294967296\n1\n").starts_with("line 1: a scan must begin"));
  CHECK(fault("1\n2\n0 0\n") == "line 3: a line in the header of a scan must have 3 values");
  CHECK(fault("1\n2\n0 0 nan\n") == "line 3: a value in the header of a scan is not finite");
  std::string projective = good;
  projective.replace(projective.find("0 1 0 0\n-1"), 7, "0 1 0 1");
  CHECK(fault(projective) == "line 7: the last column of the matrix of a scan must be 0 0 0 1");
  CHECK(fault(good + "1 2 3 4.0000000\n") ==
        "line 11: the file ends too early: 1 points of a scan are missing");
  CHECK(fault(good + "1 2 3.000\n4 5 6.0000\n") == "line 11: 3 values, but points have 4 or 7");
  CHECK(fault(good + "1 2 3 4\n1 2 3 4 5 6 7\n") ==
        "line 12: the point must have 4 values, as the first of its scan");
  CHECK(fault(good + "1 2 3 4 5 6 7 8\n\n") == "line 11: the line has too many values");
  CHECK(fault(good + "1 2 3 4 5 6 256\n0 0 0 0 0 0 0\n") ==
        "line 11: the colour is not an integer up to 255");
  CHECK(fault(good + "1 2 3 4\n1 2 inf 4\n") == "line 12: point 1: the position is not finite");
  CHECK(fault(ptx_header(100000, 100000) + "1 2 3 4\n") ==
        "line 10: the scan has 100000 x 100000 points, more than the file can hold");
}

TEST_CASE("ptx: every file that ends within a scan is refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = ptx_header(1, 2) + "1 2 3 4\n1 2 3 4\n";
  for (std::size_t size = 0; size + 1 < whole.size() - 1; ++size) {
    INFO(size);
    CHECK_FALSE(cloud_fault(scratch, "a.ptx", whole.substr(0, size)).empty());
  }
  CHECK(cloud_fault(scratch, "a.ptx", whole.substr(0, whole.size() - 1)).empty());
}
