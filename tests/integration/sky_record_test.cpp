// The sky picture of a build is used by every later program.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/record.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/scene_record.h"
#include "engine/ptc.h"
#include "engine/store/container_points.h"
#include "engine/store/reader.h"
#include "tests/support/notes.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// A sky that is dark except for a bright band.
void write_sky(const std::filesystem::path& path, float brightness) {
  constexpr unsigned kWidth = 32, kHeight = 16;
  std::vector<float> values;
  for (unsigned y = 0; y < kHeight; ++y) {
    for (unsigned x = 0; x < kWidth; ++x) {
      const float value = x >= 8 && x < 12 ? brightness : 0.0625f;
      values.insert(values.end(), {value, value, value});
    }
  }
  write_exr(path, kWidth, kHeight, {{"", ExrLayer::Kind::colour, true, values}});
}

/// A container of a mesh under a sky picture, next to the picture.
struct Lit {
  Lit() {
    write_sky(picture(), 4);
    std::ofstream(dir / "mesh.obj") << "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 0 1 0\nv 1 1 0\n"
                                       "f 4 3 2 1\nf 1 2 6 5\n";
    BuildRequest request{.inputs = {dir / "mesh.obj"}, .lights = LightRig{.sky = sky()}};
    request.sampling.count = 2000;
    build_container(request, scene(), notes);
  }

  [[nodiscard]] std::filesystem::path picture() const { return dir / "sky.exr"; }
  [[nodiscard]] std::filesystem::path scene() const { return dir / "scene.ptcx"; }
  [[nodiscard]] Sky sky() const {
    return {.radiance = glm::vec3(1),
            .map = std::make_shared<const Texture>(read_image(picture())),
            .map_path = picture().string()};
  }
  std::vector<char> shaded(const std::optional<Sky>& sky, const char* name = "shaded.ply") {
    ShadeRequest request{{.scene = scene()}};
    request.sky = sky;
    shade_container(request, dir / name, notes);
    return bytes_of(dir / name);
  }

  TemporaryDirectory dir;
  Notes notes;
};

/// Returns red radiance times area, summed over the surfels of a container.
double power_of(const std::filesystem::path& file) {
  const ContainerReader container(file);
  ContainerPoints points(container);
  std::vector<PointRecord> block(1024);
  double power = 0;
  while (const std::size_t count = points.next(block)) {
    for (const PointRecord& r : std::span(block).first(count)) {
      const Surfel surfel = to_surfel(r, container.header().frame);
      power += static_cast<double>(surfel.radiance.r * surfel.radius * surfel.radius);
    }
  }
  return power;
}

}  // namespace

TEST_CASE("sky record: a scene is shaded by the sky picture that it was built with",
          "[integration][sky]") {
  Lit lit;
  const std::vector<char> given = lit.shaded(lit.sky());
  CHECK(lit.shaded({}) == given);
  CHECK(lit.shaded(Sky{.radiance = glm::vec3(1)}) != given);
  CHECK(lit.notes.texts.empty());
}

TEST_CASE("sky record: a picture is rendered under the sky that the scene was built with",
          "[integration][sky]") {
  Lit lit;
  RenderRequest request{{.scene = lit.scene()}};
  request.size = {16, 9};
  request.samples = 1;
  const PictureTarget recorded{lit.dir / "recorded.exr"}, given{lit.dir / "given.exr"};
  render_picture(request, std::span(&recorded, 1), lit.notes);
  request.lights = LightRig{.sky = lit.sky()};
  render_picture(request, std::span(&given, 1), lit.notes);
  CHECK(bytes_of(recorded.path) == bytes_of(given.path));
}

TEST_CASE("sky record: an appended mesh is lit by the sky of the scene", "[integration][sky]") {
  Lit lit;
  std::ofstream(lit.dir / "more.obj") << "v 2 0 0\nv 3 0 0\nv 3 0 1\nf 3 2 1\n";
  BuildRequest request{.inputs = {lit.dir / "more.obj"}, .append = lit.scene()};
  request.sampling.count = 500;
  build_container(request, lit.dir / "both.ptcx", lit.notes);
  BuildRequest alone{.inputs = {lit.dir / "more.obj"}, .lights = LightRig{.sky = lit.sky()}};
  alone.sampling.count = 500;
  build_container(alone, lit.dir / "alone.ptcx", lit.notes);
  const double more = power_of(lit.dir / "alone.ptcx");
  CHECK(more > 0);
  CHECK(power_of(lit.dir / "both.ptcx") == Approx(power_of(lit.scene()) + more).epsilon(0.01));
}

TEST_CASE("sky record: a picture that was moved next to the container is found",
          "[integration][sky]") {
  Lit lit;
  const std::vector<char> before = lit.shaded({});
  std::filesystem::create_directory(lit.dir / "elsewhere");
  std::filesystem::rename(lit.scene(), lit.dir / "elsewhere/scene.ptcx");
  std::filesystem::rename(lit.picture(), lit.dir / "elsewhere/sky.exr");
  ShadeRequest request{{.scene = lit.dir / "elsewhere/scene.ptcx"}};
  shade_container(request, lit.dir / "after.ply", lit.notes);
  CHECK(bytes_of(lit.dir / "after.ply") == before);
}

TEST_CASE("sky record: a missing picture is an error that names it, and no output is left",
          "[integration][sky]") {
  Lit lit;
  std::filesystem::remove(lit.picture());
  const std::string missing =
      ".*scene.ptcx: the sky picture .*sky.exr that lit .* does not exist.*";
  CHECK_THROWS_WITH(lit.shaded({}, "none.ply"), Catch::Matches(missing));
  CHECK_FALSE(std::filesystem::exists(lit.dir / "none.ply"));
  // Points that are added to the scene are lit by its sky
  std::ofstream(lit.dir / "cloud.xyz") << "0.5 2 0.5 0 1 0 0.1\n";
  CHECK_THROWS_WITH(build_container({.inputs = {lit.dir / "cloud.xyz"}, .append = lit.scene()},
                                    lit.dir / "more.ptcx", lit.notes),
                    Catch::Matches(missing));
  CHECK_FALSE(std::filesystem::exists(lit.dir / "more.ptcx"));
}

TEST_CASE("sky record: a cloud that joins a lit container is lit by its picture, too",
          "[integration][sky]") {
  const Lit lit;
  std::ofstream(lit.dir / "cloud.xyz") << "0.5 2 0.5 0 1 0 0.1\n0.6 2 0.5 1 0 0 0.1\n";
  Notes notes;
  build_container({.inputs = {lit.scene(), lit.dir / "cloud.xyz"}}, lit.dir / "joined.ptcx", notes);
  CHECK_FALSE(sky_is_gathered(ContainerReader(lit.dir / "joined.ptcx")));
  light_container({{.scene = lit.dir / "joined.ptcx"}}, lit.dir / "again.ptcx", notes);
  const std::vector<Surfel> once = points_of(lit.dir / "joined.ptcx"),
                            again = points_of(lit.dir / "again.ptcx");
  REQUIRE(once.size() == again.size());
  float most = 0;
  for (std::size_t i = 0; i < once.size(); ++i) {
    CHECK(once[i].radiance == again[i].radiance);
    if (once[i].position.y > 1.5) most = std::max(most, once[i].radiance.g);
  }
  CHECK(most > 0);
}

TEST_CASE("sky record: a picture that changed since the build is noted", "[integration][sky]") {
  Lit lit;
  write_sky(lit.picture(), 5);
  static_cast<void>(lit.shaded({}));
  REQUIRE(lit.notes.texts.size() == 1);
  CHECK_THAT(lit.notes.texts[0], Catch::Contains("has changed"));
}

TEST_CASE("sky record: a sky picture without a path cannot be recorded", "[integration][sky]") {
  Lit lit;
  Sky sky = lit.sky();
  sky.map_path.clear();
  CHECK_THROWS_WITH(lights_record({.sky = sky}), Catch::Contains("needs its path"));
}
