// Real LAS and LAZ files: the points are those that LASzip finds.
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <sstream>

#include <catch2/catch.hpp>

#include "engine/io/cloud/formats.h"
#include "tests/io/las_files.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

std::optional<std::filesystem::path> data_or_skip() {
  auto data = shared_data();
  if (!data) WARN("skipped: the folder of real files is not on this machine");
  return data;
}

// What a line of expected-laszip-3.5.1.txt says about a file.
struct Expected {
  std::size_t points = 0;
  std::array<double, 6> bounds{};  // low x y z, high x y z
};

// Returns the numbers behind a word of a line.
template <std::size_t kCount>
std::array<double, kCount> numbers_behind(const std::string& line, const std::string& word) {
  std::istringstream in(line.substr(line.find(word) + word.size()));
  std::array<double, kCount> numbers{};
  for (double& number : numbers) in >> number;
  return numbers;
}

// Returns the lines about files that LASzip reads whole, by name.
std::map<std::string, Expected> read_expected(const std::filesystem::path& path) {
  std::map<std::string, Expected> files;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#") || line.starts_with("ERR")) continue;
    Expected expected;
    expected.points = static_cast<std::size_t>(numbers_behind<1>(line, " read=")[0]);
    const bool is_whole = numbers_behind<1>(line, " n=")[0] == numbers_behind<1>(line, " read=")[0];
    const auto low = numbers_behind<3>(line, "] min ");
    const auto high = numbers_behind<3>(line, " max ");
    std::ranges::copy(low, expected.bounds.begin());
    std::ranges::copy(high, expected.bounds.begin() + 3);
    if (is_whole) files[line.substr(0, line.find(": "))] = expected;
  }
  return files;
}

// Reads a file and returns the number and the bounds of its points.
Expected measure(const std::filesystem::path& path) {
  PointFile file = open_las(path);
  Bounds bounds;
  Expected found;
  std::vector<Surfel> block(4096);
  while (const std::size_t count = file.source->next(block)) {
    found.points += count;
    for (const Surfel& s : std::span(block).first(count)) bounds.add(s.position);
  }
  if (found.points > 0) {
    found.bounds = {bounds.low.x,  bounds.low.y,  bounds.low.z,
                    bounds.high.x, bounds.high.y, bounds.high.z};
  }
  return found;
}

}  // namespace

TEST_CASE("real LAS files: odd ones have the points and bounds that LASzip finds",
          "[io][las][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const auto folder = *data / "odd/las-laz";
  const auto files = read_expected(folder / "expected-laszip-3.5.1.txt");
  CHECK(files.size() > 35);
  for (const auto& [name, expected] : files) {
    INFO(name);
    if (name.find("laszip-compressor-version-1") != std::string::npos) {
      CHECK_THAT(refusal([&] { static_cast<void>(measure(folder / name)); }),
                 Contains("item POINT10 of version 1 is not supported"));
      continue;
    }
    const Expected found = measure(folder / name);
    CHECK(found.points == expected.points);
    for (std::size_t i = 0; expected.points > 0 && i < 6; ++i)
      CHECK(std::abs(found.bounds[i] - expected.bounds[i]) < 0.000501);
  }
  CHECK_THAT(
      refusal([&] { static_cast<void>(measure(folder / "PDAL__1.2-with-color-clipped.las")); }),
      Contains("the header counts 1065 points of 34 bytes, but only 1064 lie"));
}

TEST_CASE("real LAS files: a LAS file and the LAZ file made of it are the same",
          "[io][las][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const auto compare = [&](const std::string& one, const std::string& other) {
    INFO(one);
    const auto las = test::read_las(*data / one);
    const auto laz = test::read_las(*data / other);
    REQUIRE(las.surfels.size() == laz.surfels.size());
    CHECK(las.surfels.size() > 0);
    CHECK((las.rows == laz.rows));
    for (std::size_t i = 0; i < las.surfels.size(); ++i) {
      REQUIRE(las.surfels[i].position == laz.surfels[i].position);
      REQUIRE(las.surfels[i].albedo == laz.surfels[i].albedo);
    }
    return las.info;
  };
  const PointFileInfo info = compare("points/autzen_trim.las", "points/autzen_trim.laz");
  CHECK(info.count == 110'000);
  CHECK(info.text.at("metres_per_unit") == "0.3048");
  CHECK(info.text.at("crs").starts_with("PROJCS["));
  for (const std::string name : {"pdrf10-1.4", "pdrf10-1.5", "pdrf5-1.3", "pdrf9-1.4"}) {
    const std::string path = "odd/las-laz/loaders.gl__" + name;
    compare(path + ".las", path + ".laz");
  }
}

TEST_CASE("real LAS files: the number of points is what their sources say", "[io][las][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const std::map<std::string, std::size_t> expected = {{"ahn3_cropped_1.laz", 640'510},
                                                       {"lion_takanawa.copc.laz", 341'989},
                                                       {"pine_plot.laz", 114'024}};
  for (const auto& [name, count] : expected) {
    INFO(name);
    CHECK(measure(*data / "points" / name).points == count);
  }
}
