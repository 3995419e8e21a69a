// Scenes that move: what stands still is sampled once, and lit as each moment asks for.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/pipeline/build/moving_scene.h"
#include "engine/pipeline/render/render_picture.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

constexpr char kStillStage[] = "sample and light what stands still";

// Counts the stages in which what stands still is sampled.
class StillStages : public Progress {
 public:
  void begin(const std::string& stage, std::uint64_t /*total*/,
             const std::string& /*unit*/) override {
    count += stage == kStillStage ? 1 : 0;
  }
  int count = 0;
};

// A square of side 2 that faces up, and a box of side 2 around the origin that looks outwards.
constexpr char kSquare[] = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n";
constexpr char kBox[] =
    "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n"
    "f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n";

// A scene file, of which containers are built as a whole and in parts.
struct Scene {
  test::TemporaryDirectory dir;
  StillStages progress;
  BuildRequest request;
  MovingScene moving{dir.path()};

  Scene() {
    dir.file("square.obj", kSquare);
    dir.file("box.obj", kBox);
    LightRig rig;  // a sun overhead
    rig.suns = {{.to_sun = {0, 1, 0}, .irradiance = glm::vec3(3), .angular_radius = 0}};
    request.lights = rig;
    request.sampling.count = 20'000;
    request.profile = Profile::exact;
  }
  void objects(const std::string& list) {
    request.inputs = {dir.file("a.scene.json", R"({"ptcx_scene": 1, "materials": {
      "lamp": {"albedo": [0, 0, 0], "emission": [5, 5, 5]}}, "objects": [)" +
                                                   list + "]}")};
  }
  [[nodiscard]] std::filesystem::path path(const std::string& name) const {
    return dir.path() / name;
  }
  void build(double frame) {
    request.moment = Moment{.frame = frame};
    build_container(request, path("whole.ptcx"), progress);
    moving.build(request, path("parts.ptcx"), progress);
  }
};

// The light that the surfels of the floor reflect, as means over 8 x 8 cells.
std::vector<double> floor_light(const std::filesystem::path& container) {
  constexpr int kCells = 8;
  std::vector<double> sums(kCells * kCells), counts(kCells * kCells);
  for (const Surfel& s : test::points_of(container)) {
    if (std::abs(s.position.y) > 0.005 || s.normal.y < 0.5F) continue;
    const auto cell = [](double x) {
      return std::clamp(static_cast<int>((x + 1) / 2 * kCells), 0, kCells - 1);
    };
    const auto at = static_cast<std::size_t>(cell(s.position.z) * kCells + cell(s.position.x));
    sums[at] += static_cast<double>(s.radiance.g);
    counts[at] += 1;
  }
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] /= std::max(counts[i], 1.0);
  return sums;
}

// The root mean square of the difference of both, over the brightest one.
double difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  const double brightest = *std::ranges::max_element(b);
  REQUIRE(brightest > 0);
  return std::sqrt(sum / static_cast<double>(a.size())) / brightest;
}

constexpr char kFloor[] = R"({"file": "square.obj", "one_sided": true}, )";
constexpr char kFlying[] = R"({"file": "square.obj", "scale": 0.3, "keys": [
  {"frame": 1, "translate": [-0.5, 0.3, 0]}, {"frame": 5, "translate": [0.5, 0.3, 0]}]})";

}  // namespace

TEST_CASE("motion: what stands still is sampled once, and each frame is what it is alone",
          "[integration][motion]") {
  Scene scene;
  scene.objects(std::string(kFloor) + kFlying);
  RenderRequest render;
  render.scene = scene.request.inputs[0];
  render.lights = scene.request.lights;
  render.sampling.count = 3000;
  render.camera = Camera{.position = {2, 2, 3}, .look_at = {0, 0.2, 0}};
  render.size = {{32, 24}};
  render.sequence = SequenceRequest{.frames = {1, 5, 2}};
  const auto target = [&](const char* name) {
    return std::vector<PictureTarget>{{scene.path(name)}};
  };
  render_picture(render, target("all.#.exr"), scene.progress);
  CHECK(scene.progress.count == 1);
  for (const std::int64_t frame : {1, 3, 5}) {
    render.sequence->frames = {frame, frame};
    render_picture(render, target("one.#.exr"), scene.progress);
    const std::string number = std::to_string(frame) + ".exr";
    CHECK(test::bytes_of(scene.path("all." + number)) ==
          test::bytes_of(scene.path("one." + number)));
  }
  // Nothing stays behind, also when a frame fails
  std::filesystem::create_directory(scene.path("x.3.exr"));
  render.sequence->frames = {1, 3, 2};
  CHECK_THROWS(render_picture(render, target("x.#.exr"), scene.progress));
  for (const auto& entry : std::filesystem::directory_iterator(scene.dir.path()))
    CHECK(entry.path().extension() != ".ptcx");
}

TEST_CASE("motion: shadows of what moves lie on what stands still", "[integration][motion]") {
  std::string lamp;
  Scene scene;
  scene.objects(std::string(kFloor) + kFlying);
  SECTION("of a sun") {}
  SECTION("of an even sky") {
    scene.request.lights->suns.clear();
    scene.request.lights->sky.radiance = glm::vec3(1);
  }
  SECTION("of a sun and a sky") {
    scene.request.lights->sky.radiance = glm::vec3(0.5F);
  }
  SECTION("of a lamp") {
    scene.request.lights->suns.clear();
    scene.request.lights->points = {{.position = {0, 2, 0}}};
  }
  SECTION("of a surface that emits") {
    lamp = R"(, {"file": "square.obj", "material": "lamp",
      "translate": [0, 1.5, 0], "rotate": [1, 0, 0, 180], "scale": 0.2})";
    scene.objects(std::string(kFloor) + kFlying + lamp);
    scene.request.lights->suns.clear();
  }
  for (const double frame : {1.0, 4.0}) {
    scene.build(frame);
    const auto whole = floor_light(scene.path("whole.ptcx")),
               parts = floor_light(scene.path("parts.ptcx"));
    INFO("frame " << frame);
    CHECK(difference(parts, whole) < 0.03);
  }
  CHECK(scene.progress.count == 1);
  // Without what moves there is no shadow
  scene.objects(std::string(kFloor) + R"({"file": "square.obj", "scale": 0.3, "keys": [
    {"frame": 1, "translate": [0, -5, 0]}, {"frame": 5, "translate": [0, -6, 0]}]})" +
                lamp);
  build_container(scene.request, scene.path("none.ptcx"), scene.progress);
  CHECK(difference(floor_light(scene.path("parts.ptcx")), floor_light(scene.path("none.ptcx"))) >
        0.03);
}

TEST_CASE("motion: surfels whose light nothing changes keep it, and their places",
          "[integration][motion]") {
  Scene scene;
  scene.objects(std::string(kFloor) + kFlying);
  const auto far_points = [&](double frame) {
    scene.build(frame);
    std::vector<Surfel> points = test::points_of(scene.path("parts.ptcx"));
    std::erase_if(points, [](const Surfel& s) { return s.position.z < 0.35; });
    return points;
  };
  const std::vector<Surfel> first = far_points(1), last = far_points(5);
  REQUIRE(first.size() == last.size());
  REQUIRE(first.size() > 5000);
  const auto is_same = [](const Surfel& a, const Surfel& b) {
    return a.position == b.position && a.radiance == b.radiance && a.radius == b.radius;
  };
  CHECK(std::ranges::equal(first, last, is_same));
}

TEST_CASE("motion: what moves and emits lights what stands still", "[integration][motion]") {
  Scene scene;
  scene.request.lights.reset();
  const std::string lamp = R"({"file": "square.obj", "material": "lamp", "scale": 0.2,
    "rotate": [1, 0, 0, 180], "keys": [
    {"frame": 1, "translate": [-0.5, 0.5, 0]}, {"frame": 5, "translate": [0.5, 0.5, 0]}]})";
  SECTION("alone") {
    scene.objects(kFloor + lamp);
  }
  SECTION("in a dark room") {
    scene.objects(R"({"file": "box.obj", "scale": [1, 0.5, 1], "translate": [0, 0.5, 0]}, )" +
                  lamp);
  }
  for (const double frame : {1.0, 4.0}) {
    scene.build(frame);
    const auto whole = floor_light(scene.path("whole.ptcx")),
               parts = floor_light(scene.path("parts.ptcx"));
    INFO("frame " << frame);
    CHECK(*std::ranges::max_element(parts) > 0.1);
    CHECK(difference(parts, whole) < 0.05);
  }
  CHECK(scene.progress.count == 1);
}

TEST_CASE("motion: surfels inside of what moves are left out", "[integration][motion]") {
  Scene scene;
  scene.objects(std::string(kFloor) +
                R"({"file": "box.obj", "one_sided": true, "scale": 0.4, "keys": [
    {"frame": 1, "translate": [-0.5, 0.2, 0]}, {"frame": 5, "translate": [0.5, 0.2, 0]}]})");
  scene.build(4);
  const auto inside = [&](const char* name) {
    return std::ranges::count_if(test::points_of(scene.path(name)), [](const Surfel& s) {
      return std::abs(s.position.x - 0.25) < 0.38 && std::abs(s.position.z) < 0.38 &&
             std::abs(s.position.y) < 0.001;
    });
  };
  CHECK(inside("whole.ptcx") == 0);
  CHECK(inside("parts.ptcx") == 0);
  const auto count = [&](const char* name) {
    return static_cast<double>(test::points_of(scene.path(name)).size());
  };
  CHECK(count("parts.ptcx") == Approx(count("whole.ptcx")).epsilon(0.03));
}

TEST_CASE("motion: a box in which something moves has an inside", "[integration][motion]") {
  Scene scene;
  scene.objects(R"({"file": "box.obj"}, {"file": "box.obj", "scale": 0.5, "keys": [
    {"frame": 1, "translate": [0, 5, 0]}, {"frame": 2, "translate": [0, 0, 0]},
    {"frame": 3, "translate": [0, 5, 0]}]})");
  std::vector<std::vector<char>> parts;
  for (const double frame : {1.0, 2.0, 3.0}) {
    scene.build(frame);
    const auto points = [&](const char* name) {
      return static_cast<double>(test::points_of(scene.path(name)).size());
    };
    CHECK(points("parts.ptcx") == Approx(points("whole.ptcx")).epsilon(0.02));
    MovingScene alone(scene.dir.path());
    alone.build(scene.request, scene.path("alone.ptcx"), scene.progress);
    CHECK(test::bytes_of(scene.path("alone.ptcx")) == test::bytes_of(scene.path("parts.ptcx")));
  }
  CHECK(scene.progress.count == 6);  // the sides change with each frame
}

TEST_CASE("motion: of a glTF, nodes that an animation moves are sampled for each moment",
          "[integration][motion]") {
  Scene scene;
  // A square that faces up, on the ground and small above it, where it moves along x for 4 seconds
  const std::array<float, 18> corners{-1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, 1, 1, 0, -1, -1, 0, -1};
  const std::array<float, 8> keys{0, 4, -0.5F, 0.3F, 0, 0.5F, 0.3F, 0};
  scene.dir.file("a.bin", std::string(reinterpret_cast<const char*>(corners.data()), 72) +
                              std::string(reinterpret_cast<const char*>(keys.data()), 32));
  scene.request.inputs = {scene.dir.file("a.gltf", R"({"asset": {"version": "2.0"},
    "scenes": [{"nodes": [0, 1]}],
    "nodes": [{"mesh": 0}, {"mesh": 0, "translation": [-0.5, 0.3, 0], "scale": [0.3, 0.3, 0.3]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "buffers": [{"uri": "a.bin", "byteLength": 104}],
    "bufferViews": [{"buffer": 0, "byteLength": 72},
                    {"buffer": 0, "byteOffset": 72, "byteLength": 8},
                    {"buffer": 0, "byteOffset": 80, "byteLength": 24}],
    "accessors": [
      {"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3",
       "min": [-1, 0, -1], "max": [1, 0, 1]},
      {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [4]},
      {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}],
    "animations": [{"samplers": [{"input": 1, "output": 2}],
      "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]}]})")};
  for (const double seconds : {0.0, 3.0}) {
    scene.request.moment = Moment{.seconds = seconds};
    build_container(scene.request, scene.path("whole.ptcx"), scene.progress);
    scene.moving.build(scene.request, scene.path("parts.ptcx"), scene.progress);
    INFO("at " << seconds << " s");
    CHECK(difference(floor_light(scene.path("parts.ptcx")), floor_light(scene.path("whole.ptcx"))) <
          0.03);
  }
  CHECK(scene.progress.count == 1);
}

TEST_CASE("motion: scenes without parts are built as a whole", "[integration][motion]") {
  Scene scene;
  SECTION("everything moves") {
    scene.objects(kFlying);
  }
  SECTION("nothing moves") {
    scene.objects(std::string(kFloor) + R"({"file": "square.obj", "translate": [0, 1, 0]})");
  }
  SECTION("on a backdrop") {
    scene.objects(std::string(kFloor) + kFlying);
    scene.request.backdrop = true;
  }
  for (const double frame : {1.0, 4.0}) {
    scene.build(frame);
    CHECK(test::bytes_of(scene.path("whole.ptcx")) == test::bytes_of(scene.path("parts.ptcx")));
  }
  CHECK(scene.progress.count == 0);
}
