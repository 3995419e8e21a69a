// Meshes from OFF.
#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::EndsWith;

namespace {

const std::string kBody = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";

MeshFile read(const test::TemporaryDirectory& scratch, const std::string& text) {
  return read_mesh(scratch.file("a.off", text));
}

std::string fault(const test::TemporaryDirectory& scratch, const std::string& text) {
  return refusal([&] { static_cast<void>(read(scratch, text)); });
}

}  // namespace

TEST_CASE("off: all forms of the header give the same square", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  for (const char* header :
       {"OFF\n4 1 0\n", "OFF 4 1 0\n", "OFF4 1 0\n", "4 1 0\n", "OFF # comment\n\n4 1\n",
        "# first\nOFF\r\n# second\n4 1 0 # third\n", "COFF\n4 1 4\n"}) {
    const Mesh mesh = read(scratch, header + kBody).mesh;
    CHECK(mesh.positions.size() == 4);
    CHECK(mesh.triangles.size() == 2);
    CHECK(mesh.normals.empty());
    CHECK(mesh.uvs.empty());
  }
}

TEST_CASE("off: normals and texture coordinates are found before and after the colours",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Mesh mesh =
      read(scratch,
           "STCNOFF\n3 1 0\n0 0 0 0 0 2 255 0 0 255 0.1 0.2\n"
           "1 0 0 0 0 2 255 0 0 0.3 0.4\n0 1 0 0 2 0 1 1 1 1 0.5 0.6\n3 0 1 2 255 0 0\n")
          .mesh;
  REQUIRE(mesh.normals.size() == 3);
  CHECK(mesh.normals[0] == glm::vec3(0, 0, 1));
  CHECK(mesh.normals[2] == glm::vec3(0, 1, 0));
  REQUIRE(mesh.uvs.size() == 3);
  CHECK(mesh.uvs[1] == glm::vec2(0.3F, 0.4F));
}

TEST_CASE("off: files that break a rule are refused by line", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  CHECK_THAT(fault(scratch, "OFF BINARY\n"), EndsWith("line 1: binary OFF is not supported"));
  CHECK_THAT(fault(scratch, "4OFF\n"), EndsWith("line 1: this kind of OFF is not supported"));
  CHECK_THAT(fault(scratch, "OFF\nx\n"),
             EndsWith("line 2: the numbers of vertices and faces are missing"));
  CHECK_THAT(fault(scratch, "OFF\n-4 1 0\n" + kBody),
             EndsWith("the numbers of vertices and faces are missing"));
  CHECK_THAT(fault(scratch, "OFF\n353535235358 6 0\n" + kBody),
             EndsWith("line 2: the header counts more vertices or faces than the file can hold"));
  CHECK_THAT(fault(scratch, "OFF\n4 9999999999 0\n" + kBody),
             EndsWith("line 2: the header counts more vertices or faces than the file can hold"));
  CHECK_THAT(fault(scratch, "OFF\n1 0 0\n0 0\n   \n"),
             EndsWith("line 3: the vertex has too few values"));
  CHECK_THAT(fault(scratch, "OFF\n1 0 0\n0 0 zero\n"), EndsWith("line 3: a value is not a number"));
  CHECK_THAT(fault(scratch, "OFF\n4 2 0\n" + kBody), EndsWith("the file ends too early"));
  CHECK_THAT(fault(scratch, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
             EndsWith("line 6: an index refers to no vertex"));
  CHECK_THAT(fault(scratch, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n"),
             EndsWith("line 6: the face has fewer corners than it declares"));
  CHECK_THAT(fault(scratch, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n"),
             EndsWith("line 6: a face must begin with its number of corners"));
  CHECK_THAT(fault(scratch, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 inf 0\n3 0 1 2\n"),
             EndsWith("vertex 2: the position is not finite"));
}

TEST_CASE("off: every truncation is refused, except inside the last word", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = "OFF\n4 1 0\n" + kBody;
  for (std::size_t size = 0; size < whole.size() - 1; ++size) {
    CHECK_FALSE(fault(scratch, whole.substr(0, size)).empty());
  }
}
