// What Mitsuba is given: every triangle, material and light, and a refusal of all that is left out.
#include "tools/bench/references/mitsuba.h"

#include <cstring>
#include <string>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "tests/support/slurp.h"
#include "tests/support/temporary_directory.h"
#include "tools/bench/scenes/procedural.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

std::size_t count_of(const std::string& text, const std::string& word) {
  std::size_t count = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1))
    ++count;
  return count;
}

}  // namespace

TEST_CASE("Mitsuba: its scene has every material that is used, the lamp, and the camera",
          "[bench][mitsuba]") {
  const test::TemporaryDirectory dir;
  LitScene scene = make_cornell(CornellLamp::box);
  scene.lights.suns.push_back({.to_sun = {0, 1, 0}, .irradiance = {3, 2, 1}});
  scene.lights.sky.radiance = {0.5F, 0.25F, 0.125F};
  write_mitsuba_scene(dir.path(), scene.mesh, scene.lights, scene.camera);
  const std::string text = slurp(dir / "scene.xml");
  CHECK(count_of(text, "<shape type=\"ply\">") == 4);
  CHECK(count_of(text, "<bsdf type=\"twosided\">") == 4);
  CHECK(count_of(text, "<emitter type=\"area\"><rgb name=\"radiance\" value=\"17, 12, 4\"/>") == 1);
  CHECK(text.find("value=\"-0, -1, -0\"/><rgb name=\"irradiance\" value=\"3, 2, 1\"/>") !=
        std::string::npos);
  CHECK(
      text.find("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.5, 0.25, 0.125\"/>") !=
      std::string::npos);
  CHECK(text.find("origin=\"1, 1, 5.2\" target=\"1, 1, 0\" up=\"0, 1, 0\"") != std::string::npos);
  CHECK(text.find("name=\"width\" value=\"640\"") != std::string::npos);
}

TEST_CASE("Mitsuba: a PLY has the triangles of its material where they stand", "[bench][mitsuba]") {
  const test::TemporaryDirectory dir;
  Mesh mesh;
  mesh.origin = {10, 20, 30};
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {3, 1, 0}};
  mesh.material_of = {1, 0, 1};
  mesh.materials.resize(3);
  write_mitsuba_scene(dir.path(), mesh, {}, {});
  CHECK(dir.listing() == "0.ply 1.ply scene.xml");
  const std::string ply = slurp(dir / "1.ply"), end = "end_header\n";
  CHECK(ply.find("element vertex 6\n") != std::string::npos);
  CHECK(ply.find("element face 2\n") != std::string::npos);
  const std::size_t at = ply.find(end) + end.size();
  REQUIRE(ply.size() == at + 6 * 12 + 2 * 13);
  float places[18];
  std::memcpy(places, ply.data() + at, sizeof places);
  const float expected[18] = {10, 20, 30, 11, 20, 30, 10, 21, 30,
                              10, 20, 31, 11, 20, 30, 10, 20, 30};
  CHECK(std::equal(std::begin(places), std::end(places), expected));
}

TEST_CASE("Mitsuba: what would be left out is refused", "[bench][mitsuba]") {
  const test::TemporaryDirectory dir;
  const LitScene whole = make_cornell(CornellLamp::flat);
  const auto refused = [&](const auto& change) {
    LitScene scene = whole;
    change(scene);
    CHECK_THROWS_AS(write_mitsuba_scene(dir.path(), scene.mesh, scene.lights, scene.camera),
                    RequestError);
  };
  refused([](LitScene& s) { s.lights.spots.emplace_back(); });
  refused([](LitScene& s) { s.mesh.colours.resize(s.mesh.positions.size()); });
  refused([](LitScene& s) { s.mesh.materials[0].opacity = 0.5F; });
  refused([](LitScene& s) {
    s.lights.sky.map = std::make_shared<const Texture>(Image{1, 1, {glm::vec3(1)}});
  });
  refused([](LitScene& s) {
    s.mesh.materials[0].emission_texture =
        std::make_shared<const Texture>(Image{1, 1, {glm::vec3(1)}});
  });
}
