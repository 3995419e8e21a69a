// The record of a light rig.
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/scene/light/lights.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

glm::vec3 random_light(Random& random) {
  return glm::vec3(random.in_box(0, 1) * std::exp(random.between(-40, 40)));
}

LightRig random_rig(Random& random) {
  LightRig rig;
  for (int i = 0; i < 3; ++i) {
    rig.suns.push_back(
        {random.direction(), random_light(random), static_cast<float>(random.between(0, 1.5))});
    rig.points.push_back({random.in_box(-1e9, 1e9), random_light(random)});
    const auto outer = static_cast<float>(random.between(0.1, 1.5));
    rig.spots.push_back({random.in_box(-1e9, 1e9), random.direction(), random_light(random),
                         outer * static_cast<float>(random.between(0, 1)), outer});
  }
  rig.suns[1].group = "key";
  rig.points[2].group = "key_2";
  rig.spots[0].group = "key";
  rig.sky.group = std::string(25, 'z');
  rig.sky.radiance = random_light(random);
  rig.sky.up = random.direction();
  rig.sky.map_path =
      "maps/r\xC3\xBC"
      "ck \"seite\".exr";
  return rig;
}

}  // namespace

TEST_CASE("light rig: a rig written as JSON is read back exactly", "[scene][lights]") {
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const LightRig rig = random_rig(random);
    const LightRig back = light_rig_from_json(to_json(rig));
    REQUIRE(back.suns.size() == rig.suns.size());
    REQUIRE(back.points.size() == rig.points.size());
    REQUIRE(back.spots.size() == rig.spots.size());
    for (std::size_t k = 0; k < rig.suns.size(); ++k) {
      CHECK(back.suns[k].to_sun == rig.suns[k].to_sun);
      CHECK(back.suns[k].irradiance == rig.suns[k].irradiance);
      CHECK(back.suns[k].angular_radius == rig.suns[k].angular_radius);
      CHECK(back.points[k].position == rig.points[k].position);
      CHECK(back.points[k].intensity == rig.points[k].intensity);
      CHECK(back.spots[k].position == rig.spots[k].position);
      CHECK(back.spots[k].direction == rig.spots[k].direction);
      CHECK(back.spots[k].intensity == rig.spots[k].intensity);
      CHECK(back.spots[k].inner_angle == rig.spots[k].inner_angle);
      CHECK(back.spots[k].outer_angle == rig.spots[k].outer_angle);
      CHECK(back.suns[k].group == rig.suns[k].group);
      CHECK(back.points[k].group == rig.points[k].group);
      CHECK(back.spots[k].group == rig.spots[k].group);
    }
    CHECK(back.sky.radiance == rig.sky.radiance);
    CHECK(back.sky.up == rig.sky.up);
    CHECK(back.sky.group == rig.sky.group);
    CHECK(back.sky.map_path == rig.sky.map_path);
    CHECK(!back.sky.map);
    CHECK(to_json(back) == to_json(rig));
  }
}

TEST_CASE("light rig: groups are told apart, and one is left when the others are switched off",
          "[scene][lights]") {
  LightRig rig;
  rig.suns = {{.group = "b"}, {.irradiance = glm::vec3(0), .group = "dark"}, {}};
  rig.points = {{.group = "a"}};
  rig.sky = {.radiance = glm::vec3(1), .group = "b"};
  CHECK(light_groups(rig, false) == std::vector<std::string>{"b", "a", ""});
  rig.suns.pop_back();
  CHECK(light_groups(rig, false) == std::vector<std::string>{"b", "a"});
  CHECK(light_groups(rig, true) == std::vector<std::string>{"b", "a", ""});
  CHECK(light_groups({}, false).empty());
  const LightRig b = only_group(rig, "b"), rest = only_group(rig, "");
  CHECK(b.suns[0].irradiance == rig.suns[0].irradiance);
  CHECK(b.points[0].intensity == glm::vec3(0));
  CHECK(b.sky.radiance == glm::vec3(1));
  CHECK(light_groups(b, false) == std::vector<std::string>{"b"});
  CHECK(light_groups(rest, false).empty());
  for (const char* name : {"", "rest", "a b", "a.b", "Key", "\xC3\xA4"})
    CHECK_FALSE(is_group_name(name));
  CHECK_FALSE(is_group_name(std::string(26, 'a')));
  for (const std::string& name : {std::string("rest_"), std::string("_1"), std::string(25, 'a')})
    CHECK(is_group_name(name));
  CHECK_THROWS_AS(light_rig_from_json(R"({"sky": {"group": "a b"}})"), DataError);
  CHECK_THROWS_AS(light_rig_from_json(R"({"suns": [{"group": 1}]})"), DataError);
}

TEST_CASE("light rig: an empty object is a rig without lights", "[scene][lights]") {
  const LightRig rig = light_rig_from_json("{}");
  CHECK(rig.suns.empty());
  CHECK(rig.points.empty());
  CHECK(rig.spots.empty());
  CHECK(rig.sky.radiance == glm::vec3(0));
}

TEST_CASE("light rig: without spot lights it has the text that versions before them read",
          "[scene][lights]") {
  CHECK(to_json(LightRig{}) ==
        R"({"points":[],"sky":{"radiance":[0.0,0.0,0.0],"up":[0.0,1.0,0.0]},"suns":[]})");
}

TEST_CASE("light rig: directions are normalized", "[scene][lights]") {
  const LightRig rig = light_rig_from_json(
      "{\"suns\": [{\"to_sun\": [0, 3, 4]}], \"spots\": [{\"direction\": [0, -9, 0]}], "
      "\"sky\": {\"up\": [0, 0, 1e-30]}}");
  CHECK(rig.spots[0].direction == glm::vec3(0, -1, 0));
  CHECK(rig.suns[0].to_sun == glm::vec3(0, 0.6f, 0.8f));
  CHECK(rig.sky.up == glm::vec3(0, 0, 1));
}

TEST_CASE("light rig: every proper prefix of its JSON is refused", "[scene][lights]") {
  Random random(4);
  const std::string whole = to_json(random_rig(random));
  for (std::size_t n = 0; n < whole.size(); ++n) {
    CHECK_THROWS_AS(light_rig_from_json(whole.substr(0, n)), DataError);
  }
}

TEST_CASE("light rig: a damaged byte gives a rig or a DataError", "[scene][lights]") {
  Random random(5);
  const std::string whole = to_json(random_rig(random));
  int refused = 0;
  for (std::size_t n = 0; n < whole.size(); ++n) {
    for (const int flip : {1, 2, 4, 8, 16, 32, 64, 128}) {
      std::string damaged = whole;
      damaged[n] = static_cast<char>(damaged[n] ^ flip);
      try {
        (void)light_rig_from_json(damaged);
      } catch (const DataError&) {
        ++refused;
      }
    }
  }
  CHECK(refused > 0);
}

TEST_CASE("light rig: JSON that makes no lights is refused with the place", "[scene][lights]") {
  const auto refuses = [](const std::string& text, const std::string& place) {
    CHECK_THROWS_WITH(light_rig_from_json(text),
                      Catch::Contains("light rig") && Catch::Contains(place));
    CHECK_THROWS_AS(light_rig_from_json(text), DataError);
  };
  refuses("3", "object");
  refuses("{\"sun\": []}", "\"sun\"");
  refuses("{\"suns\": {}}", "suns");
  refuses("{\"suns\": [{}, 1]}", "suns[1]");
  refuses("{\"suns\": [{\"to_sun\": [0, 0, 0]}]}", "to_sun");
  refuses("{\"suns\": [{\"irradiance\": [1, -1, 1]}]}", "irradiance");
  refuses("{\"suns\": [{\"angular_radius\": 1.6}]}", "angular_radius");
  refuses("{\"suns\": [{\"angle\": 1}]}", "angle");
  refuses("{\"points\": [{\"intensity\": [1, 1]}]}", "intensity");
  refuses("{\"points\": [{\"position\": \"here\"}]}", "position");
  refuses("{\"spots\": [{\"direction\": [0, 0, 0]}]}", "direction");
  refuses("{\"spots\": [{\"outer_angle\": 0}]}", "outer_angle");
  refuses("{\"spots\": [{\"outer_angle\": 1.6}]}", "outer_angle");
  refuses("{\"spots\": [{\"inner_angle\": 0.5, \"outer_angle\": 0.4}]}", "inner_angle");
  refuses("{\"spots\": [{\"blend\": 1}]}", "blend");
  refuses("{\"sky\": []}", "sky");
  refuses("{\"sky\": {\"radiance\": [1e39, 0, 0]}}", "radiance");
  refuses("{\"sky\": {\"map\": 1}}", "map");
  refuses("{\"sky\": {\"up\": [0, 0, 0]}}", "up");
  refuses(std::string(5000, '['), "JSON");
}

TEST_CASE("light rig: values that JSON cannot express are not written", "[scene][lights]") {
  LightRig rig;
  rig.points.push_back({});
  rig.points[0].position.x = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(to_json(rig), RequestError);
  rig.points.clear();
  rig.sky.map_path = "\xFF\xFE.exr";
  CHECK_THROWS_AS(to_json(rig), RequestError);
}

TEST_CASE("light rig: a missing map is an error, a rig without a map is not", "[scene][lights]") {
  Sky sky;
  const auto store = TextureStore::make();
  CHECK(load_sky_map(sky, "/", *store) == SkyMap::none);
  CHECK(!sky.map);
  sky.map_path = "/no-such-place/no-such-map.exr";
  CHECK_THROWS_WITH(load_sky_map(sky, "/no-such-folder", *store),
                    Catch::Contains("/no-such-place/no-such-map.exr") &&
                        Catch::Contains("/no-such-folder/no-such-map.exr"));
}
