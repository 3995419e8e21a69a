// Reflections of rough mirrors, in points and in pictures.
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/ptc.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/verify/verify.h"
#include "tests/support/channels.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr glm::vec3 kSky{0.1F, 0.2F, 0.4F}, kPanel{2, 1, 0.5F};

/// A floor in front of a bright panel, which stands at z = -1.
std::vector<Surfel> floor_and_panel() {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, 0, -1}, {0, 0, 3}, {4, 0, 0}, 0.05, glm::vec3(0.1F));
  add_rectangle(surfels, {-1, 0, -1}, {2, 0, 0}, {0, 1.5, 0}, 0.05, kPanel);
  for (Surfel& s : surfels) s.albedo = glm::vec3(0.5F);
  return surfels;
}

ShadeRequest glossy(const std::filesystem::path& scene, float roughness) {
  ShadeRequest request{{.scene = scene}};
  request.glossy.roughness = roughness;
  request.eye = glm::dvec3(0.2, 1, 3);
  request.sky = Sky{.radiance = kSky};
  return request;
}

}  // namespace

TEST_CASE("glossy: a polished floor shows the panel behind it, and the sky above",
          "[integration][glossy]") {
  const TemporaryDirectory dir;
  write_scene(dir / "scene.ptcx", floor_and_panel());
  Progress silent;
  const ShadeRequest request = glossy(dir / "scene.ptcx", 0);
  const LightingReport report = shade_container(request, dir / "lit.ptcx", silent);
  CHECK(report.glossy_cpu_seconds > 0);
  CHECK(verify_container(dir / "lit.ptcx", {.level = VerifyLevel::rebuild}, silent).sound());
  const auto values = values_of(dir / "lit.ptcx");
  int panel = 0, sky = 0;
  const std::vector<Surfel> surfels = [&] {
    const ContainerReader lit(dir / "lit.ptcx");
    return load_surfels(lit, lit.superblock().points);
  }();
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const Surfel& s = surfels[i];
    if (s.normal.y < 0.5F) continue;
    // Where the mirrored ray passes the plane of the panel
    const glm::dvec3 v = *request.eye - s.position;
    const double t = (s.position.z + 1) / v.z;
    const double x = s.position.x - t * v.x, y = t * v.y;
    const bool inside = std::abs(x) < 0.95 && y > 0.05 && y < 1.45;
    const bool outside = std::abs(x) > 1.05 || y > 1.55;
    if (!inside && !outside) continue;
    const glm::vec3 seen = values.at("reflection")[i];
    CHECK(glm::length(seen - (inside ? kPanel : kSky)) < 0.01F);
    CHECK(values.at("reflection_occlusion")[i].x == Approx(inside ? 1 : 0));
    ++(inside ? panel : sky);
  }
  CHECK(panel > 300);
  CHECK(sky > 300);
}

TEST_CASE("glossy: threads and caps change no byte, and the next shading replaces the channels",
          "[integration][glossy]") {
  const TemporaryDirectory dir;
  write_scene(dir / "scene.ptcx", floor_and_panel());
  Progress silent;
  ShadeRequest request = glossy(dir / "scene.ptcx", 0.4F);
  request.estimate = true;
  request.check.receivers = 40;
  request.run.threads = 1;
  const LightingReport report = shade_container(request, dir / "one.ptcx", silent);
  REQUIRE(report.check);
  REQUIRE(report.check->reflection);
  CHECK(report.check->reflection->irradiance_rms < 0.05);
  CHECK(report.check->reflection->irradiance_rms > 0);
  CHECK(report.check->reflection->irradiance_mean > 0.1);
  request.run = {.memory_bytes = 190U << 20, .threads = 3};
  shade_container(request, dir / "three.ptcx", silent);
  CHECK(bytes_of(dir / "one.ptcx") == bytes_of(dir / "three.ptcx"));
  CHECK(ContainerReader(dir / "one.ptcx").meta().channels.size() == 5 + 2 + 2);
  // A file of points has them as columns, which are known again
  shade_container(request, dir / "lit.ply", silent);
  const std::vector<char> ply = bytes_of(dir / "lit.ply");
  const std::string head(ply.begin(), ply.begin() + 2000);
  for (const char* name : {"reflection_r", "reflection_b", "reflection_occlusion"})
    CHECK(head.find(std::string("property float ") + name + "\n") != std::string::npos);
  shade_container({{.scene = dir / "one.ptcx"}}, dir / "again.ptcx", silent);
  CHECK(ContainerReader(dir / "again.ptcx").meta().channels.size() == 5);
  shade_container({{.scene = dir / "lit.ply"}}, dir / "cloud.ptcx", silent);
  CHECK(std::ranges::none_of(ContainerReader(dir / "cloud.ptcx").meta().channels,
                             [](const auto& c) { return c.name.starts_with("reflection"); }));
  // So are rays in place of the gather
  request.estimate = false;
  request.error = 0.02;
  request.count = 200;
  const LightingReport sparse = shade_container(request, dir / "sparse.ply", silent);
  REQUIRE(sparse.mirrors);
  CHECK(sparse.mirrors->met);
  CHECK(sparse.mirrors->noise <= 0.02);
  CHECK(sparse.mirrors->rays > kMirrorRays);
}

TEST_CASE("glossy: pictures have it as layers", "[integration][glossy]") {
  const TemporaryDirectory dir;
  const auto mesh = std::make_shared<Mesh>();
  mesh->positions = {{-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2}};
  mesh->triangles = {{{0, 1, 2}, {0, 2, 3}}};
  mesh->material_of = {0, 0};
  mesh->materials = {{.albedo = glm::vec3(0.5F)}};
  LightRig rig;
  rig.sky = {.radiance = kSky};
  BuildRequest build{.mesh = mesh, .lights = rig};
  build.sampling.count = 2000;
  Progress silent;
  build_container(build, dir / "scene.ptcx", silent);
  RenderRequest request{{.scene = dir / "scene.ptcx"}};
  const bool sees_mesh = GENERATE(true, false);
  if (sees_mesh) request.mesh = mesh;
  request.camera = Camera{.position = {0, 1.5, 4}, .look_at = {0, 0, 0}};
  request.size = {{32, 24}};
  request.samples = 1;
  request.glossy.roughness = 0.2F;
  const std::vector<PictureTarget> targets{{dir / "picture.exr"},
                                           {dir / "reflection.png", "reflection"}};
  render_picture(request, targets, silent);
  const auto seen = read_layer(dir / "picture.exr", "reflection"),
             albedo = read_layer(dir / "picture.exr", "albedo");
  int floor = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (albedo[i].x == 0) CHECK(seen[i] == glm::vec3(0));
    if (albedo[i].x < 0.49F) continue;
    ++floor;
    CHECK(glm::length(seen[i] - kSky) < 0.04F * glm::length(kSky));
  }
  CHECK(floor > 20);
}

TEST_CASE("glossy: what cannot be reflected is refused", "[integration][glossy]") {
  const TemporaryDirectory dir;
  write_scene(dir / "scene.ptcx", floor_and_panel());
  Progress silent;
  for (const float roughness : {-0.1F, 1.1F, std::nanf("")}) {
    CHECK_THROWS_AS(shade_container(glossy(dir / "scene.ptcx", roughness), dir / "o.ply", silent),
                    RequestError);
  }
  ShadeRequest damaged = glossy(dir / "scene.ptcx", 0.5F);
  damaged.tolerate_damage = true;
  CHECK_THROWS_AS(shade_container(damaged, dir / "o.ply", silent), RequestError);
  RenderRequest render{{.scene = dir / "scene.ptcx"}};
  const std::vector<PictureTarget> layer{{dir / "o.png", "reflection"}};
  CHECK_THROWS_AS(render_picture(render, layer, silent), RequestError);
  CHECK(std::distance(std::filesystem::directory_iterator(dir.path()), {}) == 1);
}
