// Sequences of pictures: their frames, their cameras and the names of their files.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/render/render_picture.h"
#include "engine/pipeline/render/shots.h"
#include "tests/support/notes.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

bool same_bytes(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::ifstream first(a, std::ios::binary), second(b, std::ios::binary);
  REQUIRE((first && second));
  using Bytes = std::istreambuf_iterator<char>;
  return std::equal(Bytes(first), Bytes(), Bytes(second), Bytes());
}

// Two squares that face up, one above a part of the other.
constexpr char kSquares[] =
    "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n"
    "v 0 0.5 0\nv 1 0.5 0\nv 1 0.5 1\nv 0 0.5 1\nf 8 7 6 5\n";

// A scene of squares, seen by a small camera, and the pictures of one request.
struct Scene {
  test::TemporaryDirectory dir;
  test::Notes notes;
  RenderRequest request;

  Scene() {
    dir.file("squares.obj", kSquares);
    BuildRequest build{.inputs = {path("squares.obj")}};
    build.sampling.count = 3000;
    build_container(build, path("a.ptcx"), notes);
    request.scene = path("a.ptcx");
    request.meshes = {path("squares.obj")};
    request.camera = Camera{.position = {2, 2, 3}, .look_at = {0, 0.2, 0}};
    request.size = {{40, 24}};
    request.samples = 4;
  }
  [[nodiscard]] std::filesystem::path path(const std::string& name) const {
    return dir.path() / name;
  }
  LightingReport render(const std::vector<std::string>& names) {
    std::vector<PictureTarget> targets;
    for (const std::string& name : names) targets.push_back({path(name)});
    return render_picture(request, targets, notes);
  }
};

glm::dvec3 position_at(const SceneCamera& camera, double frame) {
  return camera.at(frame).position;
}

}  // namespace

TEST_CASE("sequence: the number of a frame takes the place of its mark",
          "[integration][sequence]") {
  const auto name = [](const char* path, std::int64_t frame) {
    return frame_name(path, frame).value_or("none").string();
  };
  CHECK(name("a.####.exr", 7) == "a.0007.exr");
  CHECK(name("d#/a.#.exr", 123) == "d#/a.123.exr");
  CHECK(name("a#b##.png", 5) == "a#b05.png");
  CHECK(name("a.%04d.exr", 42) == "a.0042.exr");
  CHECK(name("a.%d.exr", 42) == "a.42.exr");
  CHECK(name("###.png", -3) == "-03.png");
  CHECK(name("a.%4d.exr", 1) == "none");
  CHECK(name("a.%0xd.exr", 1) == "none");
  CHECK(name("50%", 1) == "none");
  CHECK(name("d#/a.exr", 1) == "none");
  const FrameRange frames{-4, 7, 5};
  REQUIRE(frames.count() == 3);
  CHECK(frames[0] == -4);
  CHECK(frames[2] == 6);
}

TEST_CASE("sequence: a turntable shows what cameras around the target see",
          "[integration][sequence]") {
  Scene scene;
  scene.request.sequence = SequenceRequest{.frames = {1, 4}, .turntable = 4};
  scene.render({"turn.#.exr"});
  // A quarter of a turn takes x to -z, and z to x
  const std::array<glm::dvec3, 4> stands{{{2, 2, 3}, {3, 2, -2}, {-2, 2, -3}, {-3, 2, 2}}};
  scene.request.sequence.reset();
  for (std::size_t i = 0; i < 4; ++i) {
    scene.request.camera->position = stands[i];
    scene.render({"still.exr"});
    const Image turned = read_image(scene.path("turn." + std::to_string(i + 1) + ".exr"));
    const Image still = read_image(scene.path("still.exr"));
    REQUIRE(turned.pixels.size() == still.pixels.size());
    double worst = 0;  // a position that is rounded otherwise moves edges by a hair
    for (std::size_t k = 0; k < still.pixels.size(); ++k)
      worst += glm::length(glm::dvec3(turned.pixels[k] - still.pixels[k]));
    CHECK(worst / static_cast<double>(still.pixels.size()) < 1e-3);
  }
  CHECK_FALSE(same_bytes(scene.path("turn.1.exr"), scene.path("turn.2.exr")));
}

TEST_CASE("sequence: each frame is the picture that it is alone, of meshes and of surfels",
          "[integration][sequence]") {
  Scene scene;
  SECTION("of a mesh") {}
  SECTION("of a mesh, with light in groups") {
    LightRig rig;
    rig.suns = {{.group = "key"}};
    rig.sky.radiance = glm::vec3(0.2F);
    scene.request.lights = rig;
    scene.request.light_groups = true;
  }
  SECTION("of surfels") {
    scene.request.meshes.clear();
  }
  SECTION("of surfels, in parts") {
    scene.request.meshes.clear();
    scene.request.camera->position = {9, 9, 13};
    scene.request.size = {{800, 600}};
    scene.request.run.memory_bytes = std::uint64_t{170} << 20;
  }
  SECTION("with reflections") {
    scene.request.glossy = {.roughness = 0.3F, .rays = 4};
  }
  scene.request.sequence = SequenceRequest{.frames = {2, 10, 4}, .turntable = 12};
  const LightingReport all = scene.render({"all.##.exr", "all.##.png"});
  REQUIRE(all.exposure);
  for (const std::int64_t frame : {2, 6, 10}) {
    scene.request.sequence->frames = {frame, frame};
    scene.render({"one.##.exr", "one.##.png"});
    const std::string number = frame < 10 ? "0" + std::to_string(frame) : std::to_string(frame);
    CHECK(same_bytes(scene.path("all." + number + ".exr"), scene.path("one." + number + ".exr")));
    // The first one chose the exposure for all
    if (frame == 2)
      CHECK(same_bytes(scene.path("all." + number + ".png"), scene.path("one." + number + ".png")));
  }
}

TEST_CASE("sequence: cameras of scene files have names, and move between their keys",
          "[integration][sequence]") {
  Scene scene;
  const auto read = [&](const std::string& cameras) {
    const auto file = scene.dir.file("a.scene.json", R"({"ptcx_scene": 1, )" + cameras + "}");
    return read_scene_objects({file}, nullptr, 1 << 30).cameras;
  };
  const std::vector<SceneCamera> cameras = read(
      R"("camera": {"position": [1, 2, 3]}, "cameras": {"fly": {"up": [0, 0, 1], "keys": [
         {"frame": 1, "position": [0, 0, 0], "look_at": [0, 1, 0]},
         {"frame": 5, "position": [4, 0, 8], "look_at": [0, 1, 0], "vertical_fov": 0.5},
         {"frame": 6, "position": [4, 9, 8], "look_at": [0, 1, 0], "up": [1, 0, 0]}]}})");
  REQUIRE(cameras.size() == 2);
  CHECK(cameras[0].name.empty());
  CHECK(position_at(cameras[0], 50) == glm::dvec3(1, 2, 3));
  const SceneCamera& fly = cameras[1];
  CHECK(fly.name == "fly");
  CHECK(position_at(fly, -3) == glm::dvec3(0));
  CHECK(position_at(fly, 2) == glm::dvec3(1, 0, 2));
  CHECK(fly.at(3).vertical_fov == Approx(0.6));
  CHECK(fly.at(3).up == glm::vec3(0, 0, 1));
  CHECK(fly.at(5.5).up == glm::vec3(0.5F, 0, 0.5F));
  CHECK(position_at(fly, 7) == glm::dvec3(4, 9, 8));

  CHECK_THROWS_WITH(read(R"("cameras": {"a": {"keys": []}})"),
                    Contains("a.scene.json: cameras: a: keys must be an array"));
  CHECK_THROWS_WITH(read(R"("cameras": {"a": {"keys": [{"frame": 2}, {"frame": 2}]}})"),
                    Contains("cameras: a: keys[1]: frame must be later"));
  CHECK_THROWS_WITH(read(R"("cameras": {"a": {"keys": [{"position": [0, 0, 0]}]}})"),
                    Contains("keys[0]: frame must be a number"));
  CHECK_THROWS_WITH(read(R"("cameras": {"a": {"keys": [{"frame": 1, "width": 3}]}})"),
                    Contains("keys[0]: the size of a camera stays"));
  CHECK_THROWS_WITH(read(R"("cameras": {"a": {"keys": [{"frame": 1, "fov": 3}]}})"),
                    Contains("keys[0]: camera: unknown member \"fov\""));
  CHECK_THROWS_WITH(read(R"("cameras": [])"), Contains("cameras must be an object"));
  CHECK_THROWS_WITH(read(R"("cameras": {"": {}})"), Contains("a name of cameras is empty"));
}

TEST_CASE("sequence: a picture by a camera of a file is that by the camera itself",
          "[integration][sequence]") {
  Scene scene;
  scene.dir.file("a.scene.json", R"({"ptcx_scene": 1, "cameras": {
    "still": {"position": [1, 3, 2], "look_at": [0, 0, 0]},
    "fly": {"vertical_fov": 0.7, "width": 40, "height": 24, "keys": [
      {"frame": 0, "position": [2, 2, 3], "look_at": [0, 0.25, 0]},
      {"frame": 4, "position": [4, 2, 3], "look_at": [0, 0.25, 0]}]}}})");
  const RenderRequest by_hand = scene.request;
  scene.request.camera.reset();
  scene.request.camera_files = {scene.path("a.scene.json")};
  scene.request.camera_name = "fly";
  scene.request.sequence = SequenceRequest{.frames = {0, 2, 2}};
  scene.render({"fly.#.png"});
  scene.request.sequence.reset();
  scene.render({"fly.png"});  // its first key
  scene.request.camera_name = "";
  scene.render({"first.png"});  // in the order of their names

  const Image fly2 = read_image(scene.path("fly.2.png"));
  scene.request = by_hand;
  scene.request.camera = Camera{.position = {3, 2, 3}, .look_at = {0, 0.25, 0}};
  scene.render({"hand.png"});
  const Image hand = read_image(scene.path("hand.png"));
  double sum = 0;
  for (std::size_t k = 0; k < hand.pixels.size(); ++k)
    sum += glm::length(glm::dvec3(fly2.pixels[k] - hand.pixels[k]));
  CHECK(sum / static_cast<double>(hand.pixels.size()) < 0.02);  // exposure is that of frame 0
  CHECK(same_bytes(scene.path("fly.png"), scene.path("fly.0.png")));
  CHECK(same_bytes(scene.path("first.png"), scene.path("fly.0.png")));

  scene.request.camera.reset();
  scene.request.camera_files = {scene.path("a.scene.json")};
  scene.request.camera_name = "Fly";
  CHECK_THROWS_WITH(scene.render({"x.png"}),
                    "no camera has the name \"Fly\": there are \"fly\", \"still\"");
  scene.request.camera_files.clear();
  CHECK_THROWS_WITH(scene.render({"x.png"}), "no camera has the name \"Fly\": the files name none");
}

TEST_CASE("sequence: all frames have the curve of the first one", "[integration][sequence]") {
  Scene scene;
  LightRig rig;  // a sky whose sun is seen
  rig.sky.radiance = glm::vec3(0.1F);
  rig.points = {{.position = {0.5, 0.52, 0.5}, .intensity = glm::vec3(2)}};
  scene.request.lights = rig;
  scene.request.sequence = SequenceRequest{.frames = {1, 2}, .turntable = 1};
  const LightingReport report = scene.render({"a#.png"});
  CHECK(same_bytes(scene.path("a1.png"), scene.path("a2.png")));
  REQUIRE(report.exposure);
  scene.request.exposure = report.exposure;
  scene.request.sequence->frames = {1, 1};
  scene.render({"b#.png"});
  CHECK_FALSE(same_bytes(scene.path("a1.png"), scene.path("b1.png")));  // there was a curve
}

TEST_CASE("sequence: what moves is seen by one camera, whichever that is",
          "[integration][sequence]") {
  Scene scene;
  const auto moving = scene.dir.file("a.scene.json", R"({"ptcx_scene": 1, "objects": [
    {"file": "squares.obj"},
    {"file": "squares.obj", "scale": 0.1, "keys": [
      {"frame": 1, "translate": [0, 1, 0]}, {"frame": 2, "translate": [0, 9, 0]}]}]})");
  scene.request.camera.reset();
  scene.request.meshes.clear();
  scene.request.scene = moving;
  scene.request.sampling.count = 2000;
  scene.request.exposure = 0;
  scene.request.sequence = SequenceRequest{.frames = {1, 2}};
  render_picture(scene.request, std::vector<PictureTarget>{{scene.path("a#.png"), "albedo"}},
                 scene.notes);
  // Where the small one never is, the picture stays the same
  const Image first = read_image(scene.path("a1.png")), second = read_image(scene.path("a2.png"));
  double same = 0, seen = 0;
  for (std::size_t i = 0; i < first.pixels.size(); ++i) {
    same += glm::distance(first.pixels[i], second.pixels[i]) < 0.01F;
    seen += first.pixels[i].g > 0.4F;
  }
  CHECK(same > 0.98 * static_cast<double>(first.pixels.size()));
  CHECK(seen > 0.2 * static_cast<double>(first.pixels.size()));
}

TEST_CASE("sequence: turns begin and end without an axis", "[integration][sequence]") {
  Scene scene;
  const auto place_at = [&](const std::string& keys, double frame) {
    const auto file = scene.dir.file("a.scene.json", R"({"ptcx_scene": 1, "objects": [
      {"file": "squares.obj", "keys": [)" + keys + "]}]}");
    const SceneObjects scene_at =
        read_scene_objects({file}, nullptr, 1 << 30, Moment{.frame = frame});
    CHECK(scene_at.moves);
    return scene_at.objects.at(0).places.at(0);
  };
  const auto turns = [&](const std::string& keys, const glm::dvec3& y_to) {
    CHECK(glm::length(place_at(keys, 2)[1] - y_to) < 1e-12);
  };
  // Half of a turn around x takes y to -y, a quarter to z
  turns(R"({"frame": 1}, {"frame": 3, "rotate": [1, 0, 0, 360]})", {0, -1, 0});
  turns(R"({"frame": 1, "rotate": [1, 0, 0, 360]}, {"frame": 3})", {0, -1, 0});
  turns(R"({"frame": 1}, {"frame": 3, "rotate": [-2, 0, 0, -180]})", {0, 0, 1});
  turns(R"({"frame": 1, "rotate": [1, 0, 0, 10]}, {"frame": 3, "rotate": [-1, 0, 0, -350]})",
        {0, -1, 0});
  turns(R"({"frame": 1}, {"frame": 3})", {0, 1, 0});
}

TEST_CASE("sequence: objects of a scene file move between their keys", "[integration][sequence]") {
  Scene scene;
  scene.dir.file("square.obj", "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n");
  const auto file = [&](const char* name, const std::string& of_second) {
    return scene.dir.file(name, R"({"ptcx_scene": 1, "objects": [{"file": "square.obj"},
      {"file": "square.obj", "scale": 0.5, )" +
                                    of_second + "}]}");
  };
  const auto moving = file("moving.scene.json", R"("rotate": [0, 1, 0, 90], "keys": [
    {"frame": 1, "translate": [0, 0.5, 0], "rotate": [0, 1, 0, 0]},
    {"frame": 3, "translate": [1, 0.5, 0], "rotate": [0, 1, 0, 360]},
    {"frame": 4, "translate": [1, 1.5, 0], "rotate": [1, 0, 0, 90]},
    {"frame": 6, "translate": [1, 1.5, 0]}])");
  const std::array<const char*, 6> places{
      R"("translate": [0, 0.5, 0])", R"("translate": [0.5, 0.5, 0], "rotate": [0, 1, 0, 180])",
      R"("translate": [1, 0.5, 0], "rotate": [0, 1, 0, 360])",
      R"("translate": [1, 1.5, 0], "rotate": [1, 0, 0, 90])",
      // Half way between a quarter turn around x and one around y
      R"("translate": [1, 1.5, 0], "rotate": [1, 1, 0, 70.52877936550931])",
      R"("translate": [1, 1.5, 0], "rotate": [0, 1, 0, 90])"};
  scene.request.meshes.clear();
  scene.request.sampling.count = 2000;
  scene.request.exposure = 0;
  scene.request.scene = moving;
  scene.request.sequence = SequenceRequest{.frames = {1, 6}};
  const LightingReport all = scene.render({"all.#.exr"});
  scene.request.sequence.reset();
  std::uint64_t receivers = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    scene.request.scene = file("still.scene.json", places[i]);
    receivers += scene.render({"still.exr"}).receivers;
    const Image moved = read_image(scene.path("all." + std::to_string(i + 1) + ".exr"));
    const Image still = read_image(scene.path("still.exr"));
    double sum = 0;  // places that are rounded otherwise move edges by a hair
    for (std::size_t k = 0; k < still.pixels.size(); ++k)
      sum += glm::length(glm::dvec3(moved.pixels[k] - still.pixels[k]));
    INFO("frame " << i + 1);
    CHECK(sum / static_cast<double>(still.pixels.size()) < 2e-3);
  }
  CHECK(std::abs(static_cast<double>(all.receivers) - static_cast<double>(receivers)) <
        0.01 * static_cast<double>(receivers));

  // One picture shows the first keys
  scene.request.scene = moving;
  scene.render({"first.exr"});
  CHECK(same_bytes(scene.path("first.exr"), scene.path("all.1.exr")));
  const auto fault = [&](const std::string& members) {
    scene.request.scene = file("x.scene.json", members);
    try {
      scene.render({"x.exr"});
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK_THAT(fault(R"("keys": {})"), Contains("objects[1]: keys must be an array"));
  CHECK_THAT(fault(R"("keys": [{}])"), Contains("keys[0]: frame must be a number"));
  CHECK_THAT(fault(R"("keys": [3])"), Contains("objects[1]: keys[0]"));
  CHECK_THAT(fault(R"("keys": [{"frame": 2}, {"frame": 1}])"), Contains("keys[1]: frame must be"));
  CHECK_THAT(fault(R"("keys": [{"frame": 2}], "matrix": [1,0,0,0,0,1,0,0,0,0,1,0])"),
             Contains("keys excludes matrix"));
  CHECK_THAT(fault(R"("keys": [{"frame": 2}], "placements": [{}])"),
             Contains("keys excludes placements"));
  CHECK_THAT(fault(R"("keys": [{"frame": 2, "scale": 0}])"),
             Contains("keys[0]: the place cannot be inverted"));
}

TEST_CASE("sequence: animations of glTF are seen at the times of frames",
          "[integration][sequence]") {
  Scene scene;
  // A triangle that faces up and rises by 1 in 2 seconds, and a camera that stands
  const std::array<float, 9> corners{-1, 0, -1, -1, 0, 1, 1, 0, 1};
  const std::array<float, 8> keys{0, 2, 0, 0, 0, 0, 1, 0};
  scene.dir.file("a.bin", std::string(reinterpret_cast<const char*>(corners.data()), 36) +
                              std::string(reinterpret_cast<const char*>(keys.data()), 32));
  const auto file = [&](const char* name, const std::string& node, const std::string& animations) {
    return scene.dir.file(name, R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0, 1]}],
      "nodes": [{"mesh": 0)" + node +
                                    R"(}, {"camera": 0, "name": "shot", "translation": [0, 1, 5]}],
      "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
      "buffers": [{"uri": "a.bin", "byteLength": 68}],
      "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 8},
                      {"buffer": 0, "byteOffset": 44, "byteLength": 24}],
      "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1,0,-1], "max": [1,0,1]},
        {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [2]},
        {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}])" +
                                    animations + "}");
  };
  const std::string animations = R"(, "animations": [{
      "samplers": [{"input": 1, "output": 2}],
      "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}])";
  const auto moving = file("moving.gltf", "", animations);
  scene.request.camera.reset();
  scene.request.camera_name = "shot";
  scene.request.meshes.clear();
  scene.request.sampling.count = 500;
  scene.request.exposure = 0;
  scene.request.scene = moving;
  scene.request.sequence = SequenceRequest{.frames = {0, 40, 10}, .frames_per_second = 20};
  scene.render({"all.##.exr"});
  scene.request.sequence.reset();
  for (const int frame : {0, 10, 20, 30, 40}) {  // under the same name, which is in the header
    scene.request.scene =
        file("moving.gltf", R"(, "translation": [0, )" + std::to_string(frame / 40.0) + ", 0]", "");
    scene.render({"still.exr"});
    INFO("frame " << frame);
    CHECK(same_bytes(scene.path("still.exr"), *frame_name(scene.path("all.##.exr"), frame)));
  }

  // A container stands still, which is told
  file("moving.gltf", "", animations);
  BuildRequest build{.inputs = {moving}};
  build.sampling.count = 500;
  build_container(build, scene.path("b.ptcx"), scene.notes);
  scene.notes.texts.clear();
  scene.request.scene = scene.path("b.ptcx");
  scene.request.meshes = {moving};
  scene.request.sequence = SequenceRequest{.frames = {0, 0}};
  scene.render({"b#.exr"});
  REQUIRE(scene.notes.texts.size() == 1);
  CHECK_THAT(scene.notes.texts[0], Contains("the meshes move, but the container does not"));
}

TEST_CASE("sequence: what contradicts itself is refused", "[integration][sequence]") {
  Scene scene;
  scene.request.sequence = SequenceRequest{.frames = {1, 3}};
  CHECK_THROWS_WITH(scene.render({"a.png"}), Contains("needs a mark for the number of the frame"));
  scene.request.camera_name = "a";
  CHECK_THROWS_WITH(scene.render({"a#.png"}), "`camera_name` and a camera exclude each other");
  scene.request.camera_name = "";
  scene.request.sequence->frames = {3, 1};
  CHECK_THROWS_WITH(scene.render({"a#.png"}), Contains("comes before the first"));
  scene.request.sequence->frames = {1, 3, 0};
  CHECK_THROWS_WITH(scene.render({"a#.png"}), Contains("step"));
  scene.request.sequence->frames = {1, 200'000};
  CHECK_THROWS_WITH(scene.render({"a#.png"}), Contains("more than 100,000"));
  scene.request.sequence->frames = {1, 3};
  scene.request.sequence->frames_per_second = 0;
  CHECK_THROWS_WITH(scene.render({"a#.png"}), Contains("frames_per_second"));
  scene.request.sequence->frames_per_second = 24;
  CHECK_THROWS_WITH(scene.render({"a.#.exr", "a.%d.exr"}), Contains("is the name of two pictures"));
  scene.request.sequence->frames = {9, 10};
  CHECK_THROWS_WITH(scene.render({"a.#.exr", "a.##.exr"}),
                    Contains("a.10.exr is the name of two pictures"));
  scene.dir.file("squares10.exr", "");
  scene.request.camera_files = {scene.path("squares10.exr")};
  CHECK_THROWS_WITH(scene.render({"squares#.exr"}), Contains("squares10.exr is read by this run"));
  scene.request.camera_files.clear();
  scene.request.glossy.roughness = 0.5F;
  scene.request.check.receivers = 10;
  CHECK_THROWS_WITH(scene.render({"a#.png"}), Contains("compares reflections of one picture"));
  scene.request.glossy.roughness.reset();
  scene.request.check.receivers = 0;
  scene.request.texture = TextureTarget{};
  CHECK_THROWS_WITH(scene.render({"a#.exr"}), Contains("what is baked has none"));
  scene.request.sequence.reset();
  CHECK_THROWS_WITH(scene.render({"a.exr"}), Contains("`camera` is for pictures"));
}
