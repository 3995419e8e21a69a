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
#include "tests/io/clouds.h"

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
      REQUIRE(glm::length(block[i].normal) == Approx(1.0F));  // none of the files has unknown ones
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
  } else if (folder == "pcd") {
    check(path, cloud);
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
  const std::map<std::string, std::uint64_t> expected = {
      {"points/cgal-building.ply", 100'000},
      {"points/cgal-kitten.xyz", 5'210},
      {"points/cgal-b9_training.ply", 22'300},
      {"points/region_growing_rgb_tutorial.pcd", 259'847},  // and 47,353 holes
      {"points/bun0.pcd", 397},
      {"points/Zaghetto.pcd", 59'750},
      {"points/autzen.pts", 10},
      {"points/test.pts", 19},
      {"points/1.2-with-color.ptx", 1'065},
      {"renderman/test.bgeo", 5},
      {"renderman/scatter.bgeo", 25},
      {"renderman/json.bgeo", 5},  // in spite of its name, it is a classic one
      {"renderman/test.geo", 5},
      {"renderman/test.pdb", 13},  // its header says so
      {"renderman/ball.ptc", 31'374},
      {"renderman/ball.bgeo", 31'374},
      {"renderman/ball-source.ply", 31'374}};
  for (const auto& [name, count] : expected) {
    INFO(name);
    CHECK(is_point_file(*data / name));
    CHECK(count_points(*data / name) == count);
  }
}

TEST_CASE("real clouds: a grid of PCD agrees with Open3D", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const Cloud cloud = read_cloud(*data / "points/region_growing_rgb_tutorial.pcd", 10'000);
  CHECK(cloud.left_out == 47'353);
  glm::dvec3 sum(0);
  glm::dvec3 colours(0);
  for (std::size_t i = 0; i < cloud.surfels.size(); ++i) {
    sum += cloud.surfels[i].position;
    for (int c = 0; c < 3; ++c) colours[c] += cloud.value(i, "rgb", static_cast<std::size_t>(c));
  }
  // Open3D 0.20: means of the points that are not NaN, and sums of their colours.
  const glm::dvec3 mean = sum / static_cast<double>(cloud.surfels.size());
  CHECK(mean.x == Approx(0.02560813).margin(1e-7));
  CHECK(mean.y == Approx(-0.13099336).margin(1e-7));
  CHECK(mean.z == Approx(1.61183924).margin(1e-7));
  CHECK(colours == glm::dvec3(41'468'041, 36'508'734, 34'265'005));
}

TEST_CASE("real clouds: PTC and BGEO agree with the PLY that they were made of", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const Cloud source = read_cloud(*data / "renderman/ball-source.ply", 10'000);
  for (const char* name : {"renderman/ball.ptc", "renderman/ball.bgeo"}) {
    INFO(name);
    const Cloud cloud = read_cloud(*data / name, 10'000);
    REQUIRE(cloud.surfels.size() == source.surfels.size());
    double turned = 0;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < cloud.surfels.size(); ++i) {
      const Surfel& s = cloud.surfels[i];
      const Surfel& from = source.surfels[i];
      turned = std::max(turned, static_cast<double>(glm::distance(s.normal, from.normal)));
      const bool same = glm::vec3(s.position) == glm::vec3(from.position) && s.radius == 0.35F &&
                        glm::distance(s.radiance, 0.5F + 0.5F * from.normal) < 1e-4F &&
                        cloud.value(i, "segment") == source.value(i, "segment_index");
      wrong += same ? 0 : 1;
    }
    CHECK(wrong == 0);
    CHECK(turned < 3e-4);  // a step of 1/65535 in z, where z is near 1
  }
}

TEST_CASE("real clouds: first points and channels are what the files say", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const Cloud pts = read_cloud(*data / "points/autzen.pts");
  CHECK(pts.surfels[0].position == glm::dvec3(636110.300003, 849345.050003, 512.139999));
  CHECK(pts.value(0, "intensity") == -1613);
  CHECK(pts.value(9, "rgb", 1) == 127);
  const Cloud pdb = read_cloud(*data / "renderman/test.pdb");
  CHECK(pdb.surfels[0].position.x == static_cast<double>(0.27929607F));
  CHECK(pdb.surfels[0].radius == 2);
  CHECK(pdb.surfels[12].radius == 1);
  for (std::size_t i = 0; i < 13; ++i) CHECK(pdb.value(i, "id") == static_cast<double>(i + 1));
  const Cloud bgeo = read_cloud(*data / "renderman/test.bgeo");
  const Cloud geo = read_cloud(*data / "renderman/test.geo");
  CHECK(bgeo.rows == geo.rows);
  CHECK(bgeo.value(4, "life", 0) == static_cast<double>(2.8F));
  const Cloud ptx = read_cloud(*data / "odd/text/PDAL__multiple-and-transform.ptx");
  CHECK(ptx.surfels[0].position.x == Approx(637012.24));
  CHECK(ptx.surfels[0].position.z == Approx(431.66));  // 2 * 15.83 + 400
  CHECK(ptx.info.scanners.size() == 2);
  const Cloud pcd = read_cloud(*data / "odd/pcd/PDAL__autzen-utm.pcd");
  CHECK(pcd.surfels[0].position.x == Approx(494428.61));
  CHECK(pcd.value(0, "point_source_id") == 7326);
  CHECK(pcd.value(0, "gps_time") == Approx(245380.783));
}

TEST_CASE("odd clouds: those that break no rule are read, the others refused", "[io][shared]") {
  const auto data = data_or_skip();
  if (!data) return;
  const std::map<std::string, std::string> refused = {
      {"ply/assimp__issue623.ply", "line 14: the value of property 'vertex_indices' is missing"},
      {"ply/assimp__payload_JVN42386607", "line 2: the PLY version is not 1.0"},
      {"ply/displaz__displaz_ply_points.ply", "the PLY file has no vertices"},
      {"ply/displaz__polygon_2d.ply", "the PLY vertices do not have all of x, y and z"},
      {"text/PDAL__bunny_8.pts",
       "line 10: a block of PTS must begin with the number of its points, alone on a line"},
      {"text/PDAL__utm17_3.txt", "line 5: 4 values, but the line of names has 3"}};
  for (const std::string folder : {"ply", "pcd", "text"}) {
    for (const auto& entry : std::filesystem::directory_iterator(*data / "odd" / folder)) {
      const std::string name = folder + "/" + entry.path().filename().string();
      INFO(name);
      const std::string error = refusal([&] { static_cast<void>(read_cloud(entry.path(), 1000)); });
      const auto found = refused.find(name);
      CHECK(error == (found == refused.end() ? "" : entry.path().string() + ": " + found->second));
    }
  }
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
  for (const std::string folder : {"ply", "obj", "off", "gltf", "exr", "text", "pcd"}) {
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
