// Meshes that do not fit in memory are read to the same triangles as those that do.
#include "engine/io/mesh/spilled_mesh.h"

#include <cmath>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

/// Reads a mesh as if there were next to no memory for it.
MeshFile read_on_disk(const std::filesystem::path& path, std::uint64_t memory_bytes) {
  return read_mesh(path, {.memory_bytes = memory_bytes, .temp_directory = path.parent_path()});
}

/// Returns the triangles of a mesh on the disk.
std::vector<MeshTriangle> triangles_of(const SpilledMesh& mesh) {
  std::vector<MeshTriangle> all;
  mesh.visit(
      [&](std::span<const MeshTriangle> some) { all.insert(all.end(), some.begin(), some.end()); });
  return all;
}

/// Compares the two ways to read a file.
void check_same(const std::filesystem::path& path, std::uint64_t memory_bytes = 0) {
  const MeshFile memory = read_mesh(path), disk = read_on_disk(path, memory_bytes);
  const Mesh& mesh = memory.mesh;
  INFO(path.filename());
  REQUIRE(disk.spilled);
  CHECK(disk.mesh.triangles.empty());
  CHECK(disk.warnings == memory.warnings);
  CHECK(disk.spilled->origin() == mesh.origin);
  CHECK(disk.spilled->bounds().low == mesh.bounds().low);
  CHECK(disk.spilled->bounds().high == mesh.bounds().high);
  CHECK(disk.spilled->has_normals() == !mesh.normals.empty());
  CHECK(disk.spilled->has_uvs() == !mesh.uvs.empty());
  CHECK(disk.spilled->has_colours() == !mesh.colours.empty());
  REQUIRE(disk.spilled->materials().size() == mesh.materials.size());
  for (std::size_t i = 0; i < mesh.materials.size(); ++i)
    CHECK(disk.spilled->materials()[i].name == mesh.materials[i].name);
  const std::vector<MeshTriangle> triangles = triangles_of(*disk.spilled);
  REQUIRE(triangles.size() == mesh.triangles.size());
  CHECK(triangles.size() == disk.spilled->triangles());
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    REQUIRE(triangles[i].material == mesh.material_of[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t vertex = mesh.triangles[i][k];
      REQUIRE(triangles[i].positions[k] == mesh.positions[vertex]);
      REQUIRE(triangles[i].normals[k] ==
              (mesh.normals.empty() ? glm::vec3(0) : mesh.normals[vertex]));
      REQUIRE(triangles[i].uvs[k] == (mesh.uvs.empty() ? glm::vec2(0) : mesh.uvs[vertex]));
      REQUIRE(triangles[i].colours[k] ==
              (mesh.colours.empty() ? glm::vec3(1) : mesh.colours[vertex]));
    }
  }
}

/// Returns an OBJ of n x n quads with two materials.
std::string grid(int n, bool normals, bool uvs) {
  std::string text;
  for (int i = 0; i <= n; ++i) {
    for (int k = 0; k <= n; ++k) {
      text += fmt::format("v {} {} {}\n", i, std::sin(i) * std::cos(k), k);
      if (normals) text += fmt::format("vn {} 1 {}\n", 0.1 * i, 0.1 * k);
      if (uvs) text += fmt::format("vt {} {}\n", 0.5 * i, 0.25 * k);
    }
  }
  for (int i = 0; i < n; ++i) {
    text += fmt::format("usemtl m{}\n", i % 2);
    for (int k = 0; k < n; ++k) {
      text += "f";
      for (const int at : {i * (n + 1) + k, i * (n + 1) + k + 1, (i + 1) * (n + 1) + k + 1,
                           (i + 1) * (n + 1) + k}) {
        text += fmt::format(" {}", at + 1);
        if (uvs || normals) text += '/';
        if (uvs) text += fmt::format("{}", at + 1);
        if (normals) text += fmt::format("/{}", at + 1);
      }
      text += '\n';
    }
  }
  return text;
}

}  // namespace

TEST_CASE("spilled mesh: OBJ of all kinds", "[io][spilled]") {
  const test::TemporaryDirectory scratch;
  check_same(scratch.file("plain.obj", grid(100, false, false)));
  check_same(scratch.file("normals.obj", grid(20, true, false)));
  check_same(scratch.file("all.obj", grid(20, true, true)));
  check_same(scratch.file("colours.obj",
                          "v 0 0 0 1 0 0\nv 4 0 0 0 0.5 0.25\nv 4 4 0\nv 0 4 0 0 2 nan\n"
                          "v 9 9 9\nf 1 2 3\nf 1 3 4\nf 2 3 5\n"));
  // Triangles that lack what others have, polygons that are not convex, and some without area
  check_same(scratch.file("mixed.obj",
                          "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nv 9 9 9\nvn 0 0 2\n"
                          "vn 0 0 0\nvt 0.5 nan\nvt 1 2\nf 1/1/1 2/2/1 3/2/2\nf 1 2 3 4 5\n"
                          "f 1 1 2\nf 3//1 2 1\n"));
}

TEST_CASE("spilled mesh: PLY, OFF, STL and glTF", "[io][spilled]") {
  const test::TemporaryDirectory scratch;
  check_same(scratch.file("a.ply",
                          "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n"
                          "property float y\nproperty float z\nproperty float u\n"
                          "property float v\nelement face 2\n"
                          "property list uchar int vertex_indices\nend_header\n"
                          "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n3 0 1 2\n4 0 1 2 3\n"));
  check_same(scratch.file("a.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"));
  check_same(scratch.file("a.stl",
                          "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                          "vertex 0 1 0\nendloop\nendfacet\nendsolid\n"));
  // Vertices that take more than the JSON
  constexpr std::size_t kVertices = 3000;
  std::string bytes;
  for (std::size_t i = 0; i < kVertices; ++i) {
    const auto t = static_cast<float>(i);
    for (const float p : {std::sin(t), std::cos(t), 0.01F * t}) bytes += raw(p);
  }
  scratch.file("a.bin", bytes);
  for (const int mode : {4, 5, 6}) {
    nlohmann::json json = nlohmann::json::parse(R"({
      "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}, {"mesh": 1, "scale": [-1, 1, 1]}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3000, "type": "VEC3"}],
      "bufferViews": [{"buffer": 0, "byteLength": 36000}],
      "buffers": [{"uri": "a.bin", "byteLength": 36000}]})");
    json["meshes"][0]["primitives"][0]["mode"] = mode;
    json["meshes"].push_back(json["meshes"][0]);
    const auto path = scratch.file("a.gltf", json.dump());
    check_same(path, 1 << 16);
    const std::size_t each = mode == 4 ? kVertices / 3 : kVertices - 2;
    CHECK(read_mesh(path).mesh.triangles.size() == 2 * each);
  }
}

TEST_CASE("spilled mesh: what is refused in memory is refused on the disk", "[io][spilled]") {
  const test::TemporaryDirectory scratch;
  const auto refusal_of = [&](const std::string& text) {
    const auto path = scratch.file("a.obj", text);
    const std::string memory = refusal([&] { static_cast<void>(read_mesh(path)); });
    CHECK(refusal([&] { static_cast<void>(read_on_disk(path, 0)); }) == memory);
    return memory;
  };
  CHECK_THAT(refusal_of("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"),
             Contains("polygon 0: an index refers to no vertex"));
  CHECK_THAT(refusal_of("v 0 0 0\nv 1 0 inf\nv 0 1 0\nf 1 2 3\n"), Contains("is not finite"));
  CHECK_THAT(refusal_of("v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n"), Contains("2e18 apart"));
  CHECK_THAT(refusal_of("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), Contains("has no triangle"));
}

TEST_CASE("gltf: JSON that is nested too deep or takes too much memory is refused",
          "[io][gltf][spilled]") {
  const test::TemporaryDirectory scratch;
  const std::string deep = "{\"a\":" + std::string(200, '[') + std::string(200, ']') + "}";
  CHECK_THAT(refusal([&] { static_cast<void>(read_mesh(scratch.file("a.gltf", deep))); }),
             Contains("a.gltf: its JSON is nested more than 128 deep"));
  std::string wide = "{\"a\":[0";
  for (int i = 0; i < 100'000; ++i) wide += ",0";
  wide += "]}";
  const auto path = scratch.file("b.gltf", wide);
  const auto read_in = [&](std::uint64_t bytes) {
    static_cast<void>(read_mesh(path, {.memory_bytes = bytes}));
  };
  CHECK_THROWS_AS(read_in(1 << 20), LimitError);  // the values
  CHECK_THROWS_AS(read_in(1 << 16), LimitError);  // the text
  CHECK_THROWS_AS(read_in(1 << 24), DataError);   // it has no triangle
}
