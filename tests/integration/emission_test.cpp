// Scenes with points that emit light, through every step that writes a container.
#include <algorithm>
#include <fstream>
#include <tuple>

#include <catch2/catch.hpp>

#include "engine/pipeline/convert/convert.h"
#include "engine/ptc.h"
#include "engine/verify/salvage.h"
#include "engine/verify/verify.h"
#include "format/point_page.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr glm::vec3 kLamp(3, 2, 0.5F);  // half a dozen bits, which every profile keeps

/// Every third of random surfels emits light; all reflect some.
std::vector<Surfel> lamps(std::size_t count, std::uint64_t seed) {
  std::vector<Surfel> surfels = random_surfels(count, seed);
  for (std::size_t i = 0; i < count; ++i) {
    surfels[i].radiance = glm::vec3(0.25F);
    if (i % 3 == 0) surfels[i].emission = kLamp;
  }
  return surfels;
}

/// A room of 4 x 4 x 4 without walls: a floor, and a lamp of 1 x 1 above its middle.
Mesh lit_floor() {
  Mesh mesh;
  mesh.materials = {{.name = "white", .albedo = glm::vec3(0.8F)},
                    {.name = "lamp", .albedo = glm::vec3(0), .emission = kLamp}};
  const auto add = [&](const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
                       std::uint16_t material) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
    mesh.triangles.insert(mesh.triangles.end(),
                          {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
    mesh.material_of.insert(mesh.material_of.end(), {material, material});
  };
  add({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, 0);
  add({-0.5F, 2, -0.5F}, {1, 0, 0}, {0, 0, 1}, 1);
  return mesh;
}

/// Returns emission and radiance of all points, in the order of the container.
std::vector<std::pair<glm::vec3, glm::vec3>> light_of(const std::filesystem::path& path) {
  std::vector<std::pair<glm::vec3, glm::vec3>> light;
  for (const Surfel& s : points_of(path)) light.emplace_back(s.emission, s.radiance);
  return light;
}

/// Returns the sum of area times emission.
glm::dvec3 power_of(const std::vector<Surfel>& surfels) {
  glm::dvec3 power(0);
  for (const Surfel& s : surfels) {
    const double area = 2.0 * static_cast<double>(s.radius) * static_cast<double>(s.radius);
    power += area * glm::dvec3(s.emission);
  }
  return power;
}

/// Checks every rule, builds the tree again, and checks that points have room for emission.
void check_sound(const std::filesystem::path& path) {
  INFO(path.filename());
  Progress silent;
  const VerifyReport report = verify_container(path, {.level = VerifyLevel::rebuild}, silent);
  CHECK(report.findings.empty());
  CHECK(report.tree_digest);
  CHECK(ContainerReader(path).header().point_bytes == kEmittingPointBytes);
}

}  // namespace

TEST_CASE("emission: what a mesh emits stays with its points from build to shading and conversion",
          "[integration][emission]") {
  for (const Profile profile : {Profile::exact, Profile::compact}) {
    const TemporaryDirectory dir;
    Progress silent;
    BuildRequest build{.mesh = std::make_shared<const Mesh>(lit_floor()), .profile = profile};
    build.lights = LightRig{.suns = {{{0, 1, 0}, glm::vec3(1), 0}}};
    build.sampling.count = 8000;
    build.sampling.lights.area_rays = 0;
    build.page_shift = 12;
    build.run = {.memory_bytes = std::uint64_t{256} << 20, .threads = 1};
    build_container(build, dir / "a.ptcx", silent);
    check_sound(dir / "a.ptcx");
    const std::vector<Surfel> points = points_of(dir / "a.ptcx");
    for (const Surfel& s : points) {
      REQUIRE(s.emission == (s.position.y > 1 ? kLamp : glm::vec3(0)));
      if (s.position.y > 1) REQUIRE(s.radiance == glm::vec3(0));  // the lamp is black
    }
    CHECK(std::ranges::count_if(points, [](const Surfel& s) { return s.radiance.r > 0; }) > 5000);
    for (int c = 0; c < 3; ++c)
      CHECK(power_of(points)[c] == Approx(double{kLamp[c]}).epsilon(0.01));  // of 1 x 1

    const ShadeRequest shade{
        {.scene = dir / "a.ptcx", .run = {.memory_bytes = std::uint64_t{256} << 20, .threads = 1}}};
    shade_container(shade, dir / "lit.ptcx", silent);
    check_sound(dir / "lit.ptcx");
    const auto light = light_of(dir / "a.ptcx");
    CHECK(light_of(dir / "lit.ptcx") == light);

    // Copy pages, page again, and build the tree again.
    for (const auto& [to, shift] : {std::pair(Profile::exact, std::uint8_t{12}),
                                    {Profile::raw, std::uint8_t{12}},
                                    {Profile::exact, std::uint8_t{16}},
                                    {Profile::compact, std::uint8_t{13}}}) {
      recode_container(ContainerReader(dir / "lit.ptcx"), dir / "out.ptcx",
                       {.profile = to, .page_shift = shift, .run = build.run}, silent);
      check_sound(dir / "out.ptcx");
      const ContainerReader out(dir / "out.ptcx");
      CHECK(out.meta().channels.size() == 5);
      if (to != Profile::compact) CHECK(light_of(dir / "out.ptcx") == light);
      CHECK(power_of(points_of(dir / "out.ptcx")).r == Approx(power_of(points).r).epsilon(0.005));
    }
  }
}

TEST_CASE("emission: a cloud keeps it through a build, a conversion to PLY and another build",
          "[integration][emission]") {
  const TemporaryDirectory dir;
  Progress silent;
  write_ply(dir / "a.ply", lamps(9000, 1), true);
  BuildRequest build{.inputs = {dir / "a.ply"}, .page_shift = 12, .profile = Profile::exact};
  build_container(build, dir / "a.ptcx", silent);
  check_sound(dir / "a.ptcx");
  const auto light = light_of(dir / "a.ptcx");
  CHECK(std::ranges::count(light, std::pair(kLamp, glm::vec3(0.25F))) == 3000);
  CHECK(std::ranges::count(light, std::pair(glm::vec3(0), glm::vec3(0.25F))) == 6000);
  container_to_points(ContainerReader(dir / "a.ptcx"), dir / "b.ply", {}, silent);
  build.inputs = {dir / "b.ply"};
  build_container(build, dir / "b.ptcx", silent);
  check_sound(dir / "b.ptcx");
  CHECK(light_of(dir / "b.ptcx") == light);
  for (std::size_t c = 0; c < 3; ++c) {
    CHECK(ContainerReader(dir / "b.ptcx").superblock().flux[c] ==
          Approx(ContainerReader(dir / "a.ptcx").superblock().flux[c]));
  }
}

TEST_CASE("emission: room for it is made by the first points that emit light, and stays",
          "[integration][emission]") {
  for (const Profile profile : {Profile::exact, Profile::compact}) {
    const TemporaryDirectory dir;
    Progress silent;
    const std::vector<Surfel> dark = random_surfels(7000, 2), bright = lamps(5000, 1);
    write_ply(dir / "dark.ply", dark, false);
    write_ply(dir / "bright.ply", bright, true);
    const auto build = [&](const char* target, const std::vector<std::filesystem::path>& inputs,
                           const char* append) {
      BuildRequest request{.inputs = inputs, .page_shift = 12, .profile = profile};
      if (append) request.append = dir / append;
      build_container(request, dir / target, silent);
    };
    build("dark.ptcx", {dir / "dark.ply"}, nullptr);
    CHECK(ContainerReader(dir / "dark.ptcx").header().point_bytes == kPointBytes);
    build("bright.ptcx", {dir / "bright.ply"}, nullptr);
    build("both.ptcx", {dir / "dark.ply", dir / "bright.ply"}, nullptr);
    build("dark-bright.ptcx", {dir / "bright.ply"}, "dark.ptcx");
    build("bright-dark.ptcx", {dir / "dark.ply"}, "bright.ptcx");
    const auto sorted = [&](const char* name) {
      std::vector<std::tuple<float, float, float, float>> values;
      for (const Surfel& s : points_of(dir / name))
        values.emplace_back(s.radius, s.normal.x, s.emission.r, s.radiance.r);
      std::ranges::sort(values);
      return values;
    };
    for (const char* name : {"both.ptcx", "dark-bright.ptcx", "bright-dark.ptcx"}) {
      check_sound(dir / name);
      CHECK(sorted(name) == sorted("both.ptcx"));
    }
  }
}

TEST_CASE("emission: salvaged points keep it", "[integration][emission]") {
  const TemporaryDirectory dir;
  Progress silent;
  write_scene(dir / "a.ptcx", lamps(3000, 3));
  const ContainerReader whole(dir / "a.ptcx");
  auto light = light_of(dir / "a.ptcx");
  const std::uint32_t lost = 7;
  std::fstream(dir / "a.ptcx", std::ios::in | std::ios::out | std::ios::binary)
      .seekp(static_cast<std::streamoff>(whole.entry(lost).offset + kPageHeaderBytes))
      .write("damage", 6);
  const SalvageReport report = salvage_container(dir / "a.ptcx", dir / "kept.ptcx", {}, silent);
  const auto from = light.begin() + lost * points_per_page(whole.header());
  light.erase(from, from + whole.entry(lost).record_count);
  CHECK(light_of(dir / "kept.ptcx") == light);
  CHECK(report.points == light.size());
  CHECK(report.flux_share == Approx(0.97).margin(0.02));
  check_sound(dir / "kept.ptcx");
}
