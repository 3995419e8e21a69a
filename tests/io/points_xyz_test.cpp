// Clouds from XYZ text.
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "tests/io/files.h"

using namespace ptc;
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
  CHECK_THAT(fault(scratch, "1 2 3 4\n"),
             EndsWith("line 1: 4 values, but lines of XYZ have 3, 6, 7 or 10"));
  CHECK_THAT(fault(scratch, "1 2 3\n\n1 2 3 0 0 1\n"),
             EndsWith("line 3: 6 values, but the first line has 3"));
  CHECK_THAT(fault(scratch, "1 2 3 4 5 6 7 8 9 0 1\n"),
             EndsWith("line 1: the line has more than 10 values"));
  CHECK_THAT(fault(scratch, "X Y Z\n1 2 3\n"), EndsWith("line 1: a value is not a number"));
  CHECK_THAT(fault(scratch, "1,2,3\n"), EndsWith("line 1: a value is not a number"));
  CHECK_THAT(fault(scratch, "#\n1 2 3 0 0 1\n1 2 3 0 0 0\n"),
             EndsWith("line 3: point 1: the normal has zero length"));
  CHECK_THAT(fault(scratch, "1 2 nan\n"), EndsWith("line 1: point 0: the position is not finite"));
  CHECK_THAT(
      fault(scratch, "1 2 3 0 0 1 -4\n"),
      EndsWith("point 0: the radius is negative, not a number or beyond the range of float"));
  CHECK_THAT(
      fault(scratch, "1 2 3 0 0 1 4 1 1 -1\n"),
      EndsWith("point 0: the radiance is negative, not a number or beyond the range of float"));
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
