// Flipped bytes in every text and binary format that is read: they give a value or a refusal.
#include <vector>

#include <catch2/catch.hpp>

#include "engine/io/cloud/points.h"
#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;

namespace {

void read_points(const std::filesystem::path& path) {
  PointFile file = open_points(path);
  std::vector<Surfel> block(16);
  while (file.source->next(block) > 0) {
  }
}

const std::string kPlyMesh =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 1 2 3\n1 0 0 4 5 6\n1 1 0 7 8 9\n0 1 0 9 9 9\n4 0 1 2 3\n";

std::string binary_ply() {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty double z\nelement face 1\n"
      "property list uint uint vertex_indices\nend_header\n";
  for (int i = 0; i < 3; ++i) {
    bytes += raw(static_cast<float>(i == 1)) + raw(static_cast<float>(i == 2)) + raw(0.5);
  }
  return bytes + raw(3U) + raw(0U) + raw(1U) + raw(2U);
}

}  // namespace

TEST_CASE("damage: a flipped byte of any format changes the data or has it refused, no more",
          "[io][damage]") {
  const test::TemporaryDirectory scratch;
  const std::vector<std::pair<std::string, std::string>> wholes = {
      {"a.ply", kPlyMesh},
      {"a.ply", binary_ply()},
      {"a.off",
       "COFF\n4 2 0\n0 0 0 1 1 1\n1 0 0 1 1 1\n1 1 0 1 1 1\n0 1 0 1 1 1\n3 0 1 2\n3 0 2 3\n"},
      {"a.obj",
       "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvn 0 0 1\nusemtl m\nf 1/1/1 2/1/1 "
       "3/1/1\n"},
      {"a.stl", "solid\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendsolid\n"},
      {"a.xyz", "# c\n1 2 3 0 0 1 4 5 6 7\n1e5 2 3 0 1 0 4 5 6 7\n"}};
  for (const auto& [name, whole] : wholes) {
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const int flip : {1, 4, 0x10, 0x80, 0xff}) {
        std::string damaged = whole;
        damaged[i] = static_cast<char>(damaged[i] ^ flip);
        const auto path = scratch.file(name, damaged);
        if (!name.ends_with(".xyz")) {
          static_cast<void>(refusal([&] { static_cast<void>(read_mesh(path)); }));
        }
        if (name.ends_with(".xyz") || name.ends_with(".ply")) {
          static_cast<void>(refusal([&] { read_points(path); }));
        }
      }
    }
  }
  SUCCEED("every damaged file was read or refused");
}

TEST_CASE("damage: every truncation of every format is read or refused", "[io][damage]") {
  const test::TemporaryDirectory scratch;
  for (const std::string& whole : {kPlyMesh, binary_ply()}) {
    for (std::size_t size = 0; size < whole.size() - 2; ++size) {
      const auto path = scratch.file("a.ply", whole.substr(0, size));
      CHECK_FALSE(refusal([&] { static_cast<void>(read_mesh(path)); }).empty());
      CHECK_FALSE(refusal([&] { read_points(path); }).empty());
    }
  }
}
