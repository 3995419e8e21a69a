// The scene that a word means, and what it is made of.
#include "tools/bench/scenes/bench_scene.h"

#include <set>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

constexpr SceneOptions kSmall{.points = 3000,
                              .width = 64,
                              .height = 40,
                              .shaded_width = 32,
                              .shaded_height = 18,
                              .window_width = 8,
                              .window_height = 5,
                              .own_points = 500};

}  // namespace

TEST_CASE("scene: six words name scenes, everything else names a file", "[bench][scene]") {
  for (const char* word : {"fractal", "window", "city", "cornell", "box-lamp", "ajar"}) {
    const SceneChoice choice = parse_scene(word);
    CHECK(choice.name == word);
    CHECK(choice.file.empty());
    CHECK(!choice.backdrop);
  }
  for (const char* text : {"Fractal", "./city", "windows", "city.ply"})
    CHECK(parse_scene(text).file == text);
}

TEST_CASE("scene: a file's name ends before its first dot", "[bench][scene]") {
  CHECK(parse_scene("meshes/dragon.ply.gz").name == "dragon");
  CHECK(parse_scene("/a.b/sponza.obj").name == "sponza");
  CHECK(parse_scene("../room").name == "room");
  CHECK(parse_scene(".hidden.obj").name == ".hidden");
  CHECK(parse_scene(".obj").name == ".obj");
}

TEST_CASE("scene: names contain nothing that a chart cannot show", "[bench][scene]") {
  CHECK(parse_scene("d\xc3\xa9j\xc3\xa0 vu.ply").name == "d\xc3\xa9j\xc3\xa0 vu");
  CHECK(parse_scene("a\xff\xe9z.ply").name == "a__z");
  CHECK(parse_scene("a\n\x7f.ply").name == "a__");
}

TEST_CASE("scene: the suffix +backdrop is cut off a file's name and refused after a word",
          "[bench][scene]") {
  const SceneChoice choice = parse_scene("meshes/dragon.ply+backdrop");
  CHECK(choice.file == "meshes/dragon.ply");
  CHECK(choice.name == "dragon");
  CHECK(choice.backdrop);
  CHECK(parse_scene("a+backdrop.obj").file == "a+backdrop.obj");
  for (const char* word : {"fractal", "window", "city", "cornell", "box-lamp", "ajar"}) {
    CHECK_THROWS_AS(parse_scene(std::string(word) + "+backdrop"), RequestError);
  }
}

TEST_CASE("scene: an empty name is refused", "[bench][scene]") {
  CHECK_THROWS_AS(parse_scene(""), RequestError);
  CHECK_THROWS_AS(parse_scene("+backdrop"), RequestError);
}

TEST_CASE("scene: no two scenes have the same name", "[bench][scene]") {
  const std::vector<SceneChoice> choices =
      parse_scenes({"a/room.obj", "b/room.ply", "room-2.obj", "city", "room.obj", "x/city.obj",
                    "room.obj+backdrop"});
  std::vector<std::string> names;
  for (const SceneChoice& choice : choices) names.push_back(choice.name);
  CHECK(names == std::vector<std::string>{"room", "room-2", "room-2-2", "city", "room-3", "city-2",
                                          "room-4"});
  CHECK(choices[1].file == "b/room.ply");
}

TEST_CASE("scene: a scene leaves nothing in its directory, not even while it is open",
          "[bench][scene]") {
  const test::TemporaryDirectory dir;
  Progress silent;
  const BenchScene scene(parse_scene("fractal"), kSmall, dir.path(), {.threads = 1}, silent);
  CHECK(std::filesystem::is_empty(dir.path()));
  CHECK(scene.surfels().size() == scene.container().superblock().points);
}

TEST_CASE("scene: receivers are pixels from the middle of the picture, and points of the scene",
          "[bench][scene]") {
  const test::TemporaryDirectory dir;
  Progress silent;
  const BenchScene scene(parse_scene("window"), kSmall, dir.path(), {.threads = 1}, silent);
  REQUIRE(scene.sets().size() == 3);
  const ReceiverSet& camera = scene.sets()[0];
  CHECK(camera.name == "camera");
  CHECK(camera.receivers.size() == 32 * 18);  // a room: each pixel sees something
  REQUIRE(camera.window.size() == 8 * 5);
  CHECK(camera.window_width == 8);
  CHECK(camera.window_height == 5);
  for (unsigned y = 0; y < 5; ++y) {
    for (unsigned x = 0; x < 8; ++x)
      CHECK(camera.window[y * 8 + x].receiver == (6 + y) * 32 + 12 + x);
  }
  const ReceiverSet& points = scene.sets()[1];
  CHECK(points.name == "points");
  CHECK(points.window.empty());
  CHECK(points.receivers.size() == scene.surfels().size());  // fewer than a block: all of them
  for (std::size_t i = 0; i < points.receivers.size(); ++i) {
    REQUIRE(points.receivers[i].normal == scene.surfels()[i].normal);
  }
  const ReceiverSet& all = scene.sets()[2];
  CHECK(all.name == "sparse");
  CHECK(all.receivers.size() == std::min<std::size_t>(3000, scene.surfels().size()));
}

TEST_CASE("scene: receivers that lie far apart are spread evenly over the points",
          "[bench][scene]") {
  const test::TemporaryDirectory dir;
  Progress silent;
  SceneOptions options = kSmall;
  options.points = 20'000;  // several blocks
  options.sparse_points = 7;
  const BenchScene scene(parse_scene("window"), options, dir.path(), {.threads = 1}, silent);
  const std::size_t points = scene.surfels().size();
  REQUIRE(points > 3 * Shader::kBlock);
  const ReceiverSet& sparse = scene.sets().back();
  REQUIRE(sparse.receivers.size() == 7);
  for (std::size_t i = 0; i < 7; ++i) {
    const Surfel& s = scene.surfels()[(2 * i + 1) * points / 14];
    CHECK(sparse.receivers[i].normal == s.normal);
    CHECK(glm::distance(sparse.receivers[i].position, s.position) <= static_cast<double>(s.radius));
  }
}
