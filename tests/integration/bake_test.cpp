// Textures that are baked: where texels lie, what they hold, and what is refused.
#include <filesystem>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/render/render_picture.h"
#include "tests/support/channels.h"
#include "tests/support/notes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

constexpr unsigned kSide = 32;

// Adds a square of 2 x 2 that faces up, at a height, whose texture coordinates fill a box. The
// colours of its vertices say where they are: red is (x + 1) / 2, blue (z + 1) / 2.
void add_square(Mesh& mesh, float height, const glm::vec2& low, const glm::vec2& high) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (int i = 0; i < 4; ++i) {
    const auto u = static_cast<float>(i % 2), v = static_cast<float>(i / 2);
    mesh.positions.emplace_back(2 * u - 1, height, 1 - 2 * v);
    mesh.uvs.push_back(low + (high - low) * glm::vec2(u, v));
    mesh.colours.emplace_back(u, 0, 1 - v);
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first + 2, first + 1, first + 3});
  mesh.material_of.resize(mesh.triangles.size(), 0);
  mesh.materials.resize(1);
  mesh.materials[0].albedo = glm::vec3(1);
}

// Reads a layer of one component.
std::vector<float> read_scalar(const std::filesystem::path& path, const std::string& layer) {
  Imf::InputFile file(path.c_str());
  std::vector<float> values(std::size_t{kSide} * kSide, -1);
  Imf::FrameBuffer frame;
  frame.insert(layer + ".V", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()),
                                        sizeof(float), sizeof(float) * kSide));
  file.setFrameBuffer(frame);
  file.readPixels(0, kSide - 1);
  return values;
}

class Bake {
 public:
  explicit Bake(const Mesh& mesh) {
    BuildRequest build;
    build.mesh = std::make_shared<Mesh>(mesh);
    build.sampling.count = 3000;
    build.lights = LightRig{};
    build.lights->sky.radiance = glm::vec3(1);
    request.scene = path("a.ptcx");
    Progress silent;
    build_container(build, request.scene, silent);
    request.mesh = build.mesh;
    request.texture = TextureTarget{.margin = 4};
    request.size = {kSide, kSide};
  }

  [[nodiscard]] std::filesystem::path path(const std::string& name) const {
    return scratch_.path() / name;
  }

  LightingReport run(const std::string& name = "a.exr") {
    return render_picture(request, std::vector<PictureTarget>{{path(name)}}, notes);
  }

  RenderRequest request;
  test::Notes notes;

 private:
  test::TemporaryDirectory scratch_;
};

}  // namespace

TEST_CASE("bake: a texel is the place that the texture coordinates say, row 0 where v is 1",
          "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  Bake bake(mesh);
  bake.run();
  const auto albedo = test::read_layer(bake.path("a.exr"), "albedo"),
             irradiance = test::read_layer(bake.path("a.exr"), "irradiance");
  const auto occlusion = read_scalar(bake.path("a.exr"), "occlusion"),
             alpha = read_scalar(bake.path("a.exr"), "alpha");
  for (unsigned y = 0; y < kSide; ++y) {
    for (unsigned x = 0; x < kSide; ++x) {
      const std::size_t at = y * kSide + x;
      const float u = (static_cast<float>(x) + 0.5F) / kSide,
                  v = 1 - (static_cast<float>(y) + 0.5F) / kSide;
      CHECK(albedo[at].r == Approx(u).margin(2e-3));
      CHECK(albedo[at].b == Approx(1 - v).margin(2e-3));
      CHECK(irradiance[at].g == Approx(std::numbers::pi).epsilon(0.02));
      CHECK(occlusion[at] < 0.01F);
      CHECK(alpha[at] == 1);
    }
  }
  CHECK(bake.notes.texts.empty());
}

TEST_CASE("bake: a margin shows the edge of its island, and alpha leaves it out",
          "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0.25F, 0.25F}, {0.75F, 0.75F});
  Bake bake(mesh);
  bake.run();
  const auto albedo = test::read_layer(bake.path("a.exr"), "albedo"),
             picture = test::read_layer(bake.path("a.exr"), "");
  const auto alpha = read_scalar(bake.path("a.exr"), "alpha");
  const std::size_t row = kSide / 2 * kSide;
  for (unsigned x = 0; x < kSide; ++x) {
    const bool inside = x >= 8 && x < 24, margin = !inside && x >= 4 && x < 28;
    INFO(x);
    CHECK(alpha[row + x] == (inside ? 1.0F : 0.0F));
    if (margin) CHECK(albedo[row + x].r == Approx(x < 8 ? 1 / 32.0 : 31 / 32.0).margin(2e-3));
    if (!inside && !margin) CHECK(picture[row + x] == glm::vec3(0));
  }
}

TEST_CASE("bake: light at a texel is that of rays at the mesh", "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 0.48F});
  add_square(mesh, 0.7F, {0, 0.52F}, {1, 1});
  for (std::size_t i = 4; i < 8; ++i) mesh.positions[i] *= glm::vec3(0.5F, 1, 0.5F);
  mesh.materials[0].double_sided = true;
  Bake bake(mesh);
  bake.request.check.receivers = 300;
  const LightingReport report = bake.run();
  REQUIRE(report.check);
  REQUIRE(report.check->mesh);
  CHECK(report.check->mesh->occlusion_rms < 0.02);
  CHECK(report.check->mesh->irradiance_rms < 0.04);
}

TEST_CASE("bake: each tile of the texture coordinates has a file of its own",
          "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  add_square(mesh, 5, {1, 0}, {2, 1});
  add_square(mesh, 10, {3, 2}, {4, 3});
  Bake bake(mesh);
  bake.request.check.receivers = 50;
  const LightingReport report = bake.run("a.<UDIM>.exr");
  CHECK(report.receivers == std::uint64_t{3} * kSide * kSide * bake.request.samples);
  REQUIRE(report.check);
  CHECK(report.check->receivers == 150);
  for (const char* name : {"a.1001.exr", "a.1002.exr", "a.1024.exr"}) {
    const auto albedo = test::read_layer(bake.path(name), "albedo");
    CHECK(albedo[kSide - 1].r == Approx(1 - 0.5 / kSide).margin(2e-3));
  }
  CHECK(!std::filesystem::exists(bake.path("a.1003.exr")));
  CHECK(bake.notes.texts.empty());
  // One name without a number gets the first tile, and a note tells of the others
  bake.run("b.exr");
  REQUIRE(bake.notes.texts.size() == 1);
  CHECK_THAT(bake.notes.texts[0], Catch::Contains("3 tiles"));
}

TEST_CASE("bake: coordinates that are far away or no numbers leave the others as they are",
          "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  for (const float far : {3e4F, 1e30F, std::numeric_limits<float>::infinity(),
                          std::numeric_limits<float>::quiet_NaN()}) {
    add_square(mesh, 5 + static_cast<float>(mesh.uvs.size()), {far, far}, {far + 1, far + 1});
  }
  Bake bake(mesh);
  bake.run();
  const auto albedo = test::read_layer(bake.path("a.exr"), "albedo");
  for (unsigned x = 0; x < kSide; ++x)
    CHECK(albedo[x].r == Approx((static_cast<float>(x) + 0.5F) / kSide).margin(2e-3));
}

TEST_CASE("bake: a triangle whose coordinates repeat shows its place in the tile",
          "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {-3, -3}, {5, 5});
  Bake bake(mesh);
  bake.run();
  const auto albedo = test::read_layer(bake.path("a.exr"), "albedo");
  for (unsigned x = 0; x < kSide; ++x) {
    const float u = (static_cast<float>(x) + 0.5F) / kSide;
    CHECK(albedo[x].r == Approx((u + 3) / 8).margin(2e-3));
  }
}

TEST_CASE("bake: a cap that is too small for the mesh and its texture is refused",
          "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  Bake bake(mesh);
  bake.request.size = {16384, 16384};
  bake.request.run.memory_bytes = std::uint64_t{40} << 20;
  CHECK_THROWS_WITH(bake.run(), Catch::Contains("the mesh in its texture"));
}

TEST_CASE("bake: parts that share texels are noted", "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  add_square(mesh, 5, {0, 0}, {1, 1});
  Bake bake(mesh);
  bake.run();
  REQUIRE(bake.notes.texts.size() == 1);
  CHECK_THAT(bake.notes.texts[0], Catch::Contains("share texels, 2 to one"));
}

TEST_CASE("bake: a texture is the same for any number of threads", "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  Bake bake(mesh);
  bake.request.run.threads = 1;
  bake.run("one.exr");
  bake.request.run.threads = 3;
  bake.run("three.exr");
  CHECK(test::read_layer(bake.path("one.exr"), "irradiance") ==
        test::read_layer(bake.path("three.exr"), "irradiance"));
}

TEST_CASE("bake: what cannot be baked is refused", "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  Bake bake(mesh);
  const auto refused = [&](const char* member, const char* text) {
    try {
      bake.run();
      FAIL("was not refused");
    } catch (const RequestError& error) {
      CHECK(error.field() == member);
      CHECK_THAT(error.what(), Catch::Contains(text));
    }
    CHECK(!std::filesystem::exists(bake.path("a.exr")));
  };
  SECTION("without texture coordinates") {
    Mesh bare = mesh;
    bare.uvs.clear();
    bake.request.mesh = std::make_shared<Mesh>(bare);
    refused("meshes", "no texture coordinates");
  }
  SECTION("without a mesh") {
    bake.request.mesh = nullptr;
    refused("meshes", "no mesh");
  }
  SECTION("with a margin that is too wide") {
    bake.request.texture->margin = 65;
    refused("texture.margin", "above 64");
  }
  SECTION("into a file for each tile where no tile has a number") {
    Mesh below = mesh;
    for (glm::vec2& uv : below.uvs) uv -= glm::vec2(5);
    bake.request.mesh = std::make_shared<Mesh>(below);
    CHECK_THROWS_WITH(bake.run("b.<UDIM>.exr"), Catch::Contains("stands for nothing"));
    CHECK(!std::filesystem::exists(bake.path("b.<UDIM>.exr")));
  }
  SECTION("into names of which one alone holds the number of a tile") {
    const std::vector<PictureTarget> targets{{bake.path("b.<UDIM>.exr")},
                                             {bake.path("b.png"), "albedo"}};
    CHECK_THROWS_WITH(render_picture(bake.request, targets, bake.notes),
                      Catch::Contains("or none does"));
  }
  SECTION("by groups of lights") {
    bake.request.light_groups = true;
    refused("light_groups", "for pictures");
  }
}
