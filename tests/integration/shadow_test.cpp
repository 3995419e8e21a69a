// Shadows of groups of lights, in points and in pictures.
#include <algorithm>
#include <cmath>

#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
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

const glm::dvec3 kBall(0.3, 0.8, 0), kLamp(0, 2.5, 0.4);
constexpr double kRadius = 0.4;

/// A sun in the group "key", a lamp in the group "fill" and one without a group.
LightRig lights() {
  LightRig rig;
  rig.suns.push_back({.to_sun = glm::normalize(glm::vec3(1, 2, 0.3F)),
                      .irradiance = glm::vec3(3, 2, 1),
                      .angular_radius = 0,
                      .group = "key"});
  rig.points.push_back({.position = kLamp, .intensity = glm::vec3(1, 2, 3), .group = "fill"});
  rig.points.push_back({.position = {0, -3, 0}, .intensity = glm::vec3(1)});
  return rig;
}

/// A floor below a ball.
std::vector<Surfel> scene() {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, 0.04, glm::vec3(0.1F));
  add_sphere(surfels, kBall, kRadius, 0.04, glm::vec3(0.1F));
  for (Surfel& s : surfels) s.albedo = glm::vec3(0.5F);
  return surfels;
}

/// Distance of the ball's centre from the way from a place to a light, less its radius.
/// @param way  to the light
double clearance(const glm::dvec3& place, const glm::dvec3& way) {
  const glm::dvec3 to = kBall - place;
  const double along = std::clamp(glm::dot(to, way) / glm::dot(way, way), 0.0, 1.0);
  return glm::length(to - along * way) - kRadius;
}

void light_scene(const TemporaryDirectory& dir) {
  write_scene(dir / "scene.ptcx", scene());
  LightRequest request{{.scene = dir / "scene.ptcx"}};
  request.lights = lights();
  Progress silent;
  light_container(request, dir / "lit.ptcx", silent);
}

ShadeRequest shadows(const std::filesystem::path& of, std::vector<std::string> groups) {
  ShadeRequest request{{.scene = of}};
  request.shadows = std::move(groups);
  return request;
}

std::vector<float> read_channel(const std::filesystem::path& path, const std::string& channel) {
  Imf::InputFile file(path.c_str());
  const auto window = file.header().dataWindow();
  const auto width = static_cast<std::size_t>(window.max.x + 1);
  std::vector<float> pixels(width * static_cast<std::size_t>(window.max.y + 1), -1);
  Imf::FrameBuffer frame;
  frame.insert(channel, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(pixels.data()),
                                   sizeof(float), sizeof(float) * width));
  file.setFrameBuffer(frame);
  file.readPixels(0, window.max.y);
  return pixels;
}

}  // namespace

TEST_CASE("shadow: points know what hides each light from them", "[integration][shadow]") {
  const TemporaryDirectory dir;
  light_scene(dir);
  Progress silent;
  shade_container(shadows(dir / "lit.ptcx", {"key", "fill", "rest"}), dir / "out.ptcx", silent);
  CHECK(verify_container(dir / "out.ptcx", {.level = VerifyLevel::rebuild}, silent).sound());
  const auto values = values_of(dir / "out.ptcx");
  const ContainerReader out(dir / "out.ptcx");
  const std::vector<Surfel> surfels = load_surfels(out, out.superblock().points);
  int dark = 0, bright = 0;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const Surfel& s = surfels[i];
    if (s.normal.y < 0.99F || s.position.y > 0.01) continue;
    // The lamp below the floor reaches no front
    CHECK(values.at("shadow_rest")[i].x == 1);
    for (const bool sun : {true, false}) {
      const glm::dvec3 way =
          sun ? 100.0 * glm::dvec3(glm::normalize(glm::vec3(1, 2, 0.3F))) : kLamp - s.position;
      const double free = clearance(s.position, way);
      if (std::abs(free) < 0.06) continue;
      CAPTURE(sun, free, s.position.x, s.position.z);
      CHECK(values.at(sun ? "shadow_key" : "shadow_fill")[i].x == Approx(free < 0 ? 1 : 0));
      ++(free < 0 ? dark : bright);
    }
  }
  CHECK(dark > 300);
  CHECK(bright > 5000);
}

TEST_CASE("shadow: threads and caps change no byte, and files know the channels again",
          "[integration][shadow]") {
  const TemporaryDirectory dir;
  light_scene(dir);
  Progress silent;
  ShadeRequest request = shadows(dir / "lit.ptcx", {"key", "fill"});
  request.glossy.roughness = 0.5F;
  request.run.threads = 1;
  shade_container(request, dir / "one.ptcx", silent);
  request.run = {.memory_bytes = 220U << 20, .threads = 3};
  shade_container(request, dir / "three.ptcx", silent);
  CHECK(bytes_of(dir / "one.ptcx") == bytes_of(dir / "three.ptcx"));
  CHECK(ContainerReader(dir / "one.ptcx").meta().channels.size() == 5 + 2 + 2);
  shade_container({{.scene = dir / "one.ptcx"}}, dir / "again.ptcx", silent);
  CHECK(ContainerReader(dir / "again.ptcx").meta().channels.size() == 5);
  // A file of points, and what becomes of its columns
  shade_container(request, dir / "lit.ply", silent);
  const auto has_shadow = [&](const char* name) {
    return std::ranges::any_of(ContainerReader(dir / name).meta().channels,
                               [](const Channel& c) { return c.name.starts_with("shadow_"); });
  };
  build_container({.inputs = {dir / "lit.ply"}}, dir / "cloud.ptcx", silent);
  CHECK(has_shadow("cloud.ptcx"));
  shade_container({{.scene = dir / "cloud.ptcx"}}, dir / "clean.ptcx", silent);
  CHECK_FALSE(has_shadow("clean.ptcx"));
}

TEST_CASE("shadow: pictures have one as a layer, of meshes and of points",
          "[integration][shadow]") {
  const TemporaryDirectory dir;
  const auto mesh = std::make_shared<Mesh>();
  mesh->positions = {{-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2},
                     {-1, 1, -1}, {-1, 1, 1}, {1, 1, 1}, {1, 1, -1}};
  mesh->triangles = {{{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}}};
  mesh->material_of = {0, 0, 0, 0};
  mesh->materials = {{.albedo = glm::vec3(0.5F), .double_sided = true}};
  LightRig rig;
  rig.suns.push_back({.to_sun = {0, 1, 0}, .angular_radius = 0, .group = "key"});
  BuildRequest build{.mesh = mesh, .lights = rig};
  build.sampling.count = 8000;
  Progress silent;
  build_container(build, dir / "scene.ptcx", silent);
  RenderRequest request{{.scene = dir / "scene.ptcx"}};
  request.shadows = {"key"};
  const bool sees_mesh = GENERATE(true, false);
  if (sees_mesh) request.mesh = mesh;
  // From the side, below the upper square: the floor is dark up to 1 from its middle
  request.camera = Camera{.position = {0, 0.7, 5},
                          .look_at = {0, 0, 0},
                          .vertical_fov = 0.4F,
                          .width = 80,
                          .height = 60};
  request.size = {{80, 60}};
  request.samples = 1;
  const std::vector<PictureTarget> target{{dir / "picture.exr"}};
  render_picture(request, target, silent);
  const std::vector<float> shadow = read_channel(dir / "picture.exr", "shadow_key.V"),
                           alpha = read_channel(dir / "picture.exr", "A");
  int dark = 0, bright = 0;
  for (unsigned y = 0; y < 60; ++y) {
    for (unsigned x = 0; x < 80; ++x) {
      const std::size_t i = y * 80 + x;
      if (alpha[i] == 0) {
        CHECK(shadow[i] == 0);
        continue;
      }
      const glm::dvec3 d(
          request.camera->direction(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F));
      if (d.y > -0.01) continue;
      const glm::dvec3 at = request.camera->position + d * (-0.7 / d.y);
      const double out = std::max(std::abs(at.x), std::abs(at.z)) - 1;
      if (std::abs(out) < 0.15 || std::max(std::abs(at.x), std::abs(at.z)) > 1.9) continue;
      CAPTURE(sees_mesh, x, y, at.x, at.z);
      CHECK(shadow[i] == (out < 0 ? 1 : 0));
      ++(out < 0 ? dark : bright);
    }
  }
  CHECK(dark > 50);
  CHECK(bright > 50);
}

TEST_CASE("shadow: what cannot be found is refused", "[integration][shadow]") {
  const TemporaryDirectory dir;
  light_scene(dir);
  Progress silent;
  for (const std::vector<std::string>& groups :
       {std::vector<std::string>{"other"}, std::vector<std::string>{"key", "key"},
        std::vector<std::string>{""}}) {
    CHECK_THROWS_AS(shade_container(shadows(dir / "lit.ptcx", groups), dir / "o.ply", silent),
                    RequestError);
  }
  ShadeRequest damaged = shadows(dir / "lit.ptcx", {"key"});
  damaged.tolerate_damage = true;
  CHECK_THROWS_AS(shade_container(damaged, dir / "o.ply", silent), RequestError);
  ShadeRequest grouped = shadows(dir / "lit.ptcx", {"key"});
  grouped.light_groups = true;
  CHECK_THROWS_AS(shade_container(grouped, dir / "o.ply", silent), RequestError);
  RenderRequest render{{.scene = dir / "lit.ptcx"}};
  render.shadows = {"key"};
  const std::vector<PictureTarget> png{{dir / "o.png"}};
  CHECK_THROWS_AS(render_picture(render, png, silent), RequestError);
  CHECK(std::distance(std::filesystem::directory_iterator(dir.path()), {}) == 2);
}
