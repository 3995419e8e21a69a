// Meshes from STL.
#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::EndsWith;

namespace {

const std::string kText =
    "solid a name\n facet normal 0 0 1\n  outer loop\n   vertex 10000000.001 0 0\n"
    "   vertex 10000000.003 0 0\n   vertex 10000000.001 1 0\n  endloop\n endfacet\n"
    "endsolid a name\n";

std::string binary() {
  std::string bytes = "solid of a binary file";
  bytes.resize(80, ' ');
  bytes += raw(2U);
  for (int i = 0; i < 2; ++i) {
    for (const int v : {0, 0, 1, 0, 0, i, 1, 0, i, 0, 1, i}) bytes += raw(static_cast<float>(v));
    bytes += raw(std::uint16_t{7});
  }
  return bytes;
}

std::string fault(const test::TemporaryDirectory& scratch, const std::string& bytes) {
  return refusal([&] { static_cast<void>(read_mesh(scratch.file("a.stl", bytes))); });
}

}  // namespace

TEST_CASE("stl: text and binary are distinguished by their size", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Mesh text = read_mesh(scratch.file("a.STL", kText)).mesh;
  REQUIRE(text.triangles.size() == 1);
  CHECK(text.origin == glm::dvec3(1e7, 1, 0));
  CHECK(static_cast<double>(text.positions[1].x) == Approx(0.003).epsilon(1e-6));
  const Mesh two = read_mesh(scratch.file("a.stl", binary())).mesh;
  CHECK(two.triangles.size() == 2);
  CHECK(two.bounds().high == glm::dvec3(1, 1, 1));
}

TEST_CASE("stl: files that break a rule are refused by line", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  CHECK_THAT(fault(scratch, "no\n"),
             EndsWith("line 1: the line does not begin with a keyword of STL"));
  CHECK_THAT(fault(scratch, "solid\nvertex 1 2\n"),
             EndsWith("line 2: the vertex does not have three numbers"));
  CHECK_THAT(fault(scratch, ""), EndsWith("no triangle"));
  std::string nan = kText;
  nan.replace(nan.find("10000000.003"), 12, "nan");
  CHECK_THAT(fault(scratch, nan), EndsWith("vertex 1: the position is not finite"));
}

TEST_CASE("stl: every truncation before the last line is refused", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  for (const std::string& whole : {kText, binary()}) {
    for (std::size_t size = 0; size < whole.size() - 8; ++size) {
      CHECK_FALSE(fault(scratch, whole.substr(0, size)).empty());
    }
  }
  CHECK_FALSE(fault(scratch, binary() + "x").empty());
}
