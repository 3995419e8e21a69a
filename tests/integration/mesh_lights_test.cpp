// Lights that mesh files define.
#include <catch2/catch.hpp>
#include <fmt/format.h>

#include "engine/base/numbers.h"
#include "engine/base/progress.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/render/render_picture.h"
#include "engine/pipeline/scene_record.h"
#include "engine/store/reader.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

// A floor of 2 x 2 that faces up, and a point light of 683 candela at a height over its middle.
std::filesystem::path floor_under_a_lamp(const test::TemporaryDirectory& directory, double height) {
  std::string bytes;
  for (const float v : {-1.f, 0.f, -1.f, -1.f, 0.f, 1.f, 1.f, 0.f, 1.f, -1.f, 0.f, -1.f, 1.f, 0.f,
                        1.f, 1.f, 0.f, -1.f})
    bytes.append(reinterpret_cast<const char*>(&v), sizeof v);
  directory.file("floor.bin", bytes);
  return directory.file("floor.gltf", fmt::format(R"({{
    "asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}},
      {{"translation": [0, {}, 0], "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}}],
    "extensions": {{"KHR_lights_punctual": {{"lights": [{{"type": "point", "intensity": 683}}]}}}},
    "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
    "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3"}}],
    "bufferViews": [{{"buffer": 0, "byteLength": 72}}],
    "buffers": [{{"uri": "floor.bin", "byteLength": 72}}]}})",
                                                  height));
}

}  // namespace

TEST_CASE("mesh lights: the lights of a glTF light it in place of the default ones",
          "[integration][lights]") {
  const test::TemporaryDirectory scratch;
  BuildRequest request;
  request.inputs = {floor_under_a_lamp(scratch, 0.5)};
  request.sampling.count = 3000;
  Progress silent;
  build_container(request, scratch.path() / "a.ptcx", silent);
  const LightRig rig = recorded_rig(ContainerReader(scratch.path() / "a.ptcx"));
  CHECK(rig.suns.empty());
  CHECK(rig.sky.radiance == glm::vec3(0));
  REQUIRE(rig.points.size() == 1);
  CHECK(rig.points[0].position == glm::dvec3(0, 0.5, 0));
  CHECK(rig.points[0].intensity == glm::vec3(1));

  // Below the lamp a white floor has 1 W/sr / (0.5 m)^2 / pi
  RenderRequest picture;
  picture.meshes = request.inputs;
  picture.scene = scratch.path() / "a.ptcx";
  picture.camera = Camera{.position = {0, 0.3, 0.001}, .look_at = {0, 0, 0}};
  picture.camera->vertical_fov = 0.05f;
  picture.size = {8, 8};
  const std::vector<PictureTarget> targets{{scratch.path() / "a.exr"}};
  render_picture(picture, targets, silent);
  const Image image = read_image(scratch.path() / "a.exr");
  CHECK(image.at(4, 4).x == Approx(4 / kPi).epsilon(0.01));

  // Lights that are given take their place
  request.lights = LightRig{};
  build_container(request, scratch.path() / "b.ptcx", silent);
  CHECK(recorded_rig(ContainerReader(scratch.path() / "b.ptcx")).points.empty());
}
