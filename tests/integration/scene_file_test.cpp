// Scene files: objects in their places, with materials, lights and a camera.
#include "engine/pipeline/build/scene_file.h"

#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/render/render_picture.h"
#include "engine/pipeline/scene_record.h"
#include "tests/support/notes.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

// A square of 2 x 2 in the plane y = 0 that faces up.
constexpr char kSquare[] = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n";

struct Scene {
  test::TemporaryDirectory dir;
  test::Notes silent;

  Scene() { dir.file("square.obj", kSquare); }

  std::vector<Surfel> build(const std::string& json, std::uint64_t memory = 1ULL << 30,
                            std::uint64_t points = 4000) {
    BuildRequest request;
    request.inputs = {dir.file("a.scene.json", json)};
    request.sampling.count = points;
    request.run.memory_bytes = memory;
    request.run.temp_dirs = {dir.path()};
    build_container(request, dir.path() / "a.ptcx", silent);
    return test::points_of(dir.path() / "a.ptcx");
  }
  std::string fault(const std::string& json) {
    try {
      build(json);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }
};

double area_of(const std::vector<Surfel>& surfels, const std::function<bool(const Surfel&)>& of) {
  double area = 0;
  for (const Surfel& s : surfels) {
    if (of(s)) area += 2 * static_cast<double>(s.radius) * static_cast<double>(s.radius);
  }
  return area;
}

}  // namespace

TEST_CASE("scene file: objects stand where they are placed, with their materials",
          "[integration][scene]") {
  Scene scene;
  scene.dir.file("places.txt",
                 "# x y z\n0 0 10\n"
                 "0 0 20  0 0 0 1  2\n"
                 "1 0 0 0  0 1 0 0  0 0 3 30  # three times as deep\n");
  const std::vector<Surfel> surfels = scene.build(R"({
    "ptcx_scene": 1,
    "materials": {"red": {"albedo": [0.8, 0.1, 0.1]}, "lamp": {"albedo": [0, 0, 0], "emission": [2, 2, 2]}},
    "lights": {"sky": {"radiance": [1, 1, 1]}},
    "objects": [
      {"file": "square.obj", "material": "red", "one_sided": true},
      {"file": "square.obj", "one_sided": true, "placements": "places.txt"},
      {"file": "square.obj", "one_sided": true, "material": "lamp",
       "translate": [20, 0, 0], "rotate": [0, 0, 2, 90], "scale": 0.5}]})");
  const auto near = [&](const glm::dvec3& place, double reach) {
    return area_of(surfels,
                   [=](const Surfel& s) { return glm::distance(s.position, place) < reach; });
  };
  CHECK(near({0, 0, 0}, 3) == Approx(4).epsilon(0.01));
  CHECK(near({0, 0, 10}, 3) == Approx(4).epsilon(0.01));
  CHECK(near({0, 0, 20}, 3) == Approx(16).epsilon(0.01));
  CHECK(near({0, 0, 30}, 5) == Approx(12).epsilon(0.01));
  CHECK(near({20, 0, 0}, 3) == Approx(1).epsilon(0.01));
  for (const Surfel& s : surfels) {
    const bool lamp = s.position.x > 15, red = s.position.z < 5 && !lamp;
    CHECK((s.emission.x > 0) == lamp);
    CHECK(s.albedo.y == Approx(red ? 0.1 : lamp ? 0 : 0.5).margin(0.01));
    if (lamp) CHECK(s.normal.x == Approx(-1).margin(0.01));  // +y turned about +z
  }
}

TEST_CASE("scene file: many places under a small cap give the surfaces of copies",
          "[integration][scene]") {
  // A wavy square of 20,000 triangles in 300 places: 6 million triangles
  Scene scene;
  std::string wavy;
  constexpr int kSide = 100;
  for (int i = 0; i <= kSide; ++i) {
    for (int k = 0; k <= kSide; ++k)
      wavy += fmt::format("v {} {} {}\n", 0.01 * i, 0.05 * std::sin(0.3 * i) * std::cos(0.2 * k),
                          0.01 * k);
  }
  for (int i = 0; i < kSide; ++i) {
    for (int k = 1; k <= kSide; ++k) {
      const int a = i * (kSide + 1) + k;
      wavy += fmt::format("f {} {} {} {}\n", a, a + 1, a + kSide + 2, a + kSide + 1);
    }
  }
  scene.dir.file("wavy.obj", wavy);
  std::string places;
  for (int i = 0; i < 300; ++i)
    places += fmt::format("{} 0 {} 0 {} 0 {} {}\n", 2 * (i % 20), 2 * (i / 20), std::sin(i),
                          std::cos(i), 0.5 + 0.005 * i);
  scene.dir.file("places.txt", places);
  const std::string json = R"({"ptcx_scene": 1, "lights": {},
    "objects": [{"file": "square.obj", "scale": 30}, {"file": "wavy.obj", "placements": "places.txt"}]})";
  const std::vector<Surfel> placed = scene.build(json, 160ULL << 20, 100'000);
  REQUIRE_FALSE(scene.silent.texts.empty());
  CHECK_THAT(scene.silent.texts.front(), Contains("do not fit in memory"));
  scene.silent.texts.clear();
  const std::vector<Surfel> copied = scene.build(json, 4ULL << 30, 100'000);
  for (const std::string& note : scene.silent.texts) CHECK_THAT(note, !Contains("memory"));
  CHECK(static_cast<double>(placed.size()) == Approx(100'000).epsilon(0.02));
  CHECK(static_cast<double>(copied.size()) == Approx(100'000).epsilon(0.02));
  const auto above = [](const Surfel& s) { return std::abs(s.position.y) > 1e-9; };
  CHECK(area_of(placed, above) == Approx(area_of(copied, above)).epsilon(0.01));
  // Each of 20 strips has as much
  for (int strip = 0; strip < 20; ++strip) {
    const auto within = [&](const Surfel& s) {
      return above(s) && s.position.x > 2 * strip - 1 && s.position.x < 2 * strip + 1;
    };
    CHECK(area_of(placed, within) == Approx(area_of(copied, within)).epsilon(0.03));
  }
}

TEST_CASE("scene file: clouds move and turn with their normals, and a camera frames the scene",
          "[integration][scene]") {
  Scene scene;
  scene.dir.file("cloud.ply",
                 "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
                 "property float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
                 "property float radius\nend_header\n1 0 0 0 1 0 0.5\n0 0 0 1 0 0 0.25\n");
  const std::string json = R"({"ptcx_scene": 1,
    "camera": {"position": [0, 5, 9], "look_at": [0, 5, 0], "width": 40, "height": 30},
    "objects": [{"file": "cloud.ply", "translate": [0, 5, 0], "rotate": [0, 0, 1, 90], "scale": 2}]})";
  std::vector<Surfel> surfels = scene.build(json);
  REQUIRE(surfels.size() == 2);
  if (surfels[0].position.y < surfels[1].position.y) std::swap(surfels[0], surfels[1]);
  CHECK(glm::distance(surfels[0].position, glm::dvec3(0, 7, 0)) < 1e-3);
  CHECK(glm::distance(surfels[0].normal, glm::vec3(-1, 0, 0)) < 1e-2);
  CHECK(surfels[0].radius == Approx(1).epsilon(0.01));
  CHECK(glm::distance(surfels[1].position, glm::dvec3(0, 5, 0)) < 1e-3);
  const std::filesystem::path file = scene.dir.path() / "a.scene.json";
  CHECK(object_files({file}) == std::vector<std::filesystem::path>{scene.dir.path() / "cloud.ply"});
  const SceneObjects objects = read_scene_objects({file}, nullptr, 1 << 20);
  CHECK(objects.named == object_files({file}));
  REQUIRE(objects.cameras.size() == 1);
  const MeshCamera seen = mesh_camera("", objects.cameras[0].at(1));
  CHECK(seen.size == std::array<unsigned, 2>{40, 30});
  CHECK(seen.forward.z == Approx(-1));
  // The picture is that of the scene's camera
  RenderRequest render;
  render.scene = file;
  render.run.temp_dirs = {scene.dir.path()};
  const std::vector<PictureTarget> targets{{scene.dir.path() / "a.exr"}};
  render_picture(render, targets, scene.silent);
  const Image picture = read_image(scene.dir.path() / "a.exr");
  CHECK(picture.width == 40);
  CHECK(picture.height == 30);
}

TEST_CASE("scene file: lights and records of what is placed move with it", "[integration][scene]") {
  Scene scene;
  scene.dir.file("lamp.gltf", R"({"asset": {"version": "2.0"},
    "extensionsUsed": ["KHR_lights_punctual"],
    "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 683}]}},
    "nodes": [{"translation": [0, 0, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}}, {"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})");
  scene.build(R"({"ptcx_scene": 1, "objects": [{"file": "lamp.gltf", "placements": [
    {"translate": [100, 0, 0]}, {"rotate": [1, 0, 0, 90], "scale": 2}]}]})");
  const std::filesystem::path lit = scene.dir.path() / "lit.ptcx";
  std::filesystem::rename(scene.dir.path() / "a.ptcx", lit);
  const auto lights_of = [](const std::filesystem::path& path) {
    return light_rig_from_json(ContainerReader(path).meta().text.at(kLightsKey));
  };
  const LightRig rig = lights_of(lit);
  REQUIRE(rig.spots.size() == 2);
  CHECK(glm::distance(rig.spots[0].position, glm::dvec3(100, 0, 3)) < 1e-6);
  CHECK(glm::distance(rig.spots[1].position, glm::dvec3(0, -6, 0)) < 1e-5);
  CHECK(glm::distance(rig.spots[1].direction, glm::vec3(0, 1, 0)) < 1e-5F);
  // The container is placed in turn
  scene.build(R"({"ptcx_scene": 1, "objects": [{"file": "lit.ptcx", "translate": [0, 7, 0]}]})");
  CHECK(glm::distance(lights_of(scene.dir.path() / "a.ptcx").spots[0].position,
                      glm::dvec3(100, 7, 3)) < 1e-6);
}

TEST_CASE("scene file: objects that differ in their places alone are read once",
          "[integration][scene]") {
  Scene scene;
  const std::filesystem::path file = scene.dir.file("a.scene.json", R"({"ptcx_scene": 1,
    "materials": {"red": {}}, "objects": [
    {"file": "square.obj"}, {"file": "square.obj", "material": "red"},
    {"file": "square.obj", "translate": [5, 0, 0]},
    {"file": "square.obj", "placements": [{"translate": [9, 0, 0]}, {}]},
    {"file": "square.obj", "one_sided": true}]})");
  const SceneObjects scene_of = read_scene_objects({file}, nullptr, 1 << 20);
  REQUIRE(scene_of.objects.size() == 3);
  std::vector<double> x;
  for (const Placement& place : scene_of.objects[0].places) x.push_back(place[3].x);
  CHECK(x == std::vector<double>{0, 5, 9, 0});
  CHECK(scene_of.objects[1].material);
  CHECK(scene_of.objects[1].places.empty());
  CHECK(scene_of.objects[2].one_sided);
}

TEST_CASE("scene file: more places than memory holds are refused before they are taken",
          "[integration][scene]") {
  Scene scene;
  std::string places;
  for (int i = 0; i < 20000; ++i) places += "1 2 3\n";
  scene.dir.file("p.txt", places);
  const std::filesystem::path file = scene.dir.file(
      "a.scene.json",
      R"({"ptcx_scene": 1, "objects": [{"file": "square.obj", "placements": "p.txt"}]})");
  CHECK(read_scene_objects({file}, nullptr, 20001 * 3 * sizeof(Placement)).objects.size() == 1);
  CHECK_THROWS_AS(read_scene_objects({file}, nullptr, 16384 * 3 * sizeof(Placement) - 1),
                  LimitError);
  CHECK_THROWS_AS(read_scene_objects({file}, nullptr, 1000), LimitError);  // for the JSON
}

TEST_CASE("scene file: what is wrong is named", "[integration][scene]") {
  Scene scene;
  const auto object = [&](const std::string& members) {
    return scene.fault(R"({"ptcx_scene": 1, "objects": [{"file": "square.obj", )" + members +
                       "}]}");
  };
  CHECK_THAT(scene.fault("{"), Contains("a.scene.json is not JSON"));
  CHECK_THAT(scene.fault("{}"), Contains("\"ptcx_scene\": 1 is missing"));
  CHECK_THAT(scene.fault(R"({"ptcx_scene": 2})"), Contains("ptcx_scene must lie in"));
  CHECK_THAT(scene.fault(R"({"ptcx_scene": 1, "object": []})"),
             Contains("unknown member \"object\""));
  CHECK_THAT(scene.fault(R"({"ptcx_scene": 1, "objects": [{}]})"),
             Contains("objects[0]: file is missing"));
  CHECK_THAT(scene.fault(R"({"ptcx_scene": 1, "objects": []})"),
             Contains("no points and no triangles"));
  CHECK_THAT(object(R"("material": "gold")"), Contains("there is no material \"gold\""));
  CHECK_THAT(object(R"("scale": 0)"), Contains("objects[0]: the place cannot be inverted"));
  CHECK_THAT(object(R"("matrix": [1, 2])"),
             Contains("matrix must be an array of 12 or 16 numbers"));
  CHECK_THAT(object(R"("matrix": [1,0,0,0,0,1,0,0,0,0,1,0], "scale": 2)"), Contains("excludes"));
  CHECK_THAT(object(R"("placements": [{"scale": 1}, {"turn": 2}])"),
             Contains("placements[1]: unknown member \"turn\""));
  CHECK_THAT(object(R"("placements": [])"), Contains("placements must be an array of places"));
  CHECK_THAT(scene.fault(R"({"ptcx_scene": 1, "lights": {"suns": [{"to_sun": [0, 0, 0]}]}})"),
             Contains("a.scene.json: light rig: suns[0]: to_sun must not be zero"));
  scene.dir.file("p.txt", "0 0 0\n1 2\n");
  CHECK_THAT(object(R"("placements": "p.txt")"),
             Contains("p.txt: line 2: a place has 3, 8, 12 or 16 numbers"));
  scene.dir.file("p.txt", "0 0 x\n");
  CHECK_THAT(object(R"("placements": "p.txt")"), Contains("line 1: a place has 3"));
  scene.dir.file("p.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2\n");
  CHECK_THAT(object(R"("placements": "p.txt")"),
             Contains("the last row of the matrix is not 0 0 0 1"));
  CHECK_THAT(object(R"("scale": "x")"), Contains("scale must be a number or an array of three"));
  CHECK_THAT(object(R"("placements": "q.txt")"), Contains("objects[0]: there is no file"));
  CHECK_THAT(object(R"("scale": 1e60)"),
             Contains("its place 0 is too far away, or makes it too large"));
  CHECK_THAT(scene.fault(R"({"ptcx_scene": 1, "objects": [{"file": "a.scene.json"}]})"),
             Contains("a scene file cannot hold another one"));
  CHECK_THAT(scene.fault(R"({"ptcx_scene": 1, "lights": )" + std::string(100'000, '[') +
                         std::string(100'000, ']') + "}"),
             Contains("a.scene.json: its JSON is nested more than 64 deep"));
  scene.dir.file("p.txt", "# none\n");
  CHECK_THAT(object(R"("placements": "p.txt")"), Contains("holds no place"));
}
