// Meshes from PLY.
#include <catch2/catch.hpp>
#include <zlib.h>

#include "engine/base/error.h"
#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;

namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

std::string header(const std::string& format, const std::string& elements) {
  return "ply\nformat " + format + " 1.0\n" + elements + "end_header\n";
}

const std::string kVertices =
    "element vertex 4\nproperty double x\nproperty double y\nproperty double z\n";
const std::string kFaces = "element face 2\nproperty list uchar int vertex_indices\n";
const std::string kSquare = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

MeshFile read(const test::TemporaryDirectory& scratch, const std::string& bytes) {
  return read_mesh(scratch.file("a.ply", bytes));
}

}  // namespace

TEST_CASE("ply mesh: triangles and vertices are read as they are in the file", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Mesh mesh =
      read(scratch, header("ascii", kVertices + kFaces) + kSquare + "3 0 1 2\n3 0 2 3\n").mesh;
  CHECK(mesh.positions.size() == 4);
  CHECK(mesh.triangles == Triangles{{0, 1, 2}, {0, 2, 3}});
  CHECK(mesh.normals.empty());
  CHECK(mesh.uvs.empty());
  CHECK(mesh.material_of == std::vector<std::uint16_t>{0, 0});
  CHECK(mesh.materials.size() == 1);
  CHECK(mesh.bounds().low == glm::dvec3(0));
  CHECK(mesh.bounds().high == glm::dvec3(1, 1, 0));
}

TEST_CASE("ply mesh: colours of faces are left out and told", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  const MeshFile file = read(scratch, header("ascii", kVertices + kFaces + colours) + kSquare +
                                          "3 0 1 2 255 0 0\n3 0 2 3 0 255 0\n");
  CHECK(file.mesh.colours.empty());
  REQUIRE(file.warnings.size() == 1);
  CHECK_THAT(file.warnings[0], Contains("colours of faces are left out"));
}

TEST_CASE("ply mesh: faces may come before the vertices", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Mesh mesh =
      read(scratch, header("ascii", kFaces + kVertices) + "3 0 1 2\n3 0 2 3\n" + kSquare).mesh;
  CHECK(mesh.triangles == Triangles{{0, 1, 2}, {0, 2, 3}});
}

TEST_CASE("ply mesh: strips are cut into triangles, every second one turned over", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string strips =
      "element vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\n";
  const Mesh mesh = read(scratch, header("ascii", strips) +
                                      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n"
                                      "10 0 1 2 3 4 -1 2 1 3 -1\n")
                        .mesh;
  REQUIRE(mesh.triangles == Triangles{{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {2, 1, 3}});
  for (std::size_t i = 0; i < 4; ++i) {  // all of them face +z
    const auto& [a, b, c] = mesh.triangles[i];
    const glm::vec3 ab = mesh.positions[b] - mesh.positions[a];
    const glm::vec3 ac = mesh.positions[c] - mesh.positions[a];
    CHECK(ab.x * ac.y - ab.y * ac.x > 0);
  }
}

TEST_CASE("ply mesh: millimetres are kept ten million metres from the origin", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Mesh mesh = read(scratch, header("ascii", kVertices + kFaces) +
                                      "10000000.001 5000000.001 0\n10000000.004 5000000.001 0\n"
                                      "10000000.004 5000000.009 0\n10000000.001 5000000.009 0\n"
                                      "3 0 1 2\n3 0 2 3\n")
                        .mesh;
  CHECK(mesh.origin == glm::dvec3(10000000, 5000000, 0));
  CHECK(static_cast<double>(mesh.positions[1].x) == Approx(0.004).epsilon(1e-6));
  CHECK(static_cast<double>(mesh.positions[2].y) == Approx(0.009).epsilon(1e-6));
}

TEST_CASE("ply mesh: normals become unit, broken ones flat, texture coordinates stay",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string vertices =
      kVertices +
      "property float nx\nproperty float ny\nproperty float nz\nproperty float s\n"
      "property float t\n";
  const Mesh mesh = read(scratch, header("ascii", vertices + kFaces) +
                                      "0 0 0 0 3 4 0 0\n1 0 0 0 0 9 1 0\n1 1 0 0 0 1 1 1\n"
                                      "0 1 0 nan 0 1 0 0.75\n3 0 1 2\n3 0 2 3\n")
                        .mesh;
  REQUIRE(mesh.normals.size() == mesh.positions.size());
  REQUIRE(mesh.uvs.size() == mesh.positions.size());
  CHECK(mesh.normals[mesh.triangles[0][0]] == glm::vec3(0, 0.6F, 0.8F));
  CHECK(mesh.normals[mesh.triangles[1][2]] == glm::vec3(0, 0, 1));
  CHECK(mesh.uvs[mesh.triangles[1][2]] == glm::vec2(0, 0.75F));
}

TEST_CASE("ply mesh: colours of vertices are made linear, from bytes and from floats",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string bytes =
      kVertices + "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  const Mesh mesh = read(scratch, header("ascii", bytes + kFaces) +
                                      "0 0 0 255 0 188\n1 0 0 0 0 0\n1 1 0 0 0 0\n"
                                      "0 1 0 255 255 255\n3 0 1 2\n3 0 2 3\n")
                        .mesh;
  REQUIRE(mesh.colours.size() == mesh.positions.size());
  const glm::vec3 first = mesh.colours[mesh.triangles[0][0]];
  CHECK(first.x == 1);
  CHECK(first.y == 0);
  CHECK(static_cast<double>(first.z) == Approx(0.5029).epsilon(1e-3));
  CHECK(mesh.colours[mesh.triangles[1][2]] == glm::vec3(1));
  REQUIRE(mesh.materials.size() == 1);
  CHECK(mesh.materials[0].albedo == glm::vec3(1));

  const std::string floats = kVertices + "property float r\nproperty float g\nproperty float b\n";
  const Mesh other = read(scratch, header("ascii", floats + kFaces) +
                                       "0 0 0 1 0.5 7\n1 0 0 0 0 0\n1 1 0 0 0 nan\n"
                                       "0 1 0 1 1 1\n3 0 1 2\n3 0 2 3\n")
                         .mesh;
  const glm::vec3 colour = other.colours[other.triangles[0][0]];
  CHECK(colour.x == 1);
  CHECK(static_cast<double>(colour.y) == Approx(0.21404).epsilon(1e-4));
  CHECK(colour.z == 1);
  CHECK(other.colours[other.triangles[0][2]] == glm::vec3(0));
}

TEST_CASE("ply mesh: degenerate triangles and lone vertices are dropped", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string faces = "element face 4\nproperty list uchar int vertex_index\n";
  const Mesh mesh =
      read(scratch, header("ascii", kVertices + faces) + kSquare + "3 0 0 1\n2 0 1\n3 1 2 3\n0\n")
          .mesh;
  CHECK(mesh.positions.size() == 3);
  CHECK(mesh.triangles == Triangles{{0, 1, 2}});
  CHECK(mesh.material_of.size() == 1);
}

TEST_CASE("ply mesh: wrong indices, positions and lists are refused", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const auto fault = [&](const std::string& bytes) {
    return refusal([&] { static_cast<void>(read(scratch, bytes)); });
  };
  const std::string start = header("ascii", kVertices + kFaces);
  CHECK_THAT(fault(start + kSquare + "3 0 1 2\n3 0 1 4\n"),
             EndsWith("line 15: an index refers to no vertex"));
  CHECK_THAT(fault(start + kSquare + "3 0 1 -1\n3 0 1 2\n"), EndsWith("refers to no vertex"));
  CHECK_THAT(fault(start + "0 0 0\nnan 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 1 2\n"),
             EndsWith("vertex 1: the position is not finite"));
  CHECK_THAT(fault(start + kSquare + "3 0 0 0\n0\n"), EndsWith("a.ply: the mesh has no triangle"));
  CHECK_THAT(fault(start + "0 0 0\n1e300 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 1 2\n"),
             EndsWith("positions are more than 2e18 apart"));
  CHECK_THAT(fault(header("ascii", kVertices + "element face 1\nproperty int vertex_index\n") +
                   kSquare + "1\n"),
             EndsWith("lacks a list of integers vertex_indices"));
  CHECK_THAT(fault(header("ascii", kVertices) + kSquare), EndsWith("no triangle"));
  CHECK_THAT(fault(start + kSquare + "3 0 1 2\n3 0 1\n"),
             EndsWith("the value of property 'vertex_indices' is missing"));
}

TEST_CASE("ply mesh: every truncation of a binary mesh is refused", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  std::string whole =
      header("binary_big_endian",
             "element vertex 3\nproperty uchar x\nproperty uchar y\nproperty uchar z\n"
             "element face 1\nproperty list uchar uchar vertex_indices\n");
  whole += std::string("\0\0\0\1\0\0\0\1\0", 9) + std::string("\3\0\1\2", 4);
  CHECK(read(scratch, whole).mesh.triangles.size() == 1);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    CHECK_THROWS_AS(read(scratch, whole.substr(0, size)), DataError);
  }
  CHECK_THROWS_AS(read(scratch, whole + "x"), DataError);
}

TEST_CASE("mesh: a binary PLY far from the origin keeps its shape, also from a gzip file",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::vector<glm::dvec3> positions = {
      {1e7 + 0.001, -3, 0}, {1e7 + 1, -3, 0}, {1e7, -2, 0}, {1e7, -3, 1}};
  const std::vector<std::array<std::uint32_t, 3>> triangles = {{0, 1, 2}, {0, 2, 3}};
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty double x\n"
      "property double y\nproperty double z\nelement face 2\n"
      "property list uchar uint vertex_indices\nend_header\n";
  for (const glm::dvec3& position : positions) bytes += raw(position);
  for (const auto& triangle : triangles) bytes += raw(std::uint8_t{3}) + raw(triangle);
  const Mesh mesh = read_mesh(scratch.file("a.ply", bytes)).mesh;
  CHECK(mesh.triangles == triangles);
  CHECK(mesh.bounds().low == glm::dvec3(1e7, -3, 0));
  CHECK(mesh.bounds().high == glm::dvec3(1e7 + 1, -2, 1));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    CHECK(glm::distance(mesh.origin + glm::dvec3(mesh.positions[i]), positions[i]) < 1e-6);
  }
  gzFile packed = gzopen((scratch.path() / "b.ply.gz").c_str(), "wb");
  gzwrite(packed, bytes.data(), static_cast<unsigned>(bytes.size()));
  gzclose(packed);
  CHECK(read_mesh(scratch.path() / "b.ply.gz").mesh.triangles == mesh.triangles);
  CHECK_THAT(refusal([&] { static_cast<void>(read_mesh(scratch.file("c.ply.gz", bytes))); }),
             EndsWith("not a gzip file"));
}
