// Real E57 files: known counts are found, pairs agree, odd files are read or refused.
#include <cmath>
#include <map>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "tests/io/e57_file.h"
#include "tests/io/files.h"

using namespace ptc;
using test::Cloud;
using test::read_e57;

namespace {

std::optional<std::filesystem::path> data_or_skip() {
  auto data = shared_data();
  if (!data) WARN("skipped: the folder of real files is not on this machine");
  return data;
}

double distance(const glm::dvec3& a, const glm::dvec3& b) {
  return glm::length(a - b);
}

}  // namespace

TEST_CASE("real e57: doubles and integers of 21 bits give the same bunny", "[io][e57][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const Cloud doubles = read_e57(*data / "points/bunnyDouble.e57", 1000);
  const Cloud integers = read_e57(*data / "points/bunnyInt21.e57", 999);
  REQUIRE(doubles.surfels.size() == 30'571);
  REQUIRE(integers.surfels.size() == 30'571);
  double most = 0;
  for (std::size_t i = 0; i < 30'571; ++i) {
    const glm::dvec3 off = doubles.surfels[i].position - integers.surfels[i].position;
    most = std::max({most, std::abs(off.x), std::abs(off.y), std::abs(off.z)});
  }
  CHECK(most <= 0.5000001e-6);  // the scale of the integers is 1e-6
  CHECK(doubles.info.channels.empty());
  CHECK(doubles.left_out == 0);
}

TEST_CASE("real e57: colours and spherical coordinates are read", "[io][e57][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const Cloud coloured = read_e57(*data / "points/tinyCartesianFloatRgb.e57");
  REQUIRE(coloured.surfels.size() == 2'090);
  CHECK(coloured.info.has_albedo);
  CHECK(coloured.channel("rgb").type == ChannelType::u8);
  for (const Surfel& surfel : coloured.surfels) {  // the bounds that the file states
    CHECK((surfel.position.x >= -9.7795295715332031 && surfel.position.x <= -6.774238109588623));
    CHECK((surfel.position.z >= 295.52468872070312 && surfel.position.z <= 298.53216552734375));
  }
  const Cloud spherical = read_e57(*data / "points/tiny_spherical.e57");
  CHECK(spherical.info.count == 360);
  REQUIRE(spherical.surfels.size() == 180);  // the others are marked as invalid
  for (const Surfel& surfel : spherical.surfels) {
    CHECK(distance(surfel.position, {}) == Approx(distance(spherical.surfels[0].position, {})));
  }
  CHECK(spherical.info.scanners.size() == 1);
}

TEST_CASE("real e57: odd files have the points that their sources say, or are refused",
          "[io][e57][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const std::map<std::string, std::size_t> expected = {
      {"PDAL__A_B.e57", 6},
      {"PDAL__A_B_different_dims.e57", 2},
      {"PDAL__A_merged_B.e57", 6},
      {"PDAL__B2.e57", 2},
      {"cry-inc-e57__empty.e57", 0},
      {"cry-inc-e57__no_ext_namespace.e57", 1},
      {"cry-inc-e57__scaled_integer_intensity.e57", 2},
      {"cry-inc-e57__tiny_pc_and_images.e57", 2},
      {"pye57__testWithNormals.e57", 2},
      {"pye57__translationWithoutRotation.e57", 4}};
  for (const auto& [name, count] : expected) {
    INFO(name);
    const Cloud cloud = read_e57(*data / "odd/e57" / name);
    CHECK(cloud.surfels.size() + cloud.left_out == count);
    CHECK(cloud.info.count == count);
  }
  const Cloud moved = read_e57(*data / "odd/e57/pye57__translationWithoutRotation.e57");
  CHECK(moved.surfels[0].position.z == 6);
  CHECK(moved.info.scanners == std::vector<glm::dvec3>{{4, 5, 6}});
  CHECK(read_e57(*data / "odd/e57/pye57__testWithNormals.e57").info.has_normals);
  const std::string text =
      refusal([&] { static_cast<void>(read_e57(*data / "odd/e57/cry-inc-e57__corrupt_crc.e57")); });
  CHECK(text.find("the checksum of the page is wrong") != std::string::npos);
}
