// Bounding boxes, and joining meshes.
#include "engine/io/mesh/mesh.h"

#include <filesystem>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/spilled_mesh.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;

namespace {

Mesh triangle(const glm::dvec3& origin) {
  Mesh mesh;
  mesh.origin = origin;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}};
  mesh.material_of = {0};
  mesh.materials.resize(1);
  mesh.materials[0].name.assign("plain");
  return mesh;
}

glm::dvec3 world(const Mesh& mesh, std::size_t index) {
  return mesh.origin + glm::dvec3(mesh.positions[index]);
}

glm::vec3 geometric_normal(const Mesh& mesh, std::size_t index) {
  const auto& [a, b, c] = mesh.triangles[index];
  return glm::normalize(
      glm::cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]));
}

}  // namespace

TEST_CASE("bounds: a box contains what was added, and nothing before that", "[io][bounds]") {
  Bounds box;
  CHECK(box.empty());
  box.add(Bounds{});
  CHECK(box.empty());
  box.add(glm::dvec3(5, -5, 5));
  CHECK_FALSE(box.empty());
  CHECK(box.low == glm::dvec3(5, -5, 5));
  CHECK(box.high == box.low);
  box.add(glm::dvec3(6, -6, 5));
  CHECK(box.low == glm::dvec3(5, -6, 5));
  CHECK(box.high == glm::dvec3(6, -5, 5));
  Bounds other;
  other.add(box);
  other.add(Bounds{});
  CHECK(other.low == box.low);
  CHECK(other.high == box.high);
}

TEST_CASE("mesh: the box of an empty mesh is empty", "[io][mesh]") {
  CHECK(Mesh{}.bounds().empty());
  CHECK(triangle({1e7, 0, 0}).bounds().high == glm::dvec3(1e7 + 1, 1, 0));
}

TEST_CASE("append: an empty mesh takes the origin of the appended mesh", "[io][mesh]") {
  Mesh mesh;
  append_mesh(mesh, triangle({1e7, 0, 0}), glm::translate(glm::dmat4(1), {0.25, 0, 5e6}));
  CHECK(mesh.origin == glm::dvec3(1e7 + 1, 1, 5e6));
  CHECK(world(mesh, 0) == glm::dvec3(1e7 + 0.25, 0, 5e6));
  CHECK(mesh.materials.size() == 1);
}

TEST_CASE("append: indices and materials are shifted past the existing ones", "[io][mesh]") {
  Mesh mesh = triangle({0, 0, 0});
  append_mesh(mesh, triangle({3, 0, 0}), glm::dmat4(1));
  append_mesh(mesh, mesh, glm::translate(glm::dmat4(1), {0, 0, 1}));
  REQUIRE(mesh.triangles.size() == 4);
  CHECK(mesh.material_of == std::vector<std::uint16_t>{0, 1, 2, 3});
  CHECK(world(mesh, mesh.triangles[3][1]) == glm::dvec3(4, 0, 1));
  CHECK(mesh.normals.empty());
}

TEST_CASE("append: objects stay apart, and a mesh without any is one", "[io][mesh]") {
  Mesh mesh = triangle({0, 0, 0});
  append_mesh(mesh, triangle({3, 0, 0}), glm::dmat4(1));
  CHECK(mesh.objects.empty());
  CHECK(mesh.object_runs.empty());
  Mesh other = triangle({6, 0, 0});
  append_mesh(other, triangle({9, 0, 0}), glm::dmat4(1));
  other.objects = {"a", "b"};
  other.object_runs = {{0, 1}, {1, 0}};
  append_mesh(mesh, other, glm::dmat4(1));
  CHECK(mesh.objects == std::vector<std::string>{"", "a", "b"});
  CHECK(mesh.object_runs == std::vector<ObjectRun>{{0, 0}, {2, 2}, {3, 1}});
  append_mesh(mesh, triangle({12, 0, 0}), glm::dmat4(1));
  CHECK(mesh.objects.size() == 4);
  CHECK(mesh.object_runs.back() == ObjectRun{4, 3});
  Mesh empty;
  append_mesh(empty, other, glm::dmat4(1));
  CHECK(empty.objects == other.objects);
  CHECK(empty.object_runs == other.object_runs);
}

TEST_CASE("append: a mirroring transform turns triangles and normals alike", "[io][mesh]") {
  Mesh other = triangle({0, 0, 0});
  other.normals.assign(3, {0, 0.6F, 0.8F});
  Mesh mesh;
  append_mesh(mesh, other, glm::scale(glm::dmat4(1), {2, 1, -0.5}));
  CHECK(geometric_normal(mesh, 0) == glm::vec3(0, 0, -1));
  // The inverse transpose scales y by 1 and z by -2.
  const glm::vec3 expected = glm::normalize(glm::vec3(0, 0.6F, -1.6F));
  CHECK(glm::length(mesh.normals[0] - expected) < 1e-6F);
}

TEST_CASE("append: a mesh without normals gets flat ones, one without coordinates (0, 0)",
          "[io][mesh]") {
  for (const bool first : {false, true}) {
    Mesh with = triangle({0, 0, 0});
    with.normals.assign(3, {0, 1, 0});
    with.uvs.assign(3, {0.5F, 0.5F});
    Mesh without = triangle({0, 0, 2});
    without.triangles.push_back({2, 1, 0});
    without.material_of.push_back(0);
    Mesh mesh = first ? with : without;
    append_mesh(mesh, first ? without : with, glm::dmat4(1));
    REQUIRE(mesh.normals.size() == mesh.positions.size());
    REQUIRE(mesh.uvs.size() == mesh.positions.size());
    const std::size_t flat = first ? 1 : 0;
    CHECK(mesh.normals[mesh.triangles[flat][0]] == glm::vec3(0, 0, 1));
    CHECK(mesh.normals[mesh.triangles[flat + 1][0]] == glm::vec3(0, 0, -1));
    CHECK(mesh.uvs[mesh.triangles[flat][0]] == glm::vec2(0));
    const std::size_t own = first ? 0 : 2;
    CHECK(mesh.normals[mesh.triangles[own][0]] == glm::vec3(0, 1, 0));
    CHECK(mesh.uvs[mesh.triangles[own][0]] == glm::vec2(0.5F));
  }
}

TEST_CASE("append: transforms without an inverse and too many materials are refused",
          "[io][mesh]") {
  Mesh mesh = triangle({0, 0, 0});
  const Mesh other = mesh;
  CHECK_THROWS_AS(append_mesh(mesh, other, glm::dmat4(0)), std::invalid_argument);
  CHECK_THROWS_AS(append_mesh(mesh, other, glm::dmat4(NAN)), std::invalid_argument);
  mesh.materials.resize(65536);
  CHECK_THROWS_AS(append_mesh(mesh, other, glm::dmat4(1)), RequestError);
  CHECK(mesh.triangles.size() == 1);
}

TEST_CASE("mesh: file names with an unknown ending are refused", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  for (const char* name : {"a.blend", "a.dae", "a", "a.gltf.gz"}) {
    CHECK_THAT(refusal([&] { static_cast<void>(read_mesh(scratch.file(name, "x"))); }),
               Contains(name) && Contains("nothing that can be read"));
  }
}

TEST_CASE("mesh: both sides reflect in formats that know no sides, unless asked otherwise",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::vector<std::filesystem::path> files{
      scratch.file("a.obj",
                   "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl m\nf 1 2 3\n"),
      scratch.file("a.ply",
                   "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                   "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                   "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
      scratch.file("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
      scratch.file("a.stl",
                   "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                   "vertex 0 1 0\nendloop\nendfacet\nendsolid\n")};
  scratch.file("a.mtl", "newmtl m\nKd 1 0 0\n");
  Material blue;
  blue.name = "blue";
  blue.albedo = {0, 0, 1};
  for (const auto& file : files) {
    INFO(file);
    for (const bool spill : {false, true}) {
      const auto materials = [&](MeshRoom room) {
        room.temp_directory = scratch.path();
        if (spill) room.memory_bytes = 0;
        const MeshFile read = read_mesh(file, room);
        REQUIRE((read.spilled != nullptr) == spill);
        return spill ? read.spilled->materials() : read.mesh.materials;
      };
      for (const Material& material : materials({})) CHECK(material.double_sided);
      for (const Material& material : materials({.one_sided = true}))
        CHECK_FALSE(material.double_sided);
      for (const Material& material : materials({.material = blue})) {
        CHECK(material.double_sided);
        CHECK(material.albedo == blue.albedo);
        CHECK(material.name == "blue");
      }
    }
  }
}
