// The light of groups of lights apart: against runs with the lights of one group alone, and sums.
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/pipeline/shade/shading_channels.h"
#include "engine/ptc.h"
#include "engine/verify/verify.h"
#include "tests/support/channels.h"
#include "tests/support/notes.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

std::vector<glm::vec3> sum(const std::vector<glm::vec3>& a, const std::vector<glm::vec3>& b) {
  std::vector<glm::vec3> both = a;
  for (std::size_t i = 0; i < a.size(); ++i) both[i] += b[i];
  return both;
}

/// What leaves the points of a scene that ptclight lit: their own light includes that of the sky.
std::vector<glm::vec3> leaving(const std::map<std::string, std::vector<glm::vec3>>& lights) {
  std::vector<glm::vec3> sums = lights.at("own");
  for (std::size_t i = 0; i < sums.size(); ++i) {
    sums[i] += lights.at("albedo")[i] * lights.at("irradiance")[i] * std::numbers::inv_pi_v<float>;
  }
  return sums;
}

/// A floor below a ball, and a panel that emits.
std::vector<Surfel> room(bool emits) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, 0.1, glm::vec3(0));
  add_sphere(surfels, {0.5, 0.6, 0}, 0.4, 0.05, glm::vec3(0));
  const std::size_t lamp = surfels.size();
  if (emits) add_rectangle(surfels, {-1.5, 1, -0.5}, {0.5, 0, 0}, {0, 0, 1}, 0.1, glm::vec3(0));
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    surfels[i].albedo = glm::vec3(0.5F, 0.6F, 0.7F);
    if (i >= lamp) surfels[i].emission = glm::vec3(3, 2, 1);
  }
  return surfels;
}

LightRig grouped() {
  LightRig rig;
  rig.suns.push_back({.to_sun = glm::normalize(glm::vec3(1, 2, 0.3F)),
                      .irradiance = glm::vec3(3, 2, 1),
                      .group = "key"});
  rig.points.push_back({.position = {-1, 1.5, 1}, .intensity = glm::vec3(0.5F, 1, 1)});
  rig.spots.push_back(
      {.position = {1, 3, 1}, .direction = {0, -1, 0}, .intensity = glm::vec3(4), .group = "key"});
  rig.sky = {.radiance = {0.1F, 0.2F, 0.4F}, .group = "fill"};
  return rig;
}

LightReport relight(const std::filesystem::path& scene, const std::filesystem::path& target,
                    const LightRig& rig) {
  LightRequest request{{.scene = scene}};
  request.lights = rig;
  Progress silent;
  return light_container(request, target, silent);
}

ShadeRequest in_groups(const std::filesystem::path& scene) {
  ShadeRequest request{{.scene = scene}};
  request.light_groups = true;
  return request;
}

}  // namespace

TEST_CASE("light groups: each is what its lights alone give, and the sum is all light",
          "[integration][groups]") {
  const TemporaryDirectory dir;
  const bool emits = GENERATE(false, true);
  const bool several_bounces = GENERATE(false, true);
  write_scene(dir / "room.ptcx", room(emits));
  relight(dir / "room.ptcx", dir / "lit.ptcx", grouped());
  Progress silent;
  ShadeRequest request = in_groups(dir / "lit.ptcx");
  request.bounces = several_bounces ? 3 : 1;
  const LightingReport report = shade_container(request, dir / "groups.ptcx", silent);
  CHECK(report.receivers == ContainerReader(dir / "room.ptcx").superblock().points);
  const auto groups = values_of(dir / "groups.ptcx");
  REQUIRE(groups.count("light_key") == 1);
  REQUIRE(groups.count("light_fill") == 1);
  REQUIRE(groups.count("light_rest") == 1);
  CHECK(groups.size() == 10);
  CHECK(verify_container(dir / "groups.ptcx", {.level = VerifyLevel::rebuild}, silent).sound());

  // The sum is what leaves the points, and what a run with all lights finds
  const auto all =
      sum(sum(groups.at("light_key"), groups.at("light_fill")), groups.at("light_rest"));
  CHECK(difference(all, leaving(groups)) < 0.003);
  request.light_groups = false;
  shade_container(request, dir / "plain.ptcx", silent);
  const auto plain = values_of(dir / "plain.ptcx");
  CHECK(difference(all, leaving(plain)) < 0.01);
  CHECK(difference(groups.at("bent_normal"), plain.at("bent_normal")) == 0);

  // The sky alone, and nothing that emits
  LightRig fill;
  fill.sky = grouped().sky;
  write_scene(dir / "dark.ptcx", [&] {
    std::vector<Surfel> surfels = room(emits);
    for (Surfel& s : surfels) s.emission = glm::vec3(0);
    return surfels;
  }());
  relight(dir / "dark.ptcx", dir / "fill.ptcx", fill);
  request.scene = dir / "fill.ptcx";
  shade_container(request, dir / "shaded.ptcx", silent);
  const auto alone = values_of(dir / "shaded.ptcx");
  CHECK(difference(groups.at("light_fill"), leaving(alone)) < 0.003);
}

TEST_CASE("light groups: a plane under the sky alone has the light of the formula",
          "[integration][groups]") {
  const TemporaryDirectory dir;
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, 0.1, glm::vec3(0));
  for (Surfel& s : surfels) s.albedo = glm::vec3(0.5F);
  write_scene(dir / "plane.ptcx", surfels);
  LightRig rig;
  rig.sky = {.radiance = glm::vec3(1), .group = "fill"};
  relight(dir / "plane.ptcx", dir / "lit.ptcx", rig);
  Progress silent;
  shade_container(in_groups(dir / "lit.ptcx"), dir / "groups.ptcx", silent);
  const auto groups = values_of(dir / "groups.ptcx");
  for (const glm::vec3& light : groups.at("light_fill"))
    CHECK(light.g == Approx(0.5F).epsilon(0.01));
}

TEST_CASE("light groups: what emits is part of the rest", "[integration][groups]") {
  const TemporaryDirectory dir;
  write_scene(dir / "room.ptcx", room(true));
  LightRig rig = grouped();
  rig.points.clear();
  relight(dir / "room.ptcx", dir / "lit.ptcx", rig);
  Progress silent;
  shade_container(in_groups(dir / "lit.ptcx"), dir / "groups.ptcx", silent);
  const auto groups = values_of(dir / "groups.ptcx");
  float key = 0, rest = 0;
  for (const glm::vec3& v : groups.at("light_key")) key = std::max(key, v.r);
  for (const glm::vec3& v : groups.at("light_rest")) rest = std::max(rest, v.r);
  CHECK(rest >= 3);
  CHECK(key < 1);
  // Without what emits there is no rest
  write_scene(dir / "dark.ptcx", room(false));
  relight(dir / "dark.ptcx", dir / "lit.ptcx", rig);
  shade_container(in_groups(dir / "lit.ptcx"), dir / "groups.ptcx", silent);
  CHECK(values_of(dir / "groups.ptcx").count("light_rest") == 0);
}

TEST_CASE("light groups: threads and caps change no byte, and files of points have the channels",
          "[integration][groups]") {
  const TemporaryDirectory dir;
  write_scene(dir / "room.ptcx", room(true));
  relight(dir / "room.ptcx", dir / "lit.ptcx", grouped());
  Progress silent;
  ShadeRequest request = in_groups(dir / "lit.ptcx");
  request.run.threads = 1;
  shade_container(request, dir / "one.ptcx", silent);
  request.run = {.memory_bytes = 170U << 20, .threads = 3};
  shade_container(request, dir / "three.ptcx", silent);
  CHECK(bytes_of(dir / "one.ptcx") == bytes_of(dir / "three.ptcx"));
  shade_container(request, dir / "groups.ply", silent);
  const std::vector<char> ply = bytes_of(dir / "groups.ply");
  const std::string head(ply.begin(), ply.begin() + 2000);
  for (const char* name : {"light_key_r", "light_fill_g", "light_rest_b", "indirect_r"})
    CHECK(head.find(std::string("property float ") + name + "\n") != std::string::npos);
  CHECK(std::distance(std::filesystem::directory_iterator(dir.path()), {}) == 5);
}

TEST_CASE("light groups: many have room, and the next shading or light replaces them",
          "[integration][groups]") {
  const TemporaryDirectory dir;
  write_scene(dir / "room.ptcx", room(false));
  LightRig rig;
  for (int i = 0; i < 7; ++i) {
    rig.suns.push_back({.to_sun = glm::normalize(glm::vec3(i - 3, 2, 1)),
                        .irradiance = glm::vec3(1),
                        .group = "sun_" + std::to_string(i)});
  }
  relight(dir / "room.ptcx", dir / "lit.ptcx", rig);
  Progress silent;
  shade_container(in_groups(dir / "lit.ptcx"), dir / "groups.ptcx", silent);
  CHECK(verify_container(dir / "groups.ptcx", {.level = VerifyLevel::rebuild}, silent).sound());
  CHECK(ContainerReader(dir / "groups.ptcx").meta().channels.size() == 5 + 7);
  shade_container({{.scene = dir / "groups.ptcx"}}, dir / "again.ptcx", silent);
  CHECK(ContainerReader(dir / "again.ptcx").meta().channels.size() == 5);
  relight(dir / "groups.ptcx", dir / "dark.ptcx", rig);
  CHECK(ContainerReader(dir / "dark.ptcx").meta().channels.empty());
}

TEST_CASE("light groups: receivers of their own get the light of each", "[integration][groups]") {
  const TemporaryDirectory dir;
  write_scene(dir / "room.ptcx", room(true));
  relight(dir / "room.ptcx", dir / "lit.ptcx", grouped());
  write_scene(dir / "probes.ptcx", [] {
    std::vector<Surfel> probes;
    add_rectangle(probes, {-1, 0.5, -1}, {0, 0, 1}, {1, 0, 0}, 0.1, glm::vec3(0));
    for (Surfel& s : probes) s.albedo = glm::vec3(1);
    return probes;
  }());
  Progress silent;
  ShadeRequest request = in_groups(dir / "lit.ptcx");
  request.receivers = dir / "probes.ptcx";
  shade_container(request, dir / "groups.ptcx", silent);
  const auto groups = values_of(dir / "groups.ptcx");
  const auto all =
      sum(sum(groups.at("light_key"), groups.at("light_fill")), groups.at("light_rest"));
  CHECK(difference(all, groups.at("indirect")) < 0.003);
  request.light_groups = false;
  shade_container(request, dir / "plain.ptcx", silent);
  CHECK(difference(all, values_of(dir / "plain.ptcx").at("indirect")) < 0.01);
}

TEST_CASE("light groups: the layers of a picture add up to its beauty", "[integration][groups]") {
  const TemporaryDirectory dir;
  const auto mesh = std::make_shared<Mesh>();
  mesh->positions = {{-2, 0, -2}, {-2, 0, 2}, {2, 0, 2},   {2, 0, -2},
                     {-1, 1, 0},  {1, 1, 0},  {0, 2, 0.3F}};
  mesh->triangles = {{{0, 1, 2}, {0, 2, 3}, {4, 5, 6}}};
  mesh->material_of = {0, 0, 1};
  mesh->materials = {{.albedo = glm::vec3(0.5F)},
                     {.albedo = glm::vec3(0.5F), .emission = glm::vec3(1, 2, 3)}};
  BuildRequest build{.mesh = mesh, .lights = grouped()};
  build.sampling.count = 3000;
  Progress silent;
  build_container(build, dir / "scene.ptcx", silent);
  RenderRequest request{{.scene = dir / "scene.ptcx"}};
  const bool sees_mesh = GENERATE(true, false);
  if (sees_mesh) request.mesh = mesh;
  request.size = {{64, 48}};
  request.samples = 1;
  const std::vector<PictureTarget> plain{{dir / "plain.exr"}}, target{{dir / "groups.exr"}};
  render_picture(request, plain, silent);
  request.light_groups = true;
  render_picture(request, target, silent);
  const auto key = read_layer(dir / "groups.exr", "light_key"),
             fill = read_layer(dir / "groups.exr", "light_fill"),
             rest = read_layer(dir / "groups.exr", "light_rest"),
             beauty = read_layer(dir / "groups.exr", "");
  CHECK(difference(sum(sum(key, fill), rest), beauty) < 0.002);
  CHECK(difference(key, beauty) > 0.1);
  CHECK(difference(read_layer(dir / "plain.exr", "albedo"),
                   read_layer(dir / "groups.exr", "albedo")) == 0);
  // The surfels of a build have light from the mesh, those of a group from discs
  double mean = 0, off = 0;
  const auto other = read_layer(dir / "plain.exr", "");
  for (std::size_t i = 0; i < beauty.size(); ++i) {
    mean += static_cast<double>(other[i].g);
    off += static_cast<double>(beauty[i].g - other[i].g);
  }
  CHECK(std::abs(off) < 0.01 * mean);
}

TEST_CASE("light groups: what a run in groups cannot do is refused", "[integration][groups]") {
  const TemporaryDirectory dir;
  write_scene(dir / "room.ptcx", room(false));
  relight(dir / "room.ptcx", dir / "lit.ptcx", grouped());
  Progress silent;
  const auto refusal = [&](const std::function<void(ShadeRequest&)>& change) {
    ShadeRequest request = in_groups(dir / "lit.ptcx");
    change(request);
    try {
      shade_container(request, dir / "out.ply", silent);
    } catch (const RequestError& error) {
      return error.field();
    }
    return std::string("none");
  };
  CHECK(refusal([](ShadeRequest& r) { r.count = 5; }) == "count");
  CHECK(refusal([](ShadeRequest& r) { r.sky = Sky{}; }) == "sky");
  CHECK(refusal([](ShadeRequest& r) { r.error = 0.1; }) == "error");
  CHECK(refusal([](ShadeRequest& r) { r.check.receivers = 5; }) == "check");
  CHECK(refusal([](ShadeRequest& r) { r.tolerate_damage = true; }) == "tolerate_damage");
  CHECK(refusal([&](ShadeRequest& r) { r.scene = dir / "room.ptcx"; }) == "light_groups");
  CHECK_FALSE(std::filesystem::exists(dir / "out.ply"));
  LightRig wrong = grouped();
  wrong.suns[0].group = "a b";
  CHECK_THROWS_AS(relight(dir / "room.ptcx", dir / "wrong.ptcx", wrong), RequestError);
  wrong.suns[0].group = "rest";
  CHECK_THROWS_AS(relight(dir / "room.ptcx", dir / "wrong.ptcx", wrong), RequestError);
}
