// Real files: known counts are found, and odd files are read or refused.
#include <iostream>
#include <map>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/image/image.h"
#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;

namespace {

std::optional<std::filesystem::path> data_or_skip() {
  auto data = shared_data();
  if (!data) WARN("skipped: the folder of real files is not on this machine");
  return data;
}

std::uint64_t count_points(const std::filesystem::path& path) {
  PointFile file = open_points(path);
  std::vector<Surfel> block(4096);
  std::uint64_t total = 0;
  while (const std::size_t count = file.source->next(block)) {
    for (std::size_t i = 0; file.info.has_normals && i < count; ++i) {
      REQUIRE(glm::length(block[i].normal) == Approx(1.0F));
    }
    total += count;
  }
  return total;
}

// Reads a file with every reader that its folder is for; any exception except a refusal that names
// the file fails the test. Names without an ending get one that chooses the reader.
void survive(const test::TemporaryDirectory& scratch, const std::string& folder,
             const std::filesystem::path& path) {
  const auto check = [](const std::filesystem::path& at, const auto& read) {
    const std::string text = refusal([&] { read(at); });
    if (!text.empty()) CHECK(text.find(at.filename().string()) != std::string::npos);
  };
  const auto mesh = [](const auto& at) { static_cast<void>(read_mesh(at)); };
  const auto cloud = [](const auto& at) { static_cast<void>(count_points(at)); };
  if (folder == "exr") {
    check(path, [](const auto& at) { static_cast<void>(read_image(at)); });
  } else if (folder == "ply") {
    const auto copy = scratch.file("odd.ply", slurp(path));
    check(copy, mesh);
    check(copy, cloud);
  } else if (folder == "text") {
    check(scratch.file("odd.xyz", slurp(path)), cloud);
  } else {
    check(path, mesh);
  }
}

}  // namespace

TEST_CASE("real meshes: the number of triangles is what their sources say", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const std::map<std::string, std::size_t> expected = {{"dragon_vrip_res4.ply.gz", 11'102},
                                                       {"dragon_vrip_res3.ply.gz", 47'794},
                                                       {"bun_zipper.ply", 69'451},
                                                       {"cgal-armadillo.off", 52'000},
                                                       {"2CylinderEngine.glb", 121'496},
                                                       {"nvpro/cornellBox.gltf", 16'720},
                                                       {"nvpro/Medieval_building.obj", 16'715}};
  for (const auto& [name, count] : expected) {
    INFO(name);
    const MeshFile file = read_mesh(*data / "meshes" / name);
    const Mesh& mesh = file.mesh;
    // Some files have triangles without area, which are dropped.
    CHECK(mesh.triangles.size() <= count);
    CHECK(mesh.triangles.size() + count / 10 >= count);
    CHECK(mesh.material_of.size() == mesh.triangles.size());
    CHECK((mesh.normals.empty() || mesh.normals.size() == mesh.positions.size()));
    CHECK((mesh.uvs.empty() || mesh.uvs.size() == mesh.positions.size()));
  }
  CHECK(read_mesh(*data / "meshes/dragon_vrip_res4.ply.gz").mesh.triangles.size() == 11'102);
}

TEST_CASE("real meshes: the camera and the lamp of a Cornell box are found", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const MeshFile file = read_mesh(*data / "meshes/nvpro/cornellBox.gltf");
  REQUIRE(file.cameras.size() == 1);
  CHECK(file.cameras[0].horizontal_fov == Approx(0.9273F).epsilon(1e-3));  // 53.13 degrees
  CHECK(file.cameras[0].position.z == Approx(19.992092));
  std::size_t lamps = 0;
  for (const Material& material : file.mesh.materials) lamps += material.emission.x == 10 ? 1 : 0;
  CHECK(lamps == 1);
}

TEST_CASE("real clouds: the number of points is what their sources say", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  CHECK(count_points(*data / "points/cgal-building.ply") == 100'000);
  CHECK(count_points(*data / "points/cgal-kitten.xyz") == 5'210);
  CHECK(count_points(*data / "points/cgal-b9_training.ply") == 22'300);
  CHECK(count_points(*data / "renderman/ball-source.ply") > 0);
}

TEST_CASE("real pictures: environment maps of every compression are read", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  for (const char* name : {"city.exr", "grace_latlong.exr", "StageEnvLatLong.exr"}) {
    const Image image = read_image(*data / "envmaps" / name);
    CHECK(image.width == (name == std::string("StageEnvLatLong.exr") ? 1000 : 1024));
    CHECK(image.height * 2 == image.width);
    double sum = 0;
    for (const glm::vec3& pixel : image.pixels) sum += static_cast<double>(pixel.y);
    CHECK(sum > 0);
  }
  const Image jpeg = read_image(*data / "meshes/sponza-dabrovic/textures/KAMEN.JPG");
  CHECK(jpeg.pixels.size() == std::size_t{jpeg.width} * jpeg.height);
  const std::string whole = slurp(*data / "meshes/sponza-dabrovic/textures/01_S_ba.JPG");
  const auto decode = [&](std::size_t size) {
    static_cast<void>(decode_image(std::as_bytes(std::span(whole.data(), size)), "a.jpg"));
  };
  CHECK_NOTHROW(decode(whole.size()));
  for (std::size_t size = 0; size < whole.size() - 2; ++size)
    CHECK_THROWS_AS(decode(size), DataError);
}

TEST_CASE("odd files: each file is read or refused by name", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const test::TemporaryDirectory scratch;
  std::size_t files = 0;
  for (const std::string folder : {"ply", "obj", "off", "gltf", "exr", "text"}) {
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(*data / "odd" / folder)) {
      if (!entry.is_regular_file()) continue;
      INFO(entry.path().string());
      survive(scratch, folder, entry.path());
      ++files;
    }
  }
  CHECK(files > 150);
}
