// Textures and vertices that are baked: where texels lie, what they hold, and what is refused.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/image/srgb.h"
#include "engine/io/mesh/mesh.h"
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

// Reads a channel.
std::vector<float> read_channel(const std::filesystem::path& path, const std::string& channel) {
  Imf::InputFile file(path.c_str());
  std::vector<float> values(std::size_t{kSide} * kSide, -1);
  Imf::FrameBuffer frame;
  frame.insert(channel, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()),
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

// The values of each vertex of a binary PLY by their names, and the number of its vertices.
struct BakedPly {
  std::size_t vertices = 0;
  std::map<std::string, std::vector<double>> values;
};

BakedPly read_ply(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  REQUIRE(file);
  BakedPly ply;
  std::vector<std::pair<std::string, std::string>> properties;  // type, name
  std::string line;
  while (std::getline(file, line) && !line.starts_with("element face")) {
    std::istringstream words(line);
    std::string word, type, name;
    words >> word >> type >> name;
    if (word == "element") ply.vertices = std::stoul(name);
    if (word == "property") properties.emplace_back(type, name);
  }
  while (std::getline(file, line) && line != "end_header") {
  }
  const auto read = [&]<typename T>(T value) {
    file.read(reinterpret_cast<char*>(&value), sizeof(T));
    return static_cast<double>(value);
  };
  for (std::size_t i = 0; i < ply.vertices; ++i) {
    for (const auto& [type, name] : properties) {
      ply.values[name].push_back(type == "double"  ? read(double{})
                                 : type == "float" ? read(float{})
                                                   : read(std::uint8_t{}));
    }
  }
  REQUIRE(file);
  return ply;
}

}  // namespace

TEST_CASE("bake: a texel is the place that the texture coordinates say, row 0 where v is 1",
          "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  Bake bake(mesh);
  bake.run();
  const auto albedo = test::read_layer(bake.path("a.exr"), "albedo"),
             irradiance = test::read_layer(bake.path("a.exr"), "irradiance");
  const auto occlusion = read_channel(bake.path("a.exr"), "occlusion.V"),
             alpha = read_channel(bake.path("a.exr"), "A");
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
  const auto alpha = read_channel(bake.path("a.exr"), "A");
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
  CHECK_THROWS_WITH(bake.run(), Catch::Contains("the mesh as it is baked"));
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

TEST_CASE("bake: vertices have the light of the surface around them, in a .ply and a .glb",
          "[integration][bake]") {
  // A floor of 8 x 8 squares far from the origin, and a lid above a quarter of it
  constexpr int kSquares = 8;
  const glm::dvec3 origin(500'000, 100, -300'000);
  Mesh mesh;
  mesh.origin = origin;
  for (int y = 0; y <= kSquares; ++y) {
    for (int x = 0; x <= kSquares; ++x) {
      mesh.positions.emplace_back(0.25 * x - 1.0, 0, 0.25 * y - 1.0);
      mesh.uvs.emplace_back(x / 8.0, y / 8.0);
      mesh.normals.emplace_back(0, 1, 0);
    }
  }
  constexpr std::uint32_t kRow = kSquares + 1;
  for (std::uint32_t i = 0; i + kRow < mesh.positions.size(); ++i) {
    if (i % kRow == kSquares) continue;
    mesh.triangles.push_back({i, i + kRow, i + 1});
    mesh.triangles.push_back({i + 1, i + kRow, i + kRow + 1});
  }
  mesh.material_of.assign(mesh.triangles.size(), 0);
  mesh.materials = {{.name = "floor", .albedo = glm::vec3(0.5F, 0.25F, 1)},
                    {.name = "lid", .albedo = glm::vec3(0), .emission = {2, 4, 1}}};
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const glm::vec2 at : {glm::vec2(-1, -1), {-1, 0}, {0, -1}, {0, 0}}) {
    mesh.positions.emplace_back(at.x, 0.15F, at.y);
    mesh.uvs.emplace_back(0);
    mesh.normals.emplace_back(0, 1, 0);
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first + 2, first + 1, first + 3});
  mesh.material_of.resize(mesh.triangles.size(), 1);
  Bake bake(mesh);
  bake.request.texture.reset();
  bake.request.size.reset();
  bake.request.vertices = true;
  const std::vector<PictureTarget> targets{{bake.path("a.ply")},
                                           {bake.path("a.glb"), "irradiance"},
                                           {bake.path("occlusion.glb"), "occlusion"}};
  const LightingReport report = render_picture(bake.request, targets, bake.notes);
  CHECK(report.receivers == 4 * mesh.positions.size());

  // The PLY has positions in double, all values, and what they are
  REQUIRE(report.exposure);
  const BakedPly ply = read_ply(bake.path("a.ply"));
  REQUIRE(ply.vertices == mesh.positions.size());
  const auto value = [&](const char* name, std::size_t i) { return ply.values.at(name)[i]; };
  for (std::size_t i = 0; i < ply.vertices; ++i) {
    const glm::vec3& p = mesh.positions[i];
    CHECK(glm::dvec3(value("x", i), value("y", i), value("z", i)) == origin + glm::dvec3(p));
    CHECK(value("t", i) == static_cast<double>(mesh.uvs[i].y));
    const bool is_floor = i < first;
    CHECK(value("albedo_r", i) == Approx(is_floor ? 0.5 : 0));
    if (!is_floor || p.x >= 0.25F || p.z >= 0.25F) {
      INFO(p.x << ' ' << p.z);
      CHECK(value("irradiance_g", i) > 0.5 * std::numbers::pi);
      CHECK(value("occlusion", i) < 0.5);
      CHECK(value("bent_normal_y", i) > 0.7);
    } else if (p.x == -0.5F && p.z == -0.5F) {
      // Four times the form factor of a rectangle of a x a above its corner, at height h
      const double a = 0.5, h = 0.15, far = std::hypot(a, h);
      CHECK(value("occlusion", i) ==
            Approx(4 / std::numbers::pi * (a / far) * std::atan(a / far)).margin(0.03));
    }
    if (!is_floor)
      CHECK(value("radiance_g", i) == Approx(4).margin(0.01));
    else
      CHECK(value("radiance_g", i) ==
            Approx(0.25 * value("irradiance_g", i) / std::numbers::pi).margin(1e-4));
    const double shown = std::exp2(static_cast<double>(*report.exposure)) * value("radiance_r", i);
    CHECK(value("red", i) == Approx(255 * linear_to_srgb(std::min(1.0, shown))).margin(0.51));
  }
  const std::size_t far_corner = first - 1;
  CHECK(value("irradiance_g", far_corner) == Approx(std::numbers::pi).epsilon(0.03));
  CHECK(read_mesh(bake.path("a.ply")).mesh.triangles.size() == mesh.triangles.size());

  // The GLB has the same light as COLOR_0; reading numbers the vertices as triangles use them
  const Mesh lit = read_mesh(bake.path("a.glb")).mesh,
             occluded = read_mesh(bake.path("occlusion.glb")).mesh;
  std::vector<std::uint32_t> number(mesh.positions.size());
  for (const Mesh* const read : {&lit, &occluded}) {
    REQUIRE(read->positions.size() == mesh.positions.size());
    REQUIRE(read->colours.size() == mesh.positions.size());
    REQUIRE(read->triangles.size() == mesh.triangles.size());
    CHECK(read->material_of == mesh.material_of);
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t there = read->triangles[i][k], here = mesh.triangles[i][k];
        number[here] = there;
        CHECK(read->uvs[there] == mesh.uvs[here]);
        CHECK(read->normals[there] == mesh.normals[here]);
        CHECK(read->origin + glm::dvec3(read->positions[there]) ==
              origin + glm::dvec3(mesh.positions[here]));
      }
    }
  }
  CHECK(lit.materials[1].emission == mesh.materials[1].emission);
  CHECK(lit.materials[0].albedo == mesh.materials[0].albedo);
  CHECK(lit.materials[0].name == "floor");
  double most = 0;
  const double gain = std::exp2(static_cast<double>(*report.exposure)) / std::numbers::pi;
  for (std::size_t i = 0; i < ply.vertices; ++i) {
    const glm::vec3 light = lit.colours[number[i]];
    CHECK(static_cast<double>(occluded.colours[number[i]].r) ==
          Approx(1 - value("occlusion", i)).margin(1e-6));
    CHECK(static_cast<double>(light.b) ==
          Approx(std::min(1.0, gain * value("irradiance_b", i))).margin(1e-4));
    most = std::max(most, static_cast<double>(light.g));
  }
  CHECK(most <= 1);
  CHECK(most > 0.8);
}

TEST_CASE("bake: colours that vertices had are part of the light of a .glb, but not of others",
          "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  Bake bake(mesh);
  bake.request.texture.reset();
  bake.request.size.reset();
  bake.request.vertices = true;
  bake.request.exposure = 0;
  render_picture(
      bake.request,
      std::vector<PictureTarget>{{bake.path("a.glb")}, {bake.path("o.glb"), "occlusion"}},
      bake.notes);
  const Mesh lit = read_mesh(bake.path("a.glb")).mesh,
             occluded = read_mesh(bake.path("o.glb")).mesh;
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::vec3& p = lit.positions[i];
    CHECK(lit.colours[i].r == Approx((p.x + 1) / 2).margin(0.03));
    CHECK(lit.colours[i].g == 0);
    CHECK(lit.colours[i].b == Approx((p.z + 1) / 2).margin(0.03));
    CHECK(occluded.colours[i].g > 0.98F);
  }
}

TEST_CASE("bake: a mesh that a scene file names is not overwritten", "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  Bake bake(mesh);
  std::ofstream(bake.path("floor.ply")) << "ply\n";
  std::ofstream(bake.path("a.scene.json"))
      << R"({"ptcx_scene": 1, "objects": [{"file": "floor.ply"}]})";
  bake.request.texture.reset();
  bake.request.size.reset();
  bake.request.vertices = true;
  bake.request.mesh = nullptr;
  bake.request.scene = bake.path("a.scene.json");
  CHECK_THROWS_WITH(bake.run("floor.ply"), Catch::Contains("is read by this run"));
}

TEST_CASE("bake: what baking vertices cannot do is refused", "[integration][bake]") {
  Mesh mesh;
  add_square(mesh, 0, {0, 0}, {1, 1});
  Bake bake(mesh);
  bake.request.vertices = true;
  CHECK_THROWS_WITH(bake.run("a.ply"), Catch::Contains("a texture or vertices, not both"));
  bake.request.texture.reset();
  CHECK_THROWS_WITH(bake.run("a.ply"), Catch::Contains("vertices have none"));
  bake.request.size.reset();
  CHECK_THROWS_WITH(bake.run("a.exr"), Catch::Contains("must end in .ply or .glb"));
  bake.request.run.memory_bytes = 1 << 20;
  CHECK_THROWS_WITH(bake.run("a.ply"), Catch::Contains("too small"));
  CHECK_FALSE(std::filesystem::exists(bake.path("a.ply")));
  bake.request.run.memory_bytes = 1 << 30;
  bake.run("a.ply");
  CHECK(read_ply(bake.path("a.ply")).vertices == 4);
}
