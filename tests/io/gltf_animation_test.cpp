// Animations of glTF: where nodes stand at a time.
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Json = nlohmann::json;

namespace {

using Numbers = std::vector<float>;
const auto kHalf = static_cast<float>(std::sqrt(0.5));

// A file of nodes: 0 shows a triangle (0 0 0, 1 0 0, 0 1 0), 1 a camera.
class Scene {
 public:
  Json json = Json::parse(R"({
    "asset": {"version": "2.0"},
    "nodes": [{"mesh": 0}, {"camera": 0, "name": "eye"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "cameras": [{"perspective": {"yfov": 0.8}, "name": "lens"}]})");

  Scene() { add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0}); }

  // Adds an accessor of bytes and returns its index.
  std::size_t add(std::size_t components, std::size_t count, unsigned type, std::string bytes) {
    constexpr std::array kTypes{"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    bytes.resize((bytes.size() + 3) / 4 * 4);
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", bytes.size()}});
    bytes_ += bytes;
    json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                                 {"componentType", type},
                                 {"count", count},
                                 {"type", kTypes[components]}});
    return json["accessors"].size() - 1;
  }
  std::size_t add_floats(std::size_t components, const Numbers& numbers) {
    std::string bytes;
    for (const float number : numbers) bytes += raw(number);
    return add(components, numbers.size() / components, 5126, bytes);
  }

  // Adds an animation of one channel and returns it.
  Json& animate(int node, const char* path, const char* interpolation, std::size_t input,
                std::size_t output) {
    json["animations"].push_back(
        {{"channels", {{{"sampler", 0}, {"target", {{"node", node}, {"path", path}}}}}},
         {"samplers", {{{"input", input}, {"output", output}, {"interpolation", interpolation}}}}});
    return json["animations"].back();
  }
  Json& animate(int node, const char* path, const char* interpolation, const Numbers& times,
                const Numbers& values) {
    const std::size_t input = add_floats(1, times);
    return animate(node, path, interpolation, input,
                   add_floats(std::string_view(path) == "rotation" ? 4 : 3, values));
  }

  std::filesystem::path write() {
    json["buffers"] = {{{"uri", "a.bin"}, {"byteLength", bytes_.size()}}};
    scratch_.file("a.bin", bytes_);
    return scratch_.file("a.gltf", json.dump());
  }
  MeshFile read(std::optional<double> seconds) {
    MeshRoom room;
    room.seconds = seconds;
    return read_mesh(write(), room);
  }
  CameraFile cameras(std::optional<double> seconds) {
    return read_cameras(write(), seconds, 1 << 20);
  }
  std::string fault(std::optional<double> seconds = 0) {
    return refusal([&] { static_cast<void>(read(seconds)); });
  }
  // Returns a corner of the triangle.
  glm::dvec3 corner(std::size_t k, std::optional<double> seconds) {
    const Mesh mesh = read(seconds).mesh;
    return mesh.origin + glm::dvec3(mesh.positions[mesh.triangles[0][k]]);
  }

 private:
  test::TemporaryDirectory scratch_;
  std::string bytes_;
};

bool near(const glm::dvec3& a, const glm::dvec3& b) {
  return glm::distance(a, b) < 1e-6;
}

}  // namespace

TEST_CASE("gltf animation: straight lines between keys, and the keys themselves at either end",
          "[io][gltf]") {
  Scene scene;
  scene.json["nodes"][0]["translation"] = {9, 9, 9};
  scene.animate(0, "translation", "LINEAR", {1, 2, 4}, {0, 0, 0, 10, 0, 2, 10, 8, 2});
  scene.json["animations"][0]["samplers"][0].erase("interpolation");  // which is the default
  CHECK(near(scene.corner(0, {}), {9, 9, 9}));
  for (const auto& [seconds, x, y, z] : std::vector<std::array<double, 4>>{{-1, 0, 0, 0},
                                                                           {0, 0, 0, 0},
                                                                           {1, 0, 0, 0},
                                                                           {1.25, 2.5, 0, 0.5},
                                                                           {2, 10, 0, 2},
                                                                           {3, 10, 4, 2},
                                                                           {3.5, 10, 6, 2},
                                                                           {4, 10, 8, 2},
                                                                           {1e9, 10, 8, 2}}) {
    CAPTURE(seconds);
    CHECK(near(scene.corner(0, seconds), {x, y, z}));
  }
  const MeshFile file = scene.read({});
  CHECK(file.moves_mesh);
  CHECK(file.animation_seconds == 4);
  CHECK(file.warnings.empty());
}

TEST_CASE("gltf animation: steps hold a key until the next one", "[io][gltf]") {
  Scene scene;
  const auto third = static_cast<float>(1.0 / 3);  // rounded up
  scene.animate(0, "scale", "STEP", {0, third, third, 2}, {1, 1, 1, 2, 1, 1, 3, 1, 1, 4, 1, 1});
  for (const auto& [seconds, x] : std::vector<std::array<double, 2>>{
           {-1, 1}, {0.33, 1}, {1.0 / 3, 3}, {1.99, 3}, {2, 4}, {3, 4}}) {
    CAPTURE(seconds);
    CHECK(near(scene.corner(1, seconds), {x, 0, 0}));
  }
  Scene frames;  // the time of a frame in double shows that frame, whichever is less
  Numbers times, values;
  for (int i = 0; i < 48; ++i) {
    times.push_back(static_cast<float>(i / 24.0));
    values.insert(values.end(), {static_cast<float>(i), 0, 0});
  }
  frames.animate(0, "translation", "STEP", times, values);
  for (int i = 0; i < 48; ++i) CHECK(near(frames.corner(0, i / 24.0), {i, 0, 0}));
}

TEST_CASE("gltf animation: rotations take the shortest way at a constant rate", "[io][gltf]") {
  Scene scene;
  // A quarter turn about z, whose second key is the same rotation with the other sign, and back
  scene.animate(0, "rotation", "LINEAR", {0, 1, 2}, {0, 0, 0, 1, 0, 0, -kHalf, -kHalf, 0, 0, 0, 3});
  for (const double t : {0.0, 0.1, 0.25, 0.5, 0.9, 1.0, 1.5, 1.75, 2.0, 7.0}) {
    CAPTURE(t);
    const double angle = std::numbers::pi / 2 * (t <= 1 ? t : t <= 2 ? 2 - t : 0);
    CHECK(near(scene.corner(1, t), {std::cos(angle), std::sin(angle), 0}));
  }
}

TEST_CASE("gltf animation: rotations may be normalised integers", "[io][gltf]") {
  Scene scene;
  std::string bytes;
  for (const int i : {0, 0, 0, 127, 0, 0, 90, 90}) bytes += raw(static_cast<std::int8_t>(i));
  const std::size_t times = scene.add_floats(1, {0, 1});
  const std::size_t values = scene.add(4, 2, 5120, bytes);
  scene.animate(0, "rotation", "LINEAR", times, values);
  CHECK_THAT(scene.fault(), Contains("animation 0: sampler 0 has values that are neither floats "
                                     "nor normalised rotations"));
  scene.json["accessors"][values]["normalized"] = true;
  CHECK(near(scene.corner(1, 1), {0, 1, 0}));
  const double eighth = std::numbers::pi / 4;
  CHECK(near(scene.corner(1, 0.5), {std::cos(eighth), std::sin(eighth), 0}));
}

TEST_CASE("gltf animation: cubic splines go through their keys with their tangents", "[io][gltf]") {
  Scene scene;
  // x = t^3 - 2 t and y = t^2 on [1, 3], which a cubic gives exactly; the outer tangents are unused
  const Numbers values{99, 99, 99, -1, 1, 0, 1, 2, 0, 25, 6, 0, 21, 9, 0, 77, 77, 77};
  scene.animate(0, "translation", "CUBICSPLINE", {1, 3}, values);
  for (const double t : {1.0, 1.3, 2.0, 2.75, 3.0}) {
    CAPTURE(t);
    const double at = static_cast<float>(t);
    CHECK(near(scene.corner(0, t), {at * at * at - 2 * at, at * at, 0}));
  }
  CHECK(near(scene.corner(0, 0), {-1, 1, 0}));
  CHECK(near(scene.corner(0, 4), {21, 9, 0}));

  // A rotation becomes of unit length: half way, without tangents, it is the mean of both
  Scene turn;
  turn.animate(0, "rotation", "CUBICSPLINE", {0, 1},
               {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, kHalf, kHalf, 0, 0, 0, 0});
  const double eighth = std::numbers::pi / 4;
  CHECK(near(turn.corner(1, 0.5), {std::cos(eighth), std::sin(eighth), 0}));

  // One key is a value for all times
  Scene one;
  one.animate(0, "translation", "CUBICSPLINE", {1}, {5, 5, 5, 1, 2, 3, 5, 5, 5});
  CHECK(near(one.corner(0, 0), {1, 2, 3}));
  CHECK(near(one.corner(0, 2), {1, 2, 3}));
}

TEST_CASE("gltf animation: parents carry their children, and animations act together",
          "[io][gltf]") {
  Scene scene;
  scene.json["nodes"] = Json::parse(R"([
    {"mesh": 0, "translation": [1, 0, 0]}, {"camera": 0, "translation": [0, 0, 5]},
    {"children": [0, 1], "scale": [2, 2, 2]}])");
  scene.animate(2, "rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, kHalf, kHalf});
  scene.animate(2, "translation", "LINEAR", {0, 2}, {0, 0, 0, 0, 0, 4});
  scene.animate(0, "scale", "STEP", {0, 0.5}, {1, 1, 1, 3, 1, 1});
  // Of two animations that move one property, the first one counts
  scene.animate(2, "translation", "LINEAR", {0, 9}, {7, 7, 7, 8, 8, 8});
  CHECK(near(scene.corner(0, 1), {0, 2, 2}));
  CHECK(near(scene.corner(1, 1), {0, 8, 2}));
  const MeshFile file = scene.read(1);
  REQUIRE(file.cameras.size() == 1);
  CHECK(near(file.cameras[0].position, {0, 0, 12}));
  CHECK(near(file.cameras[0].up, {-1, 0, 0}));
  CHECK(file.moves_mesh);
  CHECK(file.animation_seconds == 2);
  REQUIRE(file.warnings.size() == 1);
  CHECK(file.warnings[0] ==
        "a part of an animation is left out: animation 3: channel 0 has the target of another: "
        "translation of node 2");
}

TEST_CASE("gltf animation: cameras are read alone, as with the meshes", "[io][gltf]") {
  Scene scene;
  scene.animate(1, "translation", "LINEAR", {0, 2}, {0, 0, 0, 8, 0, 0});
  scene.animate(1, "rotation", "LINEAR", {0, 2}, {0, 0, 0, 1, 0, kHalf, 0, kHalf});
  for (const std::optional<double> seconds : {std::optional<double>(), {0}, {1}, {2}, {3}}) {
    const MeshFile whole = scene.read(seconds);
    const CameraFile alone = scene.cameras(seconds);
    REQUIRE(whole.cameras.size() == 1);
    REQUIRE(alone.cameras.size() == 1);
    CHECK(alone.cameras[0].name == "eye");
    CHECK(whole.cameras[0].name == "eye");
    CHECK(alone.cameras[0].position == whole.cameras[0].position);
    CHECK(alone.cameras[0].forward == whole.cameras[0].forward);
    const double t = std::min(seconds.value_or(0), 2.0), angle = t * std::numbers::pi / 4;
    CHECK(near(alone.cameras[0].position, {4 * t, 0, 0}));
    CHECK(near(alone.cameras[0].forward, {-std::sin(angle), 0, -std::cos(angle)}));
    CHECK_FALSE(alone.moves_mesh);
    CHECK_FALSE(whole.moves_mesh);
    CHECK(alone.animation_seconds == 2);
    CHECK(whole.animation_seconds == 2);
  }
  // Meshes are not even looked at
  scene.json["meshes"] = Json::array();
  scene.json["nodes"][1].erase("name");
  CHECK(scene.cameras(1).cameras.at(0).name == "lens");
  scene.json["cameras"][0].erase("name");
  CHECK(scene.cameras(1).cameras.at(0).name.empty());
  CHECK(read_cameras("none.obj", 1, 1 << 20).cameras.empty());
  CHECK_THROWS_AS(read_cameras(scene.write(), 1, 100), LimitError);
}

TEST_CASE("gltf animation: a mesh moves if a node above it has a key of another pose",
          "[io][gltf]") {
  const auto moves = [](const Json& node, const char* path, const char* how,
                        const Numbers& values) {
    Scene scene;
    scene.json["nodes"][0].update(node);
    Numbers times;
    const std::size_t keys = values.size() / (std::string_view(path) == "rotation" ? 4 : 3) /
                             (std::string_view(how) == "CUBICSPLINE" ? 3 : 1);
    for (std::size_t i = 0; i < keys; ++i) times.push_back(static_cast<float>(i));
    scene.animate(0, path, how, times, values);
    CHECK(scene.cameras(1).moves_mesh == scene.read({}).moves_mesh);
    return scene.read({}).moves_mesh;
  };
  const Json at{{"translation", {0.1, 2, 3}}}, turned{{"rotation", {0, 0, 0.6, 0.8}}};
  CHECK_FALSE(moves(at, "translation", "LINEAR", {0.1F, 2, 3, 0.1F, 2, 3}));
  CHECK(moves(at, "translation", "LINEAR", {0.1F, 2, 3, 0.1F, 2, 3.001F}));
  CHECK(moves(at, "translation", "STEP", {0.2F, 2, 3, 0.2F, 2, 3}));
  CHECK_FALSE(moves(at, "translation", "CUBICSPLINE", {0, 0, 0, 0.1F, 2, 3, 0, 0, 0}));
  CHECK(moves(at, "translation", "CUBICSPLINE", {0, 0, 0, 0.1F, 2, 3, 0, 0, 1}));
  CHECK_FALSE(moves(turned, "rotation", "LINEAR", {0, 0, 0.6F, 0.8F, 0, 0, -0.6F, -0.8F}));
  CHECK(moves(turned, "rotation", "LINEAR", {0, 0, 0.6F, 0.8F, 0, 0.001F, 0.6F, 0.8F}));
  CHECK_FALSE(moves(Json::object(), "scale", "LINEAR", {1, 1, 1}));

  // A light below, and a node that no scene shows
  Scene scene;
  scene.json["nodes"] = Json::parse(R"([
    {"mesh": 0}, {"children": [2]}, {"extensions": {"KHR_lights_punctual": {"light": 0}}},
    {"mesh": 0}])");
  scene.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::parse(R"([{"type": "point"}])");
  scene.json["scenes"] = Json::parse(R"([{"nodes": [0, 1]}])");
  scene.animate(3, "translation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0});
  CHECK_FALSE(scene.read(1).moves_mesh);
  CHECK(scene.read(1).animation_seconds == 0);
  scene.animate(1, "translation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0});
  const MeshFile file = scene.read(1);
  CHECK(file.moves_mesh);
  REQUIRE(file.lights.size() == 1);
  CHECK(near(file.lights[0].position, {1, 0, 0}));
}

TEST_CASE("gltf animation: weights are told once for each node, and what extensions move is not",
          "[io][gltf]") {
  Scene scene;
  const std::size_t input = scene.add_floats(1, {0, 1}), output = scene.add_floats(1, {0, 1});
  scene.animate(0, "weights", "LINEAR", input, output);
  scene.animate(0, "weights", "LINEAR", input, output);
  scene.animate(0, "pointer", "LINEAR", input, output)["channels"][0]["target"].erase("node");
  for (const std::optional<double> seconds : {std::optional<double>(), {1}}) {
    const MeshFile file = scene.read(seconds);
    CHECK_FALSE(file.moves_mesh);
    CHECK(file.animation_seconds == 0);
    REQUIRE(file.warnings.size() == 1);
    CHECK(file.warnings[0] ==
          "an animation of morph targets is left out and its mesh keeps the "
          "shape in which it is stored: node 0");
  }
}

TEST_CASE("gltf animation: one that breaks a rule is an error at a time, else a warning",
          "[io][gltf]") {
  const auto with = [](const char* pointer, const Json& value) {
    Scene scene;
    scene.animate(0, "translation", "LINEAR", {0, 1, 2}, {0, 0, 0, 1, 0, 0, 2, 0, 0});
    Json::json_pointer at(pointer);
    if (value.is_null()) {
      scene.json[at.parent_pointer()].erase(at.back());
    } else {
      scene.json[at] = value;
    }
    const std::string fault = scene.fault();
    const MeshFile file = scene.read({});
    REQUIRE(file.warnings.size() == 1);
    CHECK(near(scene.corner(0, {}), {0, 0, 0}));
    // The warning has the words of the error but the name of the file
    const std::string told = file.warnings[0].substr(file.warnings[0].find(": ") + 2);
    CHECK(fault == scene.write().string() + ": " + told);
    return fault;
  };
  const std::string channel = "/animations/0/channels/0", sampler = "/animations/0/samplers/0";
  CHECK_THAT(with("/animations/0", 5), Contains("animations holds a value that is not an object"));
  CHECK_THAT(with("/animations/0/channels", {}), Contains("animation 0 has no channels"));
  CHECK_THAT(with(channel.c_str(), 1), Contains("has a channel that is not an object"));
  CHECK_THAT(with((channel + "/target").c_str(), {}), Contains("channel 0 has no target"));
  CHECK_THAT(with((channel + "/target/path").c_str(), 1), Contains("channel 0 has no target"));
  CHECK_THAT(with((channel + "/target/node").c_str(), 2),
             Contains("animation 0: channel 0 moves node 2, which does not exist"));
  CHECK_THAT(with((channel + "/target/node").c_str(), -1), Contains("not an unsigned integer"));
  CHECK_THAT(with((channel + "/sampler").c_str(), {}), Contains("channel 0 has no sampler"));
  CHECK_THAT(with((channel + "/sampler").c_str(), 1), Contains("sampler 1 does not exist"));
  CHECK_THAT(with("/animations/0/samplers", {}), Contains("sampler 0 does not exist"));
  CHECK_THAT(with((sampler + "/input").c_str(), {}), Contains("sampler 0 lacks its input"));
  CHECK_THAT(with((sampler + "/output").c_str(), {}), Contains("sampler 0 lacks its input or"));
  CHECK_THAT(with((sampler + "/input").c_str(), 9), Contains("accessors has no entry 9"));
  CHECK_THAT(with((sampler + "/output").c_str(), 1), Contains("accessor 1 is of the wrong type"));
  CHECK_THAT(with((sampler + "/output").c_str(), 9), Contains("accessors has no entry 9"));
  CHECK_THAT(with((sampler + "/interpolation").c_str(), "EASE"), Contains("neither LINEAR"));
  CHECK_THAT(with((sampler + "/interpolation").c_str(), "CUBICSPLINE"),
             Contains("sampler 0 has 3 times, but 3 values"));
  CHECK_THAT(with("/accessors/1/count", 2), Contains("has 2 times, but 3 values"));
  CHECK_THAT(with("/accessors/1/count", 0), Contains("accessor 1 has no times"));
  CHECK_THAT(with("/accessors/1/count", 4), Contains("accessor 1 reaches past its bufferView"));
  CHECK_THAT(with("/accessors/2/count", 4), Contains("accessor 2 reaches past its bufferView"));
  CHECK_THAT(with("/accessors/1/componentType", 5125), Contains("has times that are not floats"));
  CHECK_THAT(with("/accessors/2/componentType", 5121), Contains("neither floats nor"));
  CHECK_THAT(with("/nodes/0/matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}),
             Contains("node 0 has a matrix, and animation 0 moves it"));

  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto keys = [](const Numbers& times, const Numbers& values) {
    Scene scene;
    scene.animate(0, "scale", "LINEAR", times, values);
    return scene.fault();
  };
  const Numbers ones(9, 1);
  CHECK(keys({0, 1, 1}, ones).empty());
  CHECK_THAT(keys({0, 2, 1}, ones), Contains("accessor 1 has times that decrease"));
  CHECK_THAT(keys({0, 1, kInfinite}, ones), Contains("accessor 1 has a time that is not finite"));
  CHECK_THAT(keys({kNan, 1, 2}, ones), Contains("accessor 1 has a time that is not finite"));
  CHECK_THAT(keys({0, 1}, {1, 1, 1, 1, kNan, 1}), Contains("has a value that is not finite"));
}

TEST_CASE("gltf animation: a small file cannot name very many keys", "[io][gltf]") {
  Scene scene;
  const std::size_t input = scene.add_floats(1, Numbers(20000));
  const std::size_t output = scene.add_floats(3, Numbers(60000));
  const Json view = scene.json["accessors"][input];
  for (int i = 0; i < 3000; ++i) {
    scene.json["nodes"].push_back(Json::object());
    scene.json["accessors"].push_back(view);
    scene.animate(i + 2, "translation", "LINEAR", scene.json["accessors"].size() - 1, output);
  }
  CHECK_THAT(scene.fault(), Contains("repeat keys to more than this program accepts"));
}
